// The table of a page.

/** A table with a head over every column. */
const table = (heads, rows) => tag("table", {},
  tag("thead", {}, tag("tr", {}, ...heads.map((head) => (head ? tag("th", { scope: "col" }, head) : tag("td"))))), tag("tbody", {}, ...rows));
/** What may be wider or higher than its place: it scrolls, by keys too. */
const scrolled = (...inside) => tag("div", { class: "scroll", tabindex: 0, role: "group" }, ...inside);

// The table of a page.

/** A table with a head over every column. */
const table = (heads, rows) => tag("table", {},
  tag("thead", {}, tag("tr", {}, ...heads.map((head) => tag("th", head && { scope: "col" }, head)))), tag("tbody", {}, ...rows));
const scrolled = (...inside) => tag("div", { class: "scroll" }, ...inside);

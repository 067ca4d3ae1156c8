// Parts of the panels, and numbers as texts.

const quiet = (words) => tag("p", { class: "quiet" }, words);
const rowHead = (...words) => tag("th", { scope: "row" }, ...words);
const scrolled = (...inside) => tag("div", { class: "scroll" }, ...inside);
const counted = (many, word) => `${many} ${word}${many === 1 ? "" : "s"}`;
const table = (names, rows) => tag("table", {},
  tag("thead", {}, tag("tr", {}, tag("th"), ...names.map((name) => tag("th", { scope: "col" }, name)))), tag("tbody", {}, ...rows));

/** A number in three digits; at most `noise` in size it is rounding alone, and is 0. */
function brief(value, noise = 0) {
  if (Number.isNaN(value)) return "NaN";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  if (size <= noise) return "0";
  const text = size && (size < 1e-3 || size >= 1e5) ? value.toExponential(1) : String(+value.toPrecision(3));
  return text.replace("-", "−").replace("e−", "e-");
}

/** A text of at most so many letters: of a longer one, its ends. */
function fitted(text, most) {
  const letters = [...text], room = Math.max(4, Math.floor(most) - 1);
  if (letters.length <= room + 1) return text;
  return `${letters.slice(0, Math.ceil(room / 2)).join("")}…${letters.slice(letters.length - Math.floor(room / 2)).join("")}`;
}

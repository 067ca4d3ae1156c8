// Elements of pages and of their pictures, and numbers as texts. Texts stay texts, whatever is in them.

const SVG = "http://www.w3.org/2000/svg";
function filled(made, attributes, inside = []) {
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  made.append(...inside);
  return made;
}
/** An element around texts and other elements. */
const tag = (name, attributes = {}, ...inside) => filled(document.createElement(name), attributes, inside);
/** An element of a picture. */
const drawn = (name, attributes = {}, ...inside) => filled(document.createElementNS(SVG, name), attributes, inside);
/** An element of a picture, the last in another. */
const element = (name, attributes, parent, ...inside) => parent.appendChild(drawn(name, attributes, ...inside));
const byId = (id) => document.getElementById(id);

/** A finite number in so many digits, of a very small or large one two less with its power of ten. */
function numeral(value, digits) {
  const size = Math.abs(value);
  const text = size && (size < 1e-3 || size >= 1e5) ? value.toExponential(digits - 2) : String(+value.toPrecision(digits));
  return text.replaceAll("-", "−");
}

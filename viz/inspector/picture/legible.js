// Semantic zoom: texts that would be too small to read vanish, and names of what is large are written larger, as far as they fit.

const TEXT = 13, LEGIBLE = 9; // pixels: of texts in the picture at scale 1, and the least on the screen
const WIDE = 0.57; // width of a letter for its height

/** Fit texts to the scale: { names: [{ text, name, width, size, height }] } of what is drawn. */
function legible(app) {
  const { k } = app.seen, small = TEXT * k < LEGIBLE;
  if (!small && !app.drawn.small) return;
  app.drawn.small = small;
  app.svg.classList.toggle("small", small);
  for (const { text, name, width, size, height = 0 } of app.drawn.names) {
    const letters = Math.floor(width * k / (WIDE * LEGIBLE));
    if (small && letters < Math.min(4, name.length)) text.textContent = "";
    else if (height && (!small || height * k >= 2 * LEGIBLE)) writeName(text, name, small ? letters : NAME.line, small ? LEGIBLE / k : undefined);
    else text.textContent = fitted(name, small ? letters : width / (WIDE * size));
    text.style.fontSize = small ? `${LEGIBLE / k}px` : "";
  }
}

/** Write a name in a line, or in two where it has more letters than `most`, parted between words, the halves as equal as can be. */
function writeName(text, name, most, size = TEXT) {
  const ends = [...name.matchAll(/[ _.-]/g)].map(({ index }) => index + 1), middle = name.length / 2;
  const end = ends.reduce((best, each) => (Math.abs(each - middle) < Math.abs(best - middle) ? each : best), ends[0] ?? Math.ceil(middle));
  if ([...name].length <= most) { text.textContent = name; return; }
  text.replaceChildren();
  [name.slice(0, end), name.slice(end)].forEach((part, i) => {
    element("tspan", { x: text.getAttribute("x"), dy: i ? 1.1 * size : 0 }, text).textContent = fitted(part.trimEnd(), most);
    if (part.endsWith(" ")) text.append(" ");
  });
}

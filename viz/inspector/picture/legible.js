// Semantic zoom: texts that would be too small to read vanish, and names of what is large are written larger, as far as they fit.

const TEXT = 13, LEGIBLE = 9; // pixels: of texts in the picture at scale 1, and the least on the screen
const WIDE = 0.57; // width of a letter for its height

/** Fit texts to the scale: { names: [{ text, name, width, size }] } of what is drawn. */
function legible(app) {
  const { k } = app.seen, small = TEXT * k < LEGIBLE;
  if (!small && !app.drawn.small) return;
  app.drawn.small = small;
  app.svg.classList.toggle("small", small);
  for (const { text, name, width, size } of app.drawn.names) {
    const letters = Math.floor(width * k / (WIDE * LEGIBLE));
    text.textContent = small ? (letters >= Math.min(4, name.length) ? fitted(name, letters) : "") : fitted(name, width / (WIDE * size));
    text.style.fontSize = small ? `${LEGIBLE / k}px` : "";
  }
}

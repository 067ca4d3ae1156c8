// What of the picture is seen: fitting, zooming, moving, with wheel, pointer, two fingers.

const READ = 11 / 13; // the least scale at which the smallest text, of 13 px, has 11
const NARROW = 820, TALLEST = 1.3; // pixels; of the window, the picture where the page is one column

function setView(app, view) {
  app.seen = view;
  app.drawn.scene.setAttribute("transform", `translate(${view.x} ${view.y}) scale(${view.k})`);
}

/** The size of the place for the picture, in pixels; in one column it may be higher than the window. */
function room(app) {
  const { width, height } = app.svg.getBoundingClientRect();
  if (innerWidth > NARROW) return { width: width || 900, height: height || 600 };
  return { width: width || innerWidth, height: TALLEST * innerHeight };
}

/** The scale at which a layout is seen whole. */
const fitting = ({ width, height }, layout) => Math.min(1.6, (width - 24) / layout.width, (height - 16) / layout.height);

function fitView(app) {
  const size = room(app), { layout } = app.drawn;
  const k = fitting(size, layout), narrow = innerWidth <= NARROW;
  size.height = narrow ? Math.max(240, layout.height * k + 16) : size.height;
  app.svg.style.height = narrow ? `${size.height}px` : "";
  setView(app, { k, x: (size.width - layout.width * k) / 2, y: (size.height - layout.height * k) / 2 });
}

function zoom(app, factor, x, y) {
  const { k, x: tx, y: ty } = app.seen;
  const to = Math.max(0.04, Math.min(6, k * factor));
  setView(app, { k: to, x: x - (x - tx) * to / k, y: y - (y - ty) * to / k });
}

/** Move the picture so that a node is in it. */
function center(app, node) {
  const at = app.drawn.items.get(app.drawn.shownBy[node])?.at;
  if (!at) return;
  const { width, height } = app.svg.getBoundingClientRect(), { k } = app.seen;
  const x = app.seen.x + (at.x + at.w / 2) * k, y = app.seen.y + (at.y + at.h / 2) * k;
  if (x < 40 || y < 40 || x > width - 40 || y > height - 40) {
    setView(app, { ...app.seen, x: app.seen.x + width / 2 - x, y: app.seen.y + height / 2 - y });
  }
}

/** Listen to wheel and pointers: one moves the picture, two pinch it. */
function listenToPointers(app, { hovered, clicked }) {
  const { svg } = app, down = new Map(); // pointer: where it is
  let hold = null;
  const inPicture = (x, y) => { const at = svg.getBoundingClientRect(); return [x - at.left, y - at.top]; };
  const spread = () => { const [a, b] = [...down.values()]; return { far: Math.hypot(a[0] - b[0], a[1] - b[1]), x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2 }; };
  const grasp = () => { hold = { view: app.seen, moved: hold?.moved ?? false, at: [...down.values()][0], two: down.size > 1 ? spread() : null }; };
  svg.addEventListener("pointerover", (event) => { if (!hold) hovered(event.target.closest?.(".item")?.id); });
  svg.addEventListener("pointerleave", () => { if (!hold) hovered(null); });
  svg.addEventListener("pointerdown", (event) => { down.set(event.pointerId, inPicture(event.clientX, event.clientY)); grasp(); });
  svg.addEventListener("pointermove", (event) => {
    if (!down.has(event.pointerId)) return;
    down.set(event.pointerId, inPicture(event.clientX, event.clientY));
    const [dx, dy] = [0, 1].map((i) => [...down.values()][0][i] - hold.at[i]);
    if (!hold.moved && !hold.two && Math.hypot(dx, dy) < 5) return;
    if (!hold.moved) svg.setPointerCapture(event.pointerId); // before, a click would go to the whole picture
    hold.moved = true;
    if (!hold.two) { setView(app, { ...hold.view, x: hold.view.x + dx, y: hold.view.y + dy }); return; }
    const now = spread(), { k, x, y } = hold.view;
    const to = Math.max(0.04, Math.min(6, k * now.far / Math.max(1, hold.two.far)));
    setView(app, { k: to, x: now.x - (hold.two.x - x) * to / k, y: now.y - (hold.two.y - y) * to / k });
  });
  const lift = (event) => {
    down.delete(event.pointerId);
    if (down.size) grasp(); else { const last = hold; setTimeout(() => { if (hold === last) hold = null; }); }
  };
  svg.addEventListener("pointerup", lift);
  svg.addEventListener("pointercancel", lift);
  svg.addEventListener("click", (event) => { if (!hold?.moved) clicked(event.target); });
  svg.addEventListener("wheel", (event) => {
    event.preventDefault();
    zoom(app, Math.exp(-event.deltaY * 0.0015), ...inPicture(event.clientX, event.clientY));
  }, { passive: false });
}

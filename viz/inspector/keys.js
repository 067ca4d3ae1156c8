// What the page listens to: the picture, buttons, fields and keys; and what of the picture is seen: fitting, zooming, moving.

const READ = 11 / 13; // the least scale at which the smallest text, of 13 px, has 11
const NARROW = 820, TALLEST = 1.3; // pixels; of the window, the picture where the page is one column

function setView(app, view) {
  app.seen = view;
  app.drawn.scene.setAttribute("transform", `translate(${view.x} ${view.y}) scale(${view.k})`);
  legible(app);
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

/** Zoom in on a box until its texts can be read. */
function approach(app, at) {
  const { width, height } = app.svg.getBoundingClientRect();
  if (app.seen.k >= READ) return;
  const k = READ;
  setView(app, { k, x: width / 2 - k * (at.x + at.w / 2), y: k * at.h > height ? 12 - k * at.y : height / 2 - k * (at.y + at.h / 2) });
}

/** Zoom a view, so that what was at a place comes to x, y. */
function zoom(app, factor, x, y, view = app.seen, from = { x, y }) {
  const { k } = view, to = Math.max(0.04, Math.min(6, k * factor));
  setView(app, { k: to, x: x - (from.x - view.x) * to / k, y: y - (from.y - view.y) * to / k });
}

/** Move the picture so that a node is in it. */
function center(app, node) {
  const at = shownAs(app, node)?.at;
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
    const now = spread();
    zoom(app, now.far / Math.max(1, hold.two.far), now.x, now.y, hold.view, hold.two);
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

/** Walk along an edge, or to a neighbor. */
function walk(app, key) {
  const { version, drawn } = app, node = app.picked >= 0 ? app.picked : version.outputs[0][2];
  if (app.picked < 0) { pick(app, node); center(app, node); return; }
  const here = shownAs(app, node);
  const next = {
    ArrowUp: () => version.users[node][0],
    ArrowDown: () => version.args[node].find((arg) => !version.constants.has(arg)),
    ArrowLeft: () => beside(drawn, here, -1), ArrowRight: () => beside(drawn, here, 1),
  }[key]();
  if (next === undefined) return;
  Object.assign(app, { picked: -1, before: -1 }); // so that walking does not ask why
  pick(app, next);
  center(app, next);
  trace(app, drawn.shownBy[next]);
}

function beside(drawn, here, way) {
  let best, least = Infinity;
  drawn.items.forEach((item) => {
    const dx = (item.at.x + item.at.w / 2 - here.at.x - here.at.w / 2) * way;
    const dy = Math.abs(item.at.y + item.at.h / 2 - here.at.y - here.at.h / 2);
    if (item !== here && !item.output && dx > 1 && dx + 6 * dy < least) { least = dx + 6 * dy; [best] = item.nodes; }
  });
  return best;
}

/** Unfold or fold what holds the picked node. */
function foldHere(app) {
  if (app.picked < 0) return;
  const c = app.plan.cluster[app.plan.place[app.version.index][app.picked]];
  if (c < 0) return;
  const column = app.plan.columnOf[c];
  if (app.view.closed.has(column)) toggle(app, "closed", column); else toggle(app, "folded", c);
}

function letGo(app) {
  document.activeElement?.blur?.();
  byId("search").value = "";
  clear(app, "found");
  Object.assign(app, { picked: -1, before: -1, path: null });
  stepTo(app, -1);
  teach(app, -1);
  trace(app, null);
  refresh(app);
}

function switchTheme() {
  const root = document.documentElement;
  const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
  root.dataset.theme = dark ? "light" : "dark";
}

function switchValues(app) {
  const on = app.svg.classList.toggle("values");
  byId("values").setAttribute("aria-pressed", on);
}

function listen(app) {
  listenToPointers(app, {
    hovered: (id) => trace(app, id),
    clicked: (target) => {
      const over = target.closest("[data-cluster], [data-node], [data-column], [data-bundle]")?.dataset;
      if (over?.cluster !== undefined) toggle(app, "folded", +over.cluster);
      else if (over?.column !== undefined) toggle(app, "closed", +over.column);
      else if (over?.bundle !== undefined) toggle(app, "unbundled", over.bundle);
      else if (over) pick(app, +over.node);
    },
  });
  const clicks = {
    fold: () => detail(app, -1), unfold: () => detail(app, 1), fit: () => fitView(app), theme: switchTheme, copylink: () => copyView(app), values: () => switchValues(app),
    back: () => stepTo(app, app.sweep - 1), on: () => stepTo(app, app.sweep + 1), nosweep: () => stepTo(app, -1),
    play: () => play(app, !app.playing), reset: () => app.state.show(app.state.frame),
  };
  for (const id in clicks) byId(id).onclick = clicks[id];
  byId("search").oninput = () => find(app, byId("search").value);
  byId("search").onkeydown = (event) => {
    const node = event.key === "Enter" ? find(app, byId("search").value) : null;
    if (node === null) return;
    goTo(app, node);
    find(app, byId("search").value);
  };
  byId("lessonback").onclick = () => teach(app, app.lesson - 1);
  byId("lessonon").onclick = () => teach(app, app.lesson + 1);
  byId("lessonstep").oninput = () => teach(app, +byId("lessonstep").value - 1);
  byId("sweep").oninput = () => stepTo(app, +byId("sweep").value);
  byId("outline").ontoggle = () => showOutline(app);
  addEventListener("hashchange", () => openLink(app));
  byId("from").onchange = () => { app.from = byId("from").value; refresh(app); stepTo(app, app.sweep); };
  byId("time").oninput = () => { play(app, false); app.state.show(+byId("time").value); };
  document.addEventListener("keydown", (event) => { if (pressed(app, event)) event.preventDefault(); });
  addEventListener("beforeprint", () => {
    byId("wide").querySelectorAll("details").forEach((each) => { each.open = true; });
    byId("printed").replaceChildren(tag("b", {}, "Inputs: "), inputsInWords(app));
  });
  addEventListener("resize", () => {
    if (app.other) return;
    if (!app.view.chosen) app.view = firstView(app); // what a person unfolded stays
    redraw(app, true);
  });
}

/** Whether a key meant something. */
function pressed(app, event) {
  if (event.key === "Escape") { letGo(app); return false; }
  if (event.target.closest("input, select, textarea") || event.ctrlKey || event.metaKey || event.altKey) return false;
  const { key } = event, middle = [app.svg.clientWidth / 2, app.svg.clientHeight / 2];
  if (event.target.closest("button, summary") && (key === " " || key === "Enter")) return false;
  const actions = {
    "/": () => byId("search").focus(), " ": () => play(app, !app.playing), f: () => detail(app, -1), u: () => detail(app, 1),
    v: () => switchValues(app), 0: () => fitView(app), "[": () => stepTo(app, app.sweep - 1), "]": () => stepTo(app, app.sweep + 1),
    "+": () => zoom(app, 1.25, ...middle), "-": () => zoom(app, 0.8, ...middle), Enter: () => foldHere(app),
  };
  const turn = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[key];
  const tabs = [...byId("versions").children], tab = tabs.indexOf(event.target);
  if (turn && tab >= 0) {
    const next = (tab + turn + tabs.length) % tabs.length;
    choose(app, next);
    keepView(app);
    tabs[next].focus();
  } else if (app.other && !(key >= "1" && key <= "9")) return false;
  else if (turn) walk(app, key);
  else if (key >= "1" && key <= "9") { choose(app, +key - 1); keepView(app); }
  else if (actions[key]) actions[key]();
  else return false;
  return true;
}

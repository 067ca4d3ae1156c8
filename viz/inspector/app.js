// The page: a record of graphs is shown, in one state, and switched, folded, asked, stepped through and played.
//
// `start(record)` shows a record, by default that of the page's <script id="data">, and returns what other scripts may
// use; on the page it is the constant `inspector`:
//
//   setState(values)       set inputs of the state, {name: number}; all versions, tables and derived inputs follow.
//                          Names are the graphs' or what a person calls them. Throws an Error in one sentence for a name
//                          that is none or is derived, or a number that is not finite, and then changes nothing.
//   state()                all values by the graphs' names, derived ones too
//   reset()                back to the instant of the motion, or what the record began with
//   onState(callback)      call it with state() after every change, at once for the first time; returns how to stop that
//   results()              {version: {output: number}} at the state
//   showRecord(record)     show another record, as viz/inspector/record.py describes it; callbacks stay
//   record()               what is shown

const READABLE = 100; // nodes that are drawn one by one at first
const DRAWABLE = 2500; // more than these are never drawn one by one at once
const BOXES = 48; // clusters that are drawn at first; of more, bodies
const SMALL = 60; // nodes of a graph that shows its values at first

function start(first = JSON.parse(byId("data").textContent)) {
  const callbacks = new Set();
  const app = { svg: byId("picture"), callbacks, playing: false, noises: new WeakMap() };
  app.output = () => (app.version.outputs.find(([name]) => name === app.from) ?? app.version.outputs[0])[2];
  app.partials = () => (app.slopes ??= slopesAt(app.version, app.values));
  app.noise = () => (app.bounds ??= boundsIn(app, app.version, app.partials(), app.values));
  app.refresh = () => refresh(app);
  listen(app);
  showRecord(app, first);
  return {
    setState: (values) => { play(app, false); app.state.set(values); },
    state: () => app.state.values(),
    reset: () => app.state.show(app.state.frame),
    onState: (callback) => { callbacks.add(callback); callback(app.state.values()); return () => callbacks.delete(callback); },
    results: () => Object.fromEntries(app.state.versions.map((version) => {
      const values = app.state.evaluate(version);
      return [version.name, Object.fromEntries(version.outputs.map(([name, , node]) => [name, values[node]]))];
    })),
    showRecord: (record) => showRecord(app, record),
    record: () => app.record,
  };
}

function showRecord(app, record) {
  play(app, false);
  const state = makeState(record, () => stateChanged(app)); // first, so that a bad record leaves the page as it is
  const plan = makePlan(record, state.versions);
  Object.assign(app, { record, state, plan, units: new Map(record.units), from: "", seen: null, chosen: false });
  Object.assign(app, { picked: -1, before: -1, path: null, sweep: -1, lesson: -1, index: 0, version: state.versions[0] });
  app.largest = Math.max(...state.versions.map((version) => version.ops.length));
  byId("title").textContent = document.title = record.title;
  byId("introduction").textContent = record.introduction;
  byId("introduction").hidden = !record.introduction;
  byId("notices").replaceChildren(...record.notices.map((each) => tag("li", {}, each)));
  byId("notices").hidden = !record.notices.length;
  byId("tables").hidden = !byId("tables").querySelector("table");
  app.svg.classList.toggle("values", app.largest <= SMALL);
  byId("values").setAttribute("aria-pressed", app.largest <= SMALL);
  makeVersions(app);
  makeMotion(app);
  makeResults(app);
  makeInputs(app);
  app.view = firstView(app);
  choose(app, 0);
  if (record.motion) state.show(Math.floor(record.motion.t.length / 4)); // on its way: at rest many products are 0
  else stateChanged(app);
}

function stateChanged(app) {
  compute(app);
  showTime(app);
  tellLesson(app);
  if (app.playing) { showValues(app); showResults(app); } else refresh(app);
  app.callbacks.forEach((callback) => callback(app.state.values()));
}

function compute(app) {
  app.values = app.state.evaluate(app.version);
  app.slopes = null;
  if (!app.playing) app.bounds = null; // while it plays, noise is that of where it began
}

function boundsIn(app, graph, slopes, values) {
  const own = ownErrors(graph, values, app.state.errorsOf(graph)), bounds = errorBounds(graph, slopes, own, 0);
  return app.state.solved ? bounds : sharpened(graph, slopes, values, bounds, own);
}

/** Noise of a graph's values: computed only where an output may be noise. */
function noiseIn(app, graph, values) {
  if (values === app.values) return app.noise();
  if (app.playing && app.noises.has(graph)) return app.noises.get(graph);
  const small = 1e-6 * largestOf(values);
  const faint = graph.outputs.some(([, , node]) => Math.abs(values[node]) < small);
  const found = faint ? boundsIn(app, graph, slopesAt(graph, values), values)
    : new Float64Array(values.length);
  app.noises.set(graph, found);
  return found;
}

// Detail: nodes, clusters or bodies

const allOf = (list) => new Set(list.map((_, i) => i));
const levels = (app) => ({
  nodes: { folded: new Set(), closed: new Set() },
  clusters: { folded: allOf(app.plan.clusters), closed: new Set() },
  bodies: { folded: allOf(app.plan.clusters), closed: allOf(app.plan.columns) },
});

/** As much detail as can be read without cutting anything off. */
function firstView(app) {
  const size = room(app), aspect = Math.min(2.5, Math.max(0.4, size.width / size.height)), all = levels(app);
  const view = (level) => ({ ...all[level], unbundled: new Set(), aspect });
  const drawn = app.state.versions.every((version) => version.drawing);
  if (drawn) return view("nodes");
  const scale = (level) => fitting(size, arrange(app.plan, view(level)));
  const order = [...(app.largest <= READABLE ? ["nodes"] : []), "clusters", ...(app.plan.columns.length > 1 ? ["bodies"] : [])];
  const boxes = Math.max(...app.plan.place.map((places) => new Set(places.map((place) => app.plan.cluster[place])).size));
  const clear = (level) => scale(level) >= READ && (level !== "clusters" || boxes <= BOXES);
  return view(order.find(clear) ?? order.sort((a, b) => scale(b) - scale(a))[0]);
}

/** One level of detail more (1) or less (-1). */
function detail(app, way) {
  const { closed, folded } = app.view, all = levels(app);
  const order = app.plan.columns.length > 1 ? ["bodies", "clusters", "nodes"] : ["clusters", "nodes"];
  const now = closed.size ? "bodies" : folded.size ? "clusters" : "nodes";
  let to = order.indexOf(now) + way;
  if (way < 0 && folded.size < app.plan.clusters.length && now === "clusters") to += 1; // first fold what is unfolded
  if (way > 0 && closed.size < app.plan.columns.length && now === "bodies") to = order.indexOf("clusters");
  const level = order[Math.max(0, Math.min(order.length - 1, to))];
  if (level === "nodes" && app.largest > DRAWABLE) {
    byId("trail").textContent = `More than ${DRAWABLE} nodes: click boxes to unfold them one by one.`;
    return;
  }
  Object.assign(app.view, all[level]);
  app.chosen = true;
  redraw(app, true);
}

const flip = (set, key) => { if (set.has(key)) set.delete(key); else set.add(key); };

/** Fold or unfold a cluster, a column or a kind of leaves; what was clicked stays where it is. */
function toggle(app, kind, key) {
  const at = (layout) => ({ folded: layout.boxes?.[key], closed: layout.bodies?.[key] ?? layout.titles?.find((each) => each.column === key) }[kind]);
  const before = at(app.drawn.layout);
  flip(app.view[kind], key);
  app.chosen = true;
  redraw(app, false);
  const { k, x, y } = app.seen, after = at(app.drawn.layout);
  if (before && after) setView(app, { k, x: x + (before.x - after.x) * k, y: y + (before.y - after.y) * k });
}

// Drawing

function redraw(app, fit) {
  app.drawn = draw(app.svg, app.record, app.plan, app.version, app.view);
  announce(app); // first: its words may take a line from the picture
  if (fit || !app.seen) fitView(app); else setView(app, app.seen);
  compute(app);
  refresh(app);
}

function refresh(app) {
  const bars = showValues(app);
  paintSweep(app);
  paintLesson(app);
  paintPath(app);
  markPicked(app);
  showNode(app, bars);
  showResults(app);
  showInputs(app);
}

// Choices

function makeVersions(app) {
  const { versions } = app.state;
  byId("versions").replaceChildren(...versions.map((each, i) => {
    const button = tag("button", { type: "button", role: "radio" }, each.name);
    if (each.flawed) button.className = "flawed";
    button.onclick = () => choose(app, i);
    return button;
  }));
  byId("versions").hidden = versions.length < 2;
}

function choose(app, i) {
  const { versions } = app.state;
  if (!versions[i]) return;
  const places = app.plan.place[app.index];
  const keep = (node) => (node < 0 ? -1 : app.plan.place[i].indexOf(places[node]));
  const [picked, before] = [keep(app.picked), keep(app.before)];
  app.bounds = null;
  Object.assign(app, { index: i, version: versions[i], picked, before, path: null, sweep: -1, lesson: -1 });
  [...byId("versions").children].forEach((button, k) => {
    button.setAttribute("aria-checked", k === i);
    button.tabIndex = k === i ? 0 : -1;
  });
  const was = room(app).height;
  showLegend(app);
  byId("about").textContent = app.version.about;
  byId("about").hidden = !app.version.about;
  byId("about").classList.toggle("flawed", app.version.flawed);
  byId("sweep").max = 2 * app.version.ops.length;
  byId("from").replaceChildren(...app.version.outputs.map(([name, letters]) => tag("option", { value: name }, shownName(app, name, letters))));
  if (app.version.outputs.some(([name]) => name === app.from)) byId("from").value = app.from;
  const resized = room(app).height !== was; // by the words above it
  if (resized && !app.chosen) app.view = firstView(app);
  redraw(app, !app.seen || resized || Boolean(app.version.drawing));
  showCounts(app);
  makeLesson(app);
  stepTo(app, -1);
}

function pick(app, node) {
  if (node === app.picked) return;
  Object.assign(app, { before: app.picked, picked: node, path: null });
  if (app.before >= 0) {
    const [a, b] = [Math.min(app.before, node), Math.max(app.before, node)];
    app.path = heaviest(app.version, app.partials(), a, b, 1)[0]?.nodes ?? null;
  }
  refresh(app);
}

/** Unfold what holds a node, pick it and bring it into view. */
function goTo(app, node) {
  const c = app.plan.cluster[app.plan.place[app.index][node]];
  if (c >= 0) {
    const column = app.plan.columnOf[c];
    if (app.view.closed.has(column)) toggle(app, "closed", column);
    if (app.view.folded.has(c)) toggle(app, "folded", c);
  }
  pick(app, node);
  center(app, node);
}

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
//   onView(name, callback) a view that is no graph, such as "live": call it when its tab is first opened

const READABLE = 100; // nodes that are drawn one by one at first
const DRAWABLE = 2500; // more than these are never drawn one by one at once
const BOXES = 48; // clusters that are drawn at first; of more, bodies
const SMALL = 60; // nodes of a graph that shows its values at first

function start(first = JSON.parse(byId("data").textContent)) {
  const callbacks = new Set();
  const app = { svg: byId("picture"), callbacks, first, playing: false, waiting: new Map(), noises: new WeakMap() };
  app.output = () => (app.version.outputs.find(([name]) => name === app.from) ?? app.version.outputs[0])[2];
  app.partials = () => (app.slopes ??= slopesAt(app.version, app.values));
  app.noise = () => (app.bounds ??= boundsIn(app, app.version, app.partials(), app.values));
  app.refresh = () => refresh(app);
  listen(app);
  showRecord(app, first);
  openLink(app);
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
    onView: (name, callback) => { if (app.other === name) callback(); else app.waiting.set(name, callback); },
  };
}

function showRecord(app, record) {
  play(app, false);
  const state = makeState(record, () => stateChanged(app)); // first, so that a bad record leaves the page as it is
  Object.assign(app, { record, state, groups: new Map(), units: new Map(record.units), from: "", other: "" });
  Object.assign(app, { picked: -1, before: -1, path: null, sweep: -1, lesson: -1, index: -1, version: null });
  byId("title").textContent = document.title = record.title;
  byId("introduction").textContent = record.introduction;
  byId("introduction").hidden = !record.introduction;
  byId("notices").replaceChildren(...record.notices.map((each) => tag("li", {}, each)));
  byId("notices").hidden = !record.notices.length;
  byId("tables").hidden = !byId("tables").querySelector("table");
  makeTabs(app);
  makeMotion(app);
  makeInputs(app);
  choose(app, firstVersion(app).at);
  if (record.motion) state.show(firstFrame(record));
  else stateChanged(app);
}

function stateChanged(app) {
  compute(app);
  showTime(app);
  tellLesson(app);
  if (app.playing) { showValues(app); showResults(app); } else refresh(app);
  keepState(app);
  app.callbacks.forEach((callback) => callback(app.state.values()));
}

function compute(app) {
  app.values = app.state.evaluate(app.version);
  app.slopes = null;
  if (!app.playing) app.bounds = null; // while it plays, noise is that of where it began
}

function boundsIn(app, graph, slopes, values) {
  const own = ownErrors(graph, values, app.state.errorsOf(graph)), bounds = errorBounds(graph, slopes, own, 0);
  return app.state.solved(graph) ? bounds : sharpened(graph, slopes, values, bounds, own);
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

// Versions of a group share places: their plan, what of it is folded and what is seen of it

/** The group of a version, made when it is first shown: { plan, view, seen, largest, versions }. */
function ownGroup(app, { group }) {
  if (!app.groups.has(group)) {
    const versions = app.state.versions.filter((each) => each.group === group);
    const largest = Math.max(...versions.map((version) => version.ops.length));
    app.groups.set(group, { versions, largest, plan: makePlan(app.record, versions), view: null, seen: null });
  }
  return app.groups.get(group);
}
function enterGroup(app, version) {
  app.own = ownGroup(app, version);
  Object.assign(app, { plan: app.own.plan, largest: app.own.largest, view: app.own.view, seen: app.own.seen });
  app.view ??= firstView(app);
  app.svg.classList.toggle("values", app.largest <= SMALL);
  byId("values").setAttribute("aria-pressed", app.largest <= SMALL);
  makeResults(app);
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
  const scale = (level) => fitting(size, arrange(app.plan, view(level)));
  const coarsest = app.plan.columns.length > 1 ? "bodies" : "clusters";
  const drawings = app.own.versions.map(({ drawing }) => drawing);
  if (drawings.every(Boolean) && drawings.every((each) => fitting(size, each) >= (innerWidth > NARROW ? LEGIBLE / TEXT : READ))) return view("nodes");
  if (innerWidth <= NARROW) return view(app.largest <= SMALL && scale("nodes") >= READ ? "nodes" : coarsest);
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
  Object.assign(app.view, all[level], { chosen: true });
  redraw(app, true);
  keepView(app);
}

const flip = (set, key) => { if (set.has(key)) set.delete(key); else set.add(key); };

/** Fold or unfold a cluster, a column or a kind of leaves; what was clicked stays where it is. */
function toggle(app, kind, key) {
  const at = (layout) => ({ folded: layout.boxes?.[key], closed: layout.bodies?.[key] ?? layout.titles?.find((each) => each.column === key) }[kind]);
  const before = at(app.drawn.layout);
  flip(app.view[kind], key);
  app.view.chosen = true;
  redraw(app, false);
  const { k, x, y } = app.seen, after = at(app.drawn.layout);
  if (before && after) {
    setView(app, { k, x: x + (before.x - after.x) * k, y: y + (before.y - after.y) * k });
    if (kind !== "unbundled" && !app.view[kind].has(key)) approach(app, after); // what was unfolded is to be read
  }
  keepView(app);
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
  showOutline(app);
}

// Choices

/** The version that the record has first, by its name or its place. */
const firstVersion = ({ state, record }) => state.versions.find(({ name }) => name === record.view) ?? state.versions[0];

const LIVE = "live"; // the view of another script, where the page has its section

/** The versions that have an output of a version, too. */
function alike(versions, { outputs }) {
  const own = new Set(outputs.map(([name]) => name));
  return versions.filter((each) => each.outputs.some(([name]) => own.has(name)));
}

/** A tab for every version, and for the motion that is computed as it is watched, which is of the page's first record. */
function makeTabs(app) {
  const { versions } = app.state, others = app.record === app.first && byId(LIVE) ? [LIVE] : [];
  const right = alike(versions, versions[0]).filter(({ flawed }) => !flawed);
  const fewest = Math.min(...right.map(({ ops }) => ops.length));
  const tabs = versions.map((each, i) => {
    const button = tag("button", { type: "button", role: "tab", "aria-controls": "view" }, each.name);
    if (each.flawed) button.className = "flawed";
    if (right.some(({ ops }) => ops.length > fewest) && right.includes(each) && each.ops.length === fewest) button.append(" ", tag("small", {}, "smallest"));
    if (i && versions[i - 1].group !== each.group) button.classList.add("apart");
    return button;
  });
  tabs.push(...others.map((name) => tag("button", { type: "button", role: "tab", class: "apart", "aria-controls": name }, name)));
  tabs.forEach((button, i) => { button.onclick = () => { choose(app, i); keepView(app); }; });
  byId("versions").replaceChildren(...tabs);
  byId("versions").hidden = tabs.length < 2;
}

/** Show the view of a tab: a version, or what another script shows. */
function choose(app, i) {
  const { versions } = app.state, tabs = [...byId("versions").children];
  if (!tabs[i] || (i === app.index && !app.other)) return;
  tabs.forEach((button, k) => filled(button, { "aria-selected": k === i, tabindex: k === i ? 0 : -1 }));
  app.other = versions[i] ? "" : tabs[i].textContent;
  byId("view").hidden = Boolean(app.other);
  byId("wide").hidden = byId("about").hidden = Boolean(app.other);
  byId(LIVE)?.toggleAttribute("hidden", app.other !== LIVE);
  document.body.classList.toggle("elsewhere", Boolean(app.other));
  if (app.other) {
    play(app, false);
    app.waiting.get(app.other)?.();
    app.waiting.delete(app.other);
    return;
  }
  showVersion(app, i);
}

/** The node of a version that is the output, or has the name, of a node of another one; -1 where there is none. */
function namesake(version, other, node) {
  const named = ({ names, inputs }) => [...Object.entries(names).map(([k, [name]]) => [name, +k]), ...inputs];
  const result = other.outputs.find(([, , k]) => k === node)?.[0];
  if (result !== undefined) return version.outputs.find(([name]) => name === result)?.[2] ?? -1;
  const name = named(other).find(([, k]) => k === node)?.[0];
  return named(version).find(([each]) => each === name)?.[1] ?? -1;
}

function showVersion(app, i) {
  const { versions } = app.state, was = room(app).height, old = app.version, apart = old?.group !== versions[i].group;
  const inPlace = (node) => (apart ? -1 : app.plan.place[versions[i].index].indexOf(app.plan.place[old.index][node]));
  const keep = (node) => (node < 0 ? -1 : Math.max(inPlace(node), namesake(versions[i], old, node)));
  const picked = keep(app.picked), before = picked < 0 ? -1 : keep(app.before);
  if (old) Object.assign(app.own, { view: app.view, seen: app.seen });
  app.bounds = null;
  Object.assign(app, { index: i, version: versions[i], picked, before, path: null, sweep: -1, lesson: -1 });
  if (apart) enterGroup(app, app.version);
  showLegend(app);
  byId("about").textContent = app.version.about;
  byId("about").hidden = !app.version.about;
  byId("about").classList.toggle("flawed", app.version.flawed);
  byId("sweep").max = 2 * app.version.ops.length;
  byId("from").replaceChildren(...app.version.outputs.map(([name, letters]) => tag("option", { value: name }, shownName(app, name, letters))));
  if (app.version.outputs.some(([name]) => name === app.from)) byId("from").value = app.from;
  for (const id of ["statetables", "wide"]) byId(id).hidden = !byId(id).children.length;
  const resized = room(app).height !== was; // by the words above it
  if (resized && !app.view.chosen) app.view = firstView(app);
  redraw(app, !app.seen || resized || Boolean(app.version.drawing));
  showCounts(app);
  makeLesson(app);
  stepTo(app, -1);
}

function pick(app, node) {
  if (node === app.picked) return;
  pickNode(app, node);
  refresh(app);
  keepView(app);
}
function pickNode(app, node) {
  Object.assign(app, { before: app.picked, picked: node, path: null });
  if (app.before >= 0) {
    const [a, b] = [Math.min(app.before, node), Math.max(app.before, node)];
    app.path = heaviest(app.version, app.partials(), a, b, 1)[0]?.nodes ?? null;
  }
}

/** Unfold what holds a node, pick it and bring it into view. */
function goTo(app, node) {
  const c = app.plan.cluster[app.plan.place[app.version.index][node]];
  if (c >= 0) {
    const column = app.plan.columnOf[c];
    if (app.view.closed.has(column)) toggle(app, "closed", column);
    if (app.view.folded.has(c)) toggle(app, "folded", c);
  }
  pick(app, node);
  center(app, node);
}

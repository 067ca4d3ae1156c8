// The page's address says what is seen: the view, what is picked, what is folded, the instant and the state. Back goes back.

const SOON = 400; // ms: browsers allow the address to change a hundred times in half a minute

/** What an address says; no such % is made by a page. */
const unescaped = (text) => { try { return decodeURIComponent(text); } catch { return text; } };
const inAddress = (name) => encodeURIComponent(name.replaceAll(" ", "_"));

/** A node in the address: its number as listed, or the name of an input. */
function nodeInLink({ number, names }, node) {
  return number[node] ? String(number[node]) : encodeURIComponent(names[node]?.[0] ?? "");
}
function nodeOfLink({ byNumber, inputs }, text) {
  if (/^\d+$/.test(text)) return byNumber.get(+text) ?? -1;
  return inputs.find(([name]) => name === text)?.[1] ?? -1;
}

/** What is folded: one of the levels of detail, or closed columns ~ unfolded clusters ~ unfolded kinds of leaves. */
function foldsInLink(app) {
  const { folded, closed, unbundled, chosen } = app.view, { clusters, columns } = app.plan;
  if (!chosen) return null;
  const open = clusters.flatMap((_, c) => (folded.has(c) ? [] : [c]));
  if (!unbundled.size) {
    if (!closed.size && !folded.size) return "nodes";
    if (!open.length && !closed.size) return "clusters";
    if (!open.length && closed.size === columns.length) return "bodies";
  }
  return [[...closed], open, [...unbundled].map(encodeURIComponent)].map((each) => each.join(".")).join("~");
}
function foldsOfLink(app, text) {
  const all = levels(app);
  if (all[text]) return { ...all[text], unbundled: new Set() };
  const [closed, open, unbundled] = text.split("~").map((each) => each.split(".").filter(Boolean));
  if (!unbundled) return null;
  const folded = allOf(app.plan.clusters);
  open.forEach((c) => folded.delete(+c));
  return { folded, closed: new Set(closed.map(Number).filter((i) => app.plan.columns[i] !== undefined)), unbundled: new Set(unbundled.map(unescaped)) };
}

/** The parts of the address that say what is seen. */
function viewInLink(app) {
  const { version, state, record } = app, first = firstFrame(record);
  const picked = [app.before, app.picked].filter((node) => node >= 0).map((node) => nodeInLink(version, node)).join(",");
  return {
    view: app.other || (version === firstVersion(app) ? null : inAddress(version.name)),
    pick: picked || null,
    fold: foldsInLink(app),
    time: state.frame === first ? null : String(state.frame),
    at: state.edited ? Object.entries(state.changed()).map(([name, value]) => `${encodeURIComponent(name)}:${value}`).join(",") : null,
  };
}
/** The instant that is shown at first: on its way, since at rest many products are 0. */
const firstFrame = ({ motion }) => (motion ? Math.floor(motion.t.length / 4) : 0);

/** Have what is seen in the address, as a step that Back goes back over. */
function keepView(app) {
  if (!app.opening) keepParts(viewInLink(app), true);
}
/** Have the state in the address, soon, and with no such step. */
function keepState(app) {
  if (app.opening || app.playing || !app.drawn) return;
  clearTimeout(app.keeping);
  app.keeping = setTimeout(() => keepParts(viewInLink(app), false), SOON);
}
function copyView(app) {
  keepParts(viewInLink(app), false);
  copyByButton(byId("copylink"));
}

/** Show what the address says; what it says wrongly stays as it is. */
function openLink(app) {
  const views = [...app.state.versions.map(({ name }) => inAddress(name)), LIVE];
  const view = linkPart("view") ?? inAddress(firstVersion(app).name), i = views.indexOf(encodeURIComponent(unescaped(view)));
  app.opening = true;
  try {
    if (i >= 0) choose(app, i);
    if (!app.other) openVersion(app);
  } finally {
    app.opening = false;
  }
}

function openVersion(app) {
  const [fold, pick, time, at] = ["fold", "pick", "time", "at"].map(linkPart);
  const folds = fold === undefined ? { ...firstView(app), chosen: false } : { ...foldsOfLink(app, fold), chosen: true };
  if (folds.folded && (fold ?? null) !== foldsInLink(app)) {
    Object.assign(app.view, folds);
    redraw(app, true);
  }
  const frame = Number(time ?? firstFrame(app.record)), changed = at === undefined ? {} : stateOfLink(app, at);
  if (app.record.rows[frame] && (frame !== app.state.frame || app.state.edited)) app.state.show(frame);
  if (Object.keys(changed).length) app.state.set(changed);
  const picked = (pick ?? "").split(",").filter(Boolean).map((each) => nodeOfLink(app.version, unescaped(each)));
  Object.assign(app, { picked: -1, before: -1, path: null });
  if (picked.every((node) => node >= 0)) picked.slice(-2).forEach((node) => pickNode(app, node));
  refresh(app);
}
function stateOfLink(app, text) {
  const given = text.split(",").map((each) => each.split(":")).map(([name, value]) => [unescaped(name), Number(value)]);
  return Object.fromEntries(given.filter(([name, value]) => app.record.inputs.includes(name) && Number.isFinite(value)));
}

// What the page listens to: the picture, buttons, fields and keys.

/** Walk along an edge, or to a neighbor. */
function walk(app, key) {
  const { version, drawn } = app, node = app.picked >= 0 ? app.picked : version.outputs[0][2];
  if (app.picked < 0) { pick(app, node); center(app, node); return; }
  const here = drawn.items.get(drawn.shownBy[node]);
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
  const c = app.plan.cluster[app.plan.place[app.index][app.picked]];
  if (c < 0) return;
  const column = app.plan.columns.indexOf(app.plan.clusters[c].column);
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
    fold: () => detail(app, -1), unfold: () => detail(app, 1), fit: () => fitView(app), theme: switchTheme, values: () => switchValues(app),
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
  byId("from").onchange = () => { app.from = byId("from").value; refresh(app); stepTo(app, app.sweep); };
  byId("time").oninput = () => { play(app, false); app.state.show(+byId("time").value); };
  document.addEventListener("keydown", (event) => { if (pressed(app, event)) event.preventDefault(); });
  addEventListener("beforeprint", () => byId("wide").querySelectorAll("details").forEach((each) => { each.open = true; }));
  addEventListener("resize", () => {
    if (!app.chosen) app.view = firstView(app); // what a person unfolded stays
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
  if (turn && event.target.closest("[role=radiogroup]")) { // as radio buttons do
    const all = app.state.versions.length;
    choose(app, (app.index + turn + all) % all);
    byId("versions").children[app.index].focus();
  } else if (turn) walk(app, key);
  else if (key >= "1" && key <= "9") choose(app, +key - 1);
  else if (actions[key]) actions[key]();
  else return false;
  return true;
}

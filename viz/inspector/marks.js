// Marks in the picture: what a node needs and what needs it, paths and how many there are, steps of a sweep, what was found.

/** Marks (1) on a node and all that it needs, or with `users` all that need it. */
function reach(neighbours, start) {
  const found = new Uint8Array(neighbours.length);
  const stack = [start];
  found[start] = 1;
  while (stack.length) {
    for (const next of neighbours[stack.pop()]) {
      if (!found[next]) { found[next] = 1; stack.push(next); }
    }
  }
  return found;
}

/** The number of paths from source to sink, exact. */
function pathCount(version, source, sink) {
  const counts = new Map([[source, 1n]]);
  for (let node = source + 1; node <= sink; node++) {
    let sum = 0n;
    for (const arg of version.args[node]) sum += counts.get(arg) ?? 0n;
    if (sum) counts.set(node, sum);
  }
  return counts.get(sink) ?? 0n;
}

/** The k paths of the greatest |product of slopes|, as [{ nodes, slots, product }]; those with a zero are left out.
 *
 * slots: by which argument each node but the first is reached. */
function heaviest(version, slopes, source, sink, k) {
  const needed = reach(version.args, sink);
  const best = new Map([[source, [{ node: source, weight: 0, product: 1, before: null }]]]);
  for (let node = source + 1; node <= sink; node++) {
    if (!needed[node]) continue;
    const ways = [];
    version.args[node].forEach((arg, slot) => {
      const slope = slopes[node][slot];
      if (slope === 0 || !Number.isFinite(slope)) return;
      for (const way of best.get(arg) ?? []) {
        ways.push({ node, slot, weight: way.weight + Math.log(Math.abs(slope)), product: way.product * slope, before: way });
      }
    });
    if (ways.length) best.set(node, ways.sort((a, b) => b.weight - a.weight).slice(0, k));
  }
  return (best.get(sink) ?? []).map((end) => {
    const nodes = [], slots = [];
    for (let way = end; way; way = way.before) {
      nodes.unshift(way.node);
      if (way.before) slots.unshift(way.slot);
    }
    return { nodes, slots, product: end.product };
  });
}

/** A whole number in at most some 15 digits: 12345, or 3.21e+41. */
function digits(count) {
  const text = count.toString();
  return text.length <= 15 ? text : `${text[0]}.${text.slice(1, 3)}e+${text.length - 1}`;
}

const SPURIOUS_HEADS = ["spurious nodes", "spurious edges"]; // heads of the columns of `spuriousIn`

/** How many nodes and edges of a version are spurious; where none is left and it is flawed, that a term is gone. */
function spuriousIn({ marked, blamed, flawed }) {
  const counts = [marked.size ?? marked.length, blamed.length];
  return flawed && !counts[0] && !counts[1] ? [0, "0, a term is gone"] : counts;
}

/** Whether an output of a version can be wrong: one of those that it names, or any of a flawed one that names none. */
const wrongIn = ({ flawed, off }, name) => flawed && (!off.size || off.has(name));

/** The wrong results beside the right ones at the state, of a version that is flawed.  found: {name: [value, noise]} of each version. */
function tellNow(app, versions, found) {
  const own = found[versions.indexOf(app.version)], right = found[app.right], { version } = app, unit = (name) => (app.units.has(name) ? ` ${app.units.get(name)}` : "");
  if (!right || !version.flawed) { byId("now").textContent = ""; return; }
  const shown = [...version.off].filter((name) => right.has(name)).map((name) => {
    const [value, truth] = [own, right].map((each) => brief(...each.get(name)));
    return value === truth ? "" : `${app.state.called.get(name) ?? name} is ${value}${unit(name)}, by the ${versions[app.right].name} ${truth}${unit(name)}`;
  }).filter(Boolean);
  const more = shown.length > AT_ONCE ? `, and ${shown.length - AT_ONCE} more` : "";
  byId("now").textContent = version.off.size ? `Now ${shown.length ? `${shown.slice(0, AT_ONCE).join("; ")}${more}` : "both are the same"}.` : "";
}
const AT_ONCE = 3; // results that a sentence names

const clear = (app, ...names) => names.forEach((name) => app.svg.querySelectorAll(`.${name}`).forEach((each) => each.classList.remove(name)));

/** Give an element its part in the trace, "ancestor", "descendant", "on" or ""; only what changes is touched. */
function part(element, name) {
  const old = element.dataset.part ?? "";
  if (old !== name) element.dataset.part = name;
}

function trace(app, id) {
  const { drawn } = app, item = drawn.items.get(id);
  app.svg.classList.toggle("tracing", Boolean(item) || Boolean(app.path));
  if (!item) {
    drawn.items.forEach((each) => part(each.group, ""));
    for (const { path } of drawn.arrows) part(path, "");
    return;
  }
  const { args, users } = app.version, up = new Uint8Array(args.length), down = new Uint8Array(args.length);
  const add = (marks, neighbours, node) => { if (!marks[node] || item.nodes.length === 1) reach(neighbours, node).forEach((yes, i) => { marks[i] |= yes; }); };
  for (const node of item.nodes) {
    add(up, args, node);
    if (!item.output) add(down, users, node);
  }
  drawn.items.forEach((each, other) => {
    if (other === id) { part(each.group, "on"); return; }
    const above = each.nodes.some((node) => down[node]) && !(item.output && each.output);
    const below = !each.output && each.nodes.some((node) => up[node]);
    part(each.group, below ? "ancestor" : above ? "descendant" : "");
  });
  for (const { path, to, pairs } of drawn.arrows) {
    const out = drawn.items.get(to).output;
    const below = !(out && to !== id) && pairs.some(([, t]) => up[t]) && (!out || item.output);
    const above = !item.output && pairs.some(([s]) => down[s]);
    part(path, below ? "ancestor" : above ? "descendant" : "");
  }
}

/** What shows a node: itself or the box that it is in. */
const shownAs = ({ drawn }, node) => drawn.items.get(drawn.shownBy[node]);

/** The same, and the outputs that it is. */
function shapesOf(app, node) {
  const outputs = [...app.drawn.items.values()].filter((item) => item.output && item.nodes.includes(node));
  return [shownAs(app, node), ...outputs].filter(Boolean);
}

function markPicked(app) {
  clear(app, "picked");
  for (const node of [app.picked, app.before]) shapesOf(app, node).forEach((item) => item.group.classList.add("picked"));
}

const nodeAtStep = (app) => (app.sweep <= app.values.length ? app.sweep - 1 : 2 * app.values.length - app.sweep);
const passed = (app, node) => (app.sweep <= app.values.length ? node < app.sweep : node >= 2 * app.values.length - app.sweep);

function paintSweep(app) {
  clear(app, "current", "done");
  app.svg.classList.toggle("stepping", app.sweep >= 0);
  if (app.sweep < 0) return;
  app.drawn.items.forEach((item) => { if (item.nodes.some((node) => passed(app, node))) item.group.classList.add("done"); });
  const node = nodeAtStep(app);
  if (node >= 0) shownAs(app, node)?.group.classList.add("current");
}

function paintPath(app) {
  clear(app, "onpath");
  app.svg.classList.toggle("tracing", Boolean(app.path));
  if (!app.path) return;
  const last = app.path.at(-1), { drawn } = app;
  app.path.slice(0, -1).forEach((node) => shownAs(app, node)?.group.classList.add("onpath"));
  shapesOf(app, last).forEach((item) => item.group.classList.add("onpath"));
  const steps = new Set([...app.path.slice(1).map((node, i) => `${app.path[i]} ${node}`), `${last} ${last}`]); // to an output
  for (const { path, pairs } of drawn.arrows) if (pairs.some(([s, t]) => steps.has(`${s} ${t}`))) path.classList.add("onpath");
}

/** Nodes by a name, a tag, an operation, or their number in the listing, %7 or v7; marks them. The first, or null. */
function find(app, text) {
  clear(app, "found");
  const wanted = text.trim().toLowerCase(), { version, drawn, state } = app;
  if (!wanted) { announce(app); return null; }
  const number = /^[%v]?(\d+)$/.exec(wanted)?.[1];
  const hits = [];
  version.ops.forEach((op, node) => {
    if (version.constants.has(node)) return;
    const [tags, role] = version.labels[version.label[node]], names = version.names[node] ?? [];
    const words = [...names, ...names.map((name) => state.called.get(name) ?? name), ...tags];
    if (number ? version.byNumber.get(+number) === node : words.some((word) => word.toLowerCase().includes(wanted))
      || [op, role].includes(wanted) || (wanted === "spurious" && version.marked.has(node))) hits.push(node);
  });
  version.outputs.forEach(([name, shown, node]) => {
    if (number || ![name, shown, state.called.get(name) ?? name].some((each) => each.toLowerCase().includes(wanted))) return;
    [...drawn.items.values()].filter((item) => item.names?.includes(name)).forEach((item) => item.group.classList.add("found"));
    hits.push(node);
  });
  new Set(hits.map((node) => drawn.shownBy[node])).forEach((id) => drawn.items.get(id)?.group.classList.add("found"));
  byId("trail").textContent = `${counted(hits.length, "node")} found`;
  return hits[0] ?? null;
}

/** How much of the graph is seen node by node. */
function announce(app) {
  const { version, drawn } = app;
  const one = [...drawn.items.values()].filter((item) => item.group.dataset.node !== undefined && !item.output).length;
  const constants = version.constants.size;
  byId("trail").textContent = `${one} of ${version.ops.length - constants} nodes unfolded${constants ? `; ${counted(constants, "constant")}` : ""}`;
}

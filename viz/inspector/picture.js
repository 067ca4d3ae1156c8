// The picture: shapes for bodies, clusters, nodes and outputs, and arrows between what is shown.

/** What the operation of a node shows: its symbol, with the constants among its arguments. */
function caption(version, node) {
  const name = version.names[node];
  const symbol = ROWS[version.ops[node]]?.symbol ?? "";
  if (version.constants.has(node)) return brief(version.constants.get(node));
  if (!version.args[node].length) return name ? name[1] : "";
  const numbers = version.args[node].map((arg) => (version.constants.has(arg) ? brief(version.constants.get(arg)) : ""));
  let shown = symbol;
  if (version.args[node].length === 2) {
    if (version.ops[node] === "pow" && numbers[1]) shown = `^ ${numbers[1]}`;
    else if (numbers[0]) shown = `${numbers[0]} ${symbol}`;
    else if (numbers[1]) shown = `${symbol} ${numbers[1]}`;
  }
  return name ? `${name[1]}: ${shown}` : shown;
}

/** Draw a version; returns its items by id, of each node the id of the item that shows it, and the arrows.
 *
 * view: { folded, closed, unbundled, aspect }.  A version with a drawing has that while nothing is folded. */
function draw(svg, record, plan, version, view) {
  svg.replaceChildren();
  const scene = element("g", { id: "scene" }, svg);
  const frames = element("g", {}, scene), lines = element("g", { class: "lines" }, scene);
  const titles = element("g", { class: "titles" }, scene), shapes = element("g", {}, scene); // no line goes through a title
  const canvas = { record, plan, version, view, frames, lines, titles, shapes, names: [], items: new Map(), shownBy: [], called: new Map(record.called) };
  const own = version.drawing && !view.folded.size && !view.closed.size ? version.drawing : null;
  const layout = own ? asLayout(own, version) : arrange(plan, view, version.index);
  canvas.layout = layout;
  if (!own) {
    drawTitles(canvas);
    drawBodies(canvas);
    drawClusters(canvas);
  }
  drawNodes(canvas);
  drawOutputs(canvas);
  const arrows = drawArrows(canvas, own);
  return { items: canvas.items, shownBy: canvas.shownBy, names: canvas.names, arrows, layout, scene };
}

/** A drawing as boxes: of every node that is no constant, and of the outputs. */
function asLayout(drawing, version) {
  const nodes = drawing.nodes.map((at) => at && { x: at[0] - at[2] / 2, y: at[1] - NODE / 2, w: at[2], h: NODE });
  const outputs = new Map(version.outputs.map(([name], i) => {
    const [x, y, w] = drawing.outputs[i];
    return [name, { x: x - w / 2, y: y - LEAF.height / 2, w, h: LEAF.height }];
  }));
  return { nodes, outputs, width: drawing.width, height: drawing.height, bundles: new Map() };
}

function drawTitles({ plan, layout, frames, titles, names, version }) {
  const here = new Set(version.ops.map((_, node) => clusterOf(plan, version, node)).filter((c) => c >= 0));
  const used = new Set([...here].map((c) => plan.clusters[c].column)), rows = new Set([...here].map((c) => `${plan.columnOf[c]} ${plan.clusters[c].stage}`));
  for (const each of layout.titles) {
    if (each.column === undefined || !used.has(plan.columns[each.column])) continue; // an empty column is not drawn
    const name = plan.columns[each.column];
    const group = element("g", { class: "column", "data-column": each.column, tabindex: -1, role: "button", "aria-label": `fold ${name || "no tag"} to one box` }, frames);
    element("rect", { x: each.x - 6, y: each.y, width: each.w + 12, height: each.h, rx: 8 }, group);
    const text = element("text", { class: "column-title", x: each.x + each.w / 2, y: each.y + 17 }, titles, fitted(name || "no tag", NAME.most));
    names.push({ text, name: name || "no tag", width: each.w, size: 13 });
    element("title", {}, group, name);
  }
  for (const each of layout.titles) {
    const { stage, x, y } = each; // an empty row is not named
    if (each.columns?.some((column) => rows.has(`${column} ${stage}`))) element("text", { class: "stage", x, y }, titles, stage);
  }
}

const clusterOf = (plan, version, node) => plan.cluster[plan.place[version.index][node]];

/** Bodies that are folded: a box, with a bar that says which sweeps its nodes are of, and how many are spurious. */
function drawBodies(canvas) {
  const { plan, version, layout, view, shapes } = canvas;
  const inside = new Map();
  version.ops.forEach((_, node) => {
    const c = clusterOf(plan, version, node), column = plan.columnOf[c] ?? -1;
    if (view.closed.has(column)) inside.set(column, [...(inside.get(column) ?? []), node]);
  });
  for (const [column, nodes] of [...inside].sort((a, b) => a[0] - b[0])) {
    const name = plan.columns[column] || "no tag", at = layout.bodies[column];
    const wrong = nodes.filter((node) => version.marked.has(node)).length;
    const second = wrong ? `${wrong} of ${nodes.length} spurious` : counted(nodes.length, "node");
    const item = shape(shapes, `b${column}`, at, `body${wrong ? " wrong" : " several"}`, "", second, { "data-column": column, "aria-label": `${name}, ${second}, folded` }, name);
    writeName(item.label, name, NAME.line);
    canvas.names.push({ text: item.label, name, width: at.w + 4, size: 13, height: at.h - 14 });
    share(item.group, at, nodes.map((node) => roleOf(version, node)));
    keep(canvas, `b${column}`, item, nodes, second);
  }
}

/** A bar along the foot of a box: a piece for every role of its nodes, as long as they are many. */
function share(group, at, roles) {
  const many = new Map(), order = ["primal", "adjoint", "tangent", "several", "wrong"];
  for (const role of roles) many.set(role, (many.get(role) ?? 0) + 1);
  let x = at.x + 6;
  for (const role of order.filter((each) => many.has(each))) {
    const width = (at.w - 12) * many.get(role) / roles.length;
    element("rect", { class: `share ${role}`, x, y: at.y + at.h - 9, width, height: 5 }, group);
    x += width;
  }
}

const roleOf = (version, node) => (version.marked.has(node) ? "wrong" : version.labels[version.label[node]][1]);

function keep(canvas, id, item, nodes, second) {
  canvas.items.set(id, { ...item, nodes, second });
  for (const node of nodes) canvas.shownBy[node] = id;
}

function drawClusters(canvas) {
  const { plan, version, layout, view, frames, shapes } = canvas;
  const inside = plan.clusters.map(() => []);
  version.ops.forEach((_, node) => { const c = clusterOf(plan, version, node); if (c >= 0 && canvas.shownBy[node] === undefined) inside[c].push(node); });
  plan.clusters.forEach((cluster, c) => {
    if (!inside[c].length) return;
    const at = layout.boxes[c], roles = new Set(inside[c].map((node) => roleOf(version, node)));
    const role = cluster.marked ? "wrong" : roles.size === 1 ? [...roles][0] : "several";
    const words = titleOf(cluster), count = counted(inside[c].length, "node");
    if (!view.folded.has(c)) {
      const group = element("g", { class: `frame ${role}`, "data-cluster": c, tabindex: -1, role: "button", "aria-label": `fold ${cluster.column} ${words}, ${count}` }, frames);
      element("rect", { x: at.x, y: at.y, width: at.w, height: at.h, rx: 6 }, group);
      element("text", { x: at.x + 6, y: at.y + 13 }, group, `▾ ${words ? `${words} (${inside[c].length})` : count}`);
      return;
    }
    const first = cluster.marked ? "spurious" : cluster.title;
    const told = [cluster.column, cluster.stage, cluster.marked ? cluster.title : "", [first, count].filter(Boolean).join(" "), "folded"].filter(Boolean).join(", ");
    const attributes = { "data-cluster": c, "aria-expanded": "false", "aria-label": told }, title = [cluster.column, words, cluster.stage, count].filter(Boolean).join(", ");
    keep(canvas, `c${c}`, shape(shapes, `c${c}`, at, `box ${role}`, foldedTitle(cluster, inside[c].length), count, attributes, title), inside[c], count);
  });
}

function drawNodes(canvas) {
  const { plan, version, layout, shapes, called } = canvas;
  drawBundles(canvas, "i", version.inputs.filter(([, node]) => node >= 0).map(([name, node]) => [name, node]));
  const sums = new Map(); // place a sum under the first output that it is
  for (const [name, , node] of version.outputs) if (!sums.has(node)) sums.set(node, name);
  version.ops.forEach((op, node) => {
    if (version.constants.has(node) || canvas.shownBy[node] !== undefined) return;
    const place = plan.place[version.index][node], c = plan.cluster[place], w = plan.width[place];
    const leaf = !version.args[node].length, key = sums.get(node);
    let at;
    if (layout.nodes) at = layout.nodes[node];
    else if (leaf) at = layout.inputs.get(version.names[node][0]);
    else if (c === RESULT_PLACE) {
      const box = layout.outputs.get(key);
      if (!box) return; // its output is in a box of many, and so is it
      at = { x: box.x + box.w / 2 - w / 2, y: box.y + LEAF.sum, w, h: NODE };
    } else {
      const { local, x, y } = innerOf(plan, c), i = local.get(place), box = layout.boxes[c];
      at = { x: box.x + (box.w - innerOf(plan, c).width) / 2 + x[i] - w / 2, y: box.y + BOX.title + y[i] - NODE / 2, w, h: NODE };
    }
    const role = roleOf(version, node), switches = ROWS[op]?.switches;
    const name = version.names[node] && (called.get(version.names[node][0]) ?? version.names[node][0]);
    const words = [leaf ? "" : `%${version.number[node]}`, name ?? op, role === "wrong" ? "spurious" : "", switches ? "switches: its value or its slope jumps" : ""].filter(Boolean).join(", ");
    const kind = `${leaf ? "leaf" : "node"} ${role}${switches ? " switch" : ""}`, attributes = { "data-node": node, "aria-label": words };
    keep(canvas, `n${node}`, shape(shapes, `n${node}`, at, kind, caption(version, node), "", attributes, words, !leaf), [node], "");
  });
}

/** Inputs or outputs that are many, a box for each kind. */
function drawBundles(canvas, side, leaves) {
  const { layout, shapes, version } = canvas, node = new Map(leaves);
  for (const [key, names] of layout.bundles) {
    const own = names.filter((name) => node.has(name));
    if (key[0] !== side || !own.length) continue;
    const kind = key.slice(1), off = side === "o" && own.some((name) => version.off.has(name));
    const at = layout[side === "i" ? "inputs" : "outputs"].get(key);
    const said = `${kind}: ${counted(own.length, side === "i" ? "input" : "output")}`, attributes = { "data-bundle": key, "aria-label": `${said}, folded${off ? ", wrong" : ""}` };
    const item = shape(shapes, `k${key}`, at, side === "i" ? "box input" : off ? "box output off" : "box output", `▸ ${said}`, "", attributes);
    canvas.names.push({ text: item.label, name: item.label.textContent, width: at.w - 8, size: 10 });
    const nodes = own.map((name) => node.get(name));
    if (side === "i") keep(canvas, `k${key}`, item, nodes, "");
    else {
      canvas.items.set(`k${key}`, { ...item, nodes, second: "", output: true, names: own });
      for (const each of nodes) if (clusterOf(canvas.plan, version, each) === RESULT_PLACE) canvas.shownBy[each] ??= `k${key}`;
    }
  }
}

function drawOutputs(canvas) {
  const { version, layout, shapes, called } = canvas;
  drawBundles(canvas, "o", version.outputs.map(([name, , node]) => [name, node]));
  for (const [name, pretty, node] of version.outputs) {
    const at = layout.outputs.get(name);
    if (!at) continue;
    const title = called.get(name) ?? name, off = version.off.has(name), attributes = { "data-node": node, "aria-label": `output ${title}${off ? ", wrong" : ""}` };
    const item = shape(shapes, `o${name}`, at, off ? "output off" : "output", pretty, "", attributes, title);
    canvas.items.set(`o${name}`, { ...item, nodes: [node], output: true, names: [name] });
  }
}

/** One shape with its text, a line for its value, and what is told of it. */
function shape(parent, id, at, kind, words, second, attributes, title = null, round = false) {
  const group = element("g", { id, class: `item ${kind}`, tabindex: -1, role: "button", ...attributes }, parent);
  element("rect", { class: "shape", x: at.x, y: at.y, width: at.w, height: at.h, rx: round ? at.h / 2 : 5 }, group);
  const tall = at.h > 40;
  const label = element("text", { class: "label", x: at.x + at.w / 2, y: at.y + (tall ? 18 : at.h / 2 - 2) }, group, words);
  group.append(" "); // else what is read aloud has the two as one word
  const value = element("text", { class: "value", x: at.x + at.w / 2, y: at.y + (tall ? at.h - 12 : at.h - 4) }, group, second);
  if (title !== null) element("title", {}, group, title);
  return { group, label, value, at };
}

function drawArrows({ version, items, shownBy, lines, layout }, drawing) {
  const merged = new Map();
  const add = (from, to, pair) => {
    if (from === undefined || to === undefined || from === to) return;
    const key = `${from} ${to}`;
    if (!merged.has(key)) merged.set(key, { from, to, pairs: [] });
    merged.get(key).pairs.push(pair);
  };
  for (const [source, target] of version.edges) add(shownBy[source], shownBy[target], [source, target]);
  const bundle = new Map([...layout.bundles].flatMap(([key, names]) => (key[0] === "o" ? names.map((name) => [name, `k${key}`]) : [])));
  for (const [name, , node] of version.outputs) add(shownBy[node], bundle.get(name) ?? `o${name}`, [node, node]);
  return [...merged.values()].map(({ from, to, pairs }) => {
    const blamed = pairs.some(([source, target]) => version.crossed.has(`${source} ${target}`));
    const wrong = blamed || pairs.filter(([source]) => version.marked.has(source)).length * 2 >= pairs.length;
    const [d, near] = drawing?.lines[`${from} ${to}`] ? [drawing.lines[`${from} ${to}`], true] : [from, to].every((id) => id[0] === "b") ? between(items.get(from).at, items.get(to).at) : curve(items.get(from).at, items.get(to).at);
    const width = blamed ? 3 : Math.min(4, 1.1 + 0.4 * Math.log2(pairs.length)).toFixed(1);
    const path = element("path", {
      class: `line${wrong ? " wrong" : ""}${near ? " near" : ""}`, d, "stroke-width": width, "data-from": from, "data-to": to,
    }, lines);
    if (pairs.length > 1) element("title", {}, path, `${pairs.length} edges`);
    return { path, from, to, pairs };
  });
}

/** A line between two bodies, from border to border, a little to the right of the other way's. */
function between(a, b) {
  const [x1, y1, x2, y2] = [a.x + a.w / 2, a.y + a.h / 2, b.x + b.w / 2, b.y + b.h / 2];
  const long = Math.hypot(x2 - x1, y2 - y1), [ex, ey] = [(x2 - x1) / long, (y2 - y1) / long];
  const side = 6, [ox, oy] = [-ey * side, ex * side];
  const out = (box, way) => Math.min((box.w / 2 - way * Math.sign(ex) * ox) / Math.abs(ex || 1e-9), (box.h / 2 - way * Math.sign(ey) * oy) / Math.abs(ey || 1e-9));
  const [leave, arrive] = [out(a, 1), out(b, -1) + 2];
  const [fx, fy, tx, ty] = [x1 + ex * leave + ox, y1 + ey * leave + oy, x2 - ex * arrive + ox, y2 - ey * arrive + oy];
  const bend = 0.1 * Math.hypot(tx - fx, ty - fy), [mx, my] = [(fx + tx) / 2 - ey * bend, (fy + ty) / 2 + ex * bend];
  const end = Math.hypot(tx - mx, ty - my) || 1, [hx, hy] = [(tx - mx) / end, (ty - my) / end];
  const foot = (s) => `${tx - 7 * hx - 4 * s * hy} ${ty - 7 * hy + 4 * s * hx}`;
  return [`M${fx} ${fy}Q${mx} ${my} ${tx} ${ty}M${foot(1)}L${tx} ${ty}L${foot(-1)}`, long < 1.2 * (BODY.width + BODY.beside)];
}

/** A line from the top of one box to the foot of another with its arrowhead, and whether they are near one another. */
function curve(a, b) {
  const x1 = a.x + a.w / 2, x2 = b.x + b.w / 2, y1 = a.y, y2 = b.y + b.h;
  const bend = Math.max(14, Math.min(80, Math.abs(y1 - y2) / 2));
  const head = `M${x2 - 4} ${y2 + 7}L${x2} ${y2 + 1}L${x2 + 4} ${y2 + 7}`;
  return [`M${x1} ${y1}C${x1} ${y1 - bend} ${x2} ${y2 + bend} ${x2} ${y2 + 1}${head}`, Math.hypot(x1 - x2, y1 - y2) < 120];
}

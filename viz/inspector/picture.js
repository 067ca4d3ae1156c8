// The picture: clusters in columns by body and rows by stage, folded or not, and the lines between what is shown.

const SVG = "http://www.w3.org/2000/svg";
const BOX = { width: 116, height: 46, gap: 12, title: 18, pad: 8 };
const CELL = { gap: 38, title: 24, aspect: 1.35 };
const LEAF = { height: 30, gap: 8, row: 44 };
const NODE = 34; // height of a node's ellipse or box

function element(name, attributes, parent) {
  const made = document.createElementNS(SVG, name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  if (parent) parent.appendChild(made);
  return made;
}

const titleOf = (cluster) => [cluster.marked ? "spurious" : "", cluster.title].filter(Boolean).join(" ");

/** Where everything goes, for the clusters that are folded; the same for all versions. */
function arrange(data, folded) {
  const sizes = data.clusters.map((cluster, c) => (folded.has(c) ? { w: BOX.width, h: BOX.height }
    : { w: Math.max(cluster.width + 2 * BOX.pad, 7 * titleOf(cluster).length + 54), h: cluster.height + BOX.title + BOX.pad }));
  const cells = new Map();
  data.clusters.forEach((cluster, c) => {
    const key = `${data.columns.indexOf(cluster.column)} ${data.stages.indexOf(cluster.stage)}`;
    cells.set(key, [...(cells.get(key) ?? []), c]);
  });
  const flowed = new Map([...cells].map(([key, own]) => [key, flow(own, sizes)]));
  const cell = (column, stage) => flowed.get(`${column} ${stage}`) ?? { w: 0, h: 0, at: [] };
  const boxes = [], titles = [];
  const stages = data.stages.map((_, i) => i);
  const widths = data.columns.map((_, i) => Math.max(90, ...stages.map((stage) => cell(i, stage).w)));
  const bands = data.bands ??= bandsFor(widths, stages.map((stage) => Math.max(...widths.map((_, i) => cell(i, stage).h))), data.aspect);
  const perBand = Math.ceil(data.columns.length / bands);
  const inputs = new Map(), outputs = new Map(); // place: width; name: width
  for (const version of data.versions) {
    for (const [, node] of version.inputs) {
      if (node < 0) continue;
      const place = version.place[node];
      if (data.places[place][0] < 0) inputs.set(place, data.places[place][3]);
    }
    for (const [name, pretty] of version.outputs) outputs.set(name, Math.max(46, 8 * pretty.length + 18));
  }
  let total = 0;
  for (let band = 0; band < bands; band++) {
    const own = widths.slice(band * perBand, (band + 1) * perBand);
    total = Math.max(total, own.reduce((sum, each) => sum + each + CELL.gap, 0));
  }
  total = Math.max(total, 420);
  let y = 12;
  const top = line(outputs, total, y);
  y = top.end + 6;
  for (let band = bands - 1; band >= 0; band--) { // the last bodies on top
    const own = data.columns.map((_, i) => i).slice(band * perBand, (band + 1) * perBand);
    let x = (total - own.reduce((sum, i) => sum + widths[i] + CELL.gap, -CELL.gap)) / 2;
    const left = own.map((i) => { const at = x; x += widths[i] + CELL.gap; return at; });
    const start = y;
    y += CELL.title;
    for (const stage of [...stages].reverse()) {
      const height = Math.max(0, ...own.map((i) => cell(i, stage).h));
      if (!height) continue;
      own.forEach((i, k) => {
        const { w, h, at } = cell(i, stage);
        for (const [c, dx, dy] of at) {
          boxes[c] = { x: left[k] + (widths[i] - w) / 2 + dx, y: y + height - h + dy, ...sizes[c] };
        }
      });
      titles.push({ stage, x: 0, y, h: height });
      y += height + CELL.gap;
    }
    own.forEach((i, k) => titles.push({ column: i, x: left[k], y: start, w: widths[i], h: y - start - CELL.gap / 2 }));
  }
  const bottom = line(inputs, total, y + 8);
  return { boxes, titles, inputs: bottom.at, outputs: top.at, width: total, height: bottom.end + 8 };
}

/** Into how many bands columns of these widths are broken: one, unless the picture is much larger with more. */
function bandsFor(widths, heights, aspect = CELL.aspect) {
  const high = heights.reduce((sum, each) => sum + (each ? each + CELL.gap : 0), CELL.title);
  const scale = (bands) => {
    const per = Math.ceil(widths.length / bands);
    let most = 0;
    for (let i = 0; i < widths.length; i += per) {
      most = Math.max(most, widths.slice(i, i + per).reduce((sum, each) => sum + each + CELL.gap, 0));
    }
    return Math.min(aspect / (most + 150), 1 / (bands * high + 2 * LEAF.row));
  };
  let best = 1;
  for (let bands = 2; bands <= widths.length; bands++) if (scale(bands) > 1.7 * scale(1) && scale(bands) > 1.05 * scale(best)) best = bands;
  return best;
}

/** Boxes of a cell from left to right, in lines. */
function flow(own, sizes) {
  const limit = Math.max(2 * BOX.width + BOX.gap,
    1.5 * Math.sqrt(own.reduce((sum, c) => sum + sizes[c].w * sizes[c].h, 0)));
  const at = [];
  let x = 0, y = 0, high = 0, w = 0;
  for (const c of own) {
    if (x && x + sizes[c].w > limit) { x = 0; y += high + BOX.gap; high = 0; }
    at.push([c, x, y]);
    w = Math.max(w, x + sizes[c].w);
    high = Math.max(high, sizes[c].h);
    x += sizes[c].w + BOX.gap;
  }
  return { w, h: y + high, at };
}

/** Leaves in centred lines: Map from each to its box. */
function line(leaves, total, y) {
  const at = new Map();
  let row = [], width = 0;
  const put = () => {
    let x = (total - width + LEAF.gap) / 2;
    for (const [key, w] of row) { at.set(key, { x, y, w, h: LEAF.height }); x += w + LEAF.gap; }
    y += row.length ? LEAF.row : 0;
    row = []; width = 0;
  };
  for (const [key, w] of leaves) {
    if (width + w > total) put();
    row.push([key, w]);
    width += w + LEAF.gap;
  }
  put();
  return { at, end: y };
}

/** What a person calls an input, output or node of that name. */
const called = (data, name) => data.called.get(name) ?? name;

/** What the operation of a node shows: its symbol, with the constants among its arguments. */
function caption(data, version, node) {
  const name = version.names[node];
  const symbol = data.ops[version.ops[node]]?.[0] ?? "";
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

function brief(value) {
  if (Number.isNaN(value)) return "NaN";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  const size = Math.abs(value);
  if (size < 1e-12) return size ? "≈0" : "0";
  const text = size && (size < 1e-3 || size >= 1e5) ? value.toExponential(1) : String(+value.toPrecision(3));
  return text.replace("-", "−").replace("e−", "e-");
}

/** Draw a version; returns the items by id, and of each node the id of the item that shows it. */
function draw(svg, data, version, folded) {
  const layout = arrange(data, folded);
  svg.replaceChildren();
  const scene = element("g", { id: "scene" }, svg);
  const frames = element("g", {}, scene), lines = element("g", { class: "lines" }, scene), shapes = element("g", {}, scene);
  for (const each of layout.titles) {
    if (each.column === undefined) continue;
    element("rect", { class: "column", x: each.x - 9, y: each.y, width: each.w + 18, height: each.h, rx: 8 }, frames);
    const words = element("text", { class: "column-title", x: each.x + each.w / 2, y: each.y + 16 }, frames);
    words.textContent = fitted(data.columns[each.column] || "no tag", (each.w + 18) / 8.6);
    element("title", {}, words).textContent = data.columns[each.column];
  }
  for (const each of layout.titles) {
    if (each.stage === undefined) continue;
    const words = element("text", { class: "stage", x: -14, y: each.y + each.h / 2 }, frames);
    words.textContent = data.stages[each.stage];
  }
  const items = new Map(), shownBy = [];
  const inside = data.clusters.map(() => []);
  version.ops.forEach((_, node) => {
    const c = data.places[version.place[node]][0];
    if (c >= 0) inside[c].push(node);
  });
  data.clusters.forEach((cluster, c) => {
    if (!inside[c].length) return;
    const at = layout.boxes[c], id = `c${c}`;
    const role = cluster.marked ? "wrong" : commonRole(version, inside[c]);
    const many = inside[c].length;
    const words = titleOf(cluster);
    const count = `${many} node${many > 1 ? "s" : ""}`;
    const title = words ? `${words} (${many})` : count;
    if (!folded.has(c)) {
      const group = element("g", { class: `frame ${role}`, "data-cluster": c, tabindex: -1, role: "button" }, frames);
      group.setAttribute("aria-label", `fold ${cluster.column} ${title}`);
      element("rect", { x: at.x, y: at.y, width: at.w, height: at.h, rx: 6 }, group);
      const label = element("text", { x: at.x + 6, y: at.y + 13 }, group);
      label.textContent = `▾ ${title}`;
      return;
    }
    const first = cluster.marked ? "spurious" : cluster.title || cluster.column || "no tag";
    const second = cluster.marked && cluster.title ? `${cluster.title} (${many})` : count;
    const item = shape(shapes, id, { ...at }, `box ${role}`, `▸ ${fitted(first, 13)}`, true);
    item.group.setAttribute("data-cluster", c);
    item.group.setAttribute("aria-expanded", "false");
    item.group.setAttribute("aria-label", [cluster.column, cluster.stage, words, count, "folded"].filter(Boolean).join(", "));
    items.set(id, { ...item, nodes: inside[c], second });
    for (const node of inside[c]) shownBy[node] = id;
  });
  version.ops.forEach((op, node) => {
    if (version.constants.has(node) || shownBy[node]) return;
    const [c, dx, dy, w] = data.places[version.place[node]];
    const at = c < 0 ? layout.inputs.get(version.place[node])
      : { x: layout.boxes[c].x + BOX.pad + dx - w / 2, y: layout.boxes[c].y + BOX.title + dy - NODE / 2, w, h: NODE };
    const role = version.marked.has(node) ? "wrong" : version.labels[version.label[node]][1];
    const leaf = !version.args[node].length;
    const item = shape(shapes, `n${node}`, at, `${leaf ? "leaf" : "node"} ${role}`, caption(data, version, node), leaf);
    item.group.setAttribute("data-node", node);
    const name = version.names[node] && called(data, version.names[node][0]);
    item.group.setAttribute("aria-label", `n${node}, ${name ?? op}${role === "wrong" ? ", spurious" : ""}`);
    if (name) element("title", {}, item.group).textContent = name;
    items.set(`n${node}`, { ...item, nodes: [node] });
    shownBy[node] = `n${node}`;
  });
  for (const [name, pretty, node] of version.outputs) {
    const item = shape(shapes, `o${name}`, layout.outputs.get(name), "output", pretty, true);
    item.group.setAttribute("data-node", node);
    item.group.setAttribute("aria-label", `output ${called(data, name)}`);
    element("title", {}, item.group).textContent = called(data, name);
    items.set(`o${name}`, { ...item, nodes: [node], output: true });
  }
  const arrows = drawLines(lines, version, items, shownBy);
  return { items, shownBy, arrows, layout, scene };
}

function commonRole(version, nodes) {
  const roles = new Set(nodes.map((node) => version.labels[version.label[node]][1]));
  return roles.size === 1 ? [...roles][0] : "several";
}

/** A text of at most so many letters: of a longer one, its ends. */
function fitted(text, most) {
  const letters = [...text], room = Math.max(4, Math.floor(most) - 1);
  if (letters.length <= room + 1) return text;
  return `${letters.slice(0, Math.ceil(room / 2)).join("")}…${letters.slice(letters.length - Math.floor(room / 2)).join("")}`;
}

/** One shape with its text, and a line for its value. */
function shape(parent, id, at, kind, words, square) {
  const group = element("g", { id, class: `item ${kind}`, tabindex: -1, role: "button" }, parent);
  const form = { class: "shape", x: at.x, y: at.y, width: at.w, height: at.h, rx: square ? 5 : at.h / 2 };
  element("rect", form, group);
  const label = element("text", { class: "label", x: at.x + at.w / 2, y: at.y + at.h / 2 - (at.h > 40 ? 4 : 2) }, group);
  label.textContent = words;
  const value = element("text", { class: "value", x: at.x + at.w / 2, y: at.y + at.h - (at.h > 40 ? 9 : 6) }, group);
  return { group, value, at };
}

function drawLines(parent, version, items, shownBy) {
  const merged = new Map();
  const add = (from, to, pair) => {
    if (from === undefined || from === to) return;
    const key = `${from} ${to}`;
    if (!merged.has(key)) merged.set(key, { from, to, pairs: [] });
    merged.get(key).pairs.push(pair);
  };
  for (const [source, target] of version.edges) add(shownBy[source], shownBy[target], [source, target]);
  for (const [name, , node] of version.outputs) add(shownBy[node], `o${name}`, [node, node]);
  const arrows = [];
  for (const { from, to, pairs } of merged.values()) {
    const a = items.get(from).at, b = items.get(to).at;
    const x1 = a.x + a.w / 2, x2 = b.x + b.w / 2;
    const y1 = a.y, y2 = b.y + b.h;
    const bend = Math.max(14, Math.min(80, Math.abs(y1 - y2) / 2));
    const wrong = pairs.some(([source]) => version.marked.has(source));
    const near = Math.hypot(x1 - x2, y1 - y2) < 120 ? " near" : "";
    const path = element("path", {
      class: `line${wrong ? " wrong" : ""}${near}`,
      d: `M${x1} ${y1}C${x1} ${y1 - bend} ${x2} ${y2 + bend} ${x2} ${y2}`,
      "stroke-width": Math.min(5, 0.9 + 0.6 * Math.log2(pairs.length)).toFixed(1),
      "data-from": from, "data-to": to,
    }, parent);
    arrows.push({ path, from, to, pairs });
  }
  return arrows;
}

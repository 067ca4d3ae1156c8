// Where everything is in the picture: columns by body, rows by sweep, folded or not; the same for all versions.

const BOX = { width: 100, height: 30, gap: 8, title: 18, pad: 8 };
const BODY = { width: 148, height: 52, gap: 40, beside: 16 }; // a body as one box
const CELL = { gap: 26, beside: 14, title: 24, aspect: 1.35 };
const LEAF = { height: 30, gap: 8, row: 44, sum: 46 };
const NODE = 34; // height of a node's ellipse or box
const FEW_LEAVES = 24; // inputs or outputs; more of them are boxes by kind
const KINDS = /^(qdd|qd|q|tau|lambda|p)\d+(_old)?$/;

const titleOf = (cluster) => [cluster.marked ? "spurious" : "", cluster.title].filter(Boolean).join(" ");
const widthOf = (words) => Math.max(46, 7.5 * [...words.replace(/[\u0307\u0308]/g, "")].length + 16);

/** What the layout reads and keeps of a record: places, widths of nodes, nodes inside clusters, kinds of leaves. */
function makePlan(record, versions) {
  const plan = { ...placesOf(record, versions), inner: new Map() };
  plan.width = plan.first.map(([v, node]) => widthOf(caption(record, versions[v], node)));
  plan.members = plan.clusters.map(() => []);
  plan.cluster.forEach((c, place) => { if (c >= 0) plan.members[c].push(place); });
  plan.lines = plan.clusters.map(() => new Map());
  versions.forEach((version, v) => version.edges.forEach(([source, target]) => {
    const s = plan.place[v][source], t = plan.place[v][target], c = plan.cluster[t];
    if (c >= 0 && plan.cluster[s] === c && s < t) plan.lines[c].set(`${s} ${t}`, [s, t]);
  }));
  plan.inputs = new Map(); // name: width
  plan.outputs = new Map();
  for (const version of versions) {
    for (const [name, node] of version.inputs) if (node >= 0) plan.inputs.set(name, widthOf(version.names[node][1]));
    for (const [name, pretty] of version.outputs) plan.outputs.set(name, widthOf(pretty) + 6);
  }
  plan.sums = plan.cluster.includes(RESULT_PLACE);
  return plan;
}

/** The layout of the nodes of a cluster, made when it is first unfolded. */
function innerOf(plan, c) {
  if (!plan.inner.has(c)) {
    const local = new Map(plan.members[c].map((place, i) => [place, i]));
    const edges = [...plan.lines[c].values()].map(([s, t]) => [local.get(s), local.get(t)]).sort((a, b) => a[0] - b[0] || a[1] - b[1]);
    plan.inner.set(c, { local, ...layered(plan.members[c].map((place) => plan.width[place]), edges) });
  }
  return plan.inner.get(c);
}

/** Leaves as drawn: of many one for every kind that is not unfolded, [[key, width, names]]. */
function leavesOf(widths, side, unbundled) {
  if (widths.size <= FEW_LEAVES) return [...widths].map(([name, width]) => [name, width, null]);
  const kinds = new Map();
  for (const name of widths.keys()) {
    const [, kind, old] = name.match(KINDS) ?? [];
    const key = `${side}${kind ? `${kind}${old ?? ""}` : "parameters"}`;
    kinds.set(key, [...(kinds.get(key) ?? []), name]);
  }
  return [...kinds].flatMap(([key, names]) => (unbundled.has(key) || names.length === 1
    ? names.map((name) => [name, widths.get(name), null]) : [[key, 150, names]]));
}

/** Boxes of clusters, columns, leaves and titles. folded: clusters; closed: columns; unbundled: kinds of leaves. */
function arrange(plan, { folded, closed, unbundled, aspect }) {
  const inputs = leavesOf(plan.inputs, "i", unbundled), outputs = leavesOf(plan.outputs, "o", unbundled);
  const inside = closed.size === plan.columns.length ? overview(plan, aspect) : columnsIn(plan, folded, closed, aspect);
  const narrow = Math.max(0, ...[...inputs, ...outputs].map(([, width]) => width));
  const total = Math.max(inside.width, Math.min(420, [...inputs, ...outputs].reduce((sum, [, width]) => sum + width + LEAF.gap, 0)), narrow);
  const top = leafLines(outputs, total, 8, plan.sums ? LEAF.sum : 0);
  const shift = (box) => ({ ...box, x: box.x + (total - inside.width) / 2, y: box.y + top.end + 4 });
  const bottom = leafLines(inputs, total, top.end + inside.height + 14, 0);
  return {
    boxes: inside.boxes.map(shift), bodies: inside.bodies.map(shift), titles: inside.titles.map(shift),
    inputs: bottom.at, outputs: top.at, width: total, height: bottom.end,
    bundles: new Map([...inputs, ...outputs].filter(([, , names]) => names).map(([key, , names]) => [key, names])),
  };
}

/** All columns as one box each: bodies as their tree, its base at the bottom, then what is no body. */
function overview(plan, aspect = CELL.aspect) {
  const all = plan.columns.map((_, i) => i), bodies = [];
  const put = (i, x, y) => { bodies[i] = { column: i, x, y, w: BODY.width, h: BODY.height }; };
  const tree = all.filter((i) => plan.tree[i]), rest = all.filter((i) => !plan.tree[i]);
  let width = 0, height = 0;
  if (tree.length && tree.some((i) => plan.parents[i] >= 0)) {
    const local = new Map(tree.map((i, k) => [i, k]));
    const edges = tree.filter((i) => local.has(plan.parents[i])).map((i) => [local.get(plan.parents[i]), local.get(i)]);
    const deep = layered(tree.map(() => BODY.width + BODY.beside - LAYERS.gap), edges, BODY.height + BODY.gap);
    const narrowed = snake(tree.length, deep, aspect);
    tree.forEach((i, k) => {
      if (narrowed) put(i, ...narrowed(k)); else put(i, deep.x[k] - BODY.width / 2, deep.y[k] - BODY.height / 2);
    });
    width = Math.max(...tree.map((i) => bodies[i].x)) + BODY.width;
    height = Math.max(...tree.map((i) => bodies[i].y)) + BODY.height;
  } else rest.unshift(...tree);
  if (rest.length) {
    const per = Math.max(1, Math.round(width ? (width + BODY.beside) / (BODY.width + BODY.beside) : Math.sqrt(rest.length * aspect / 2)));
    const lines = Math.ceil(rest.length / per), start = height ? height + BODY.gap : 0;
    const across = Math.min(per, rest.length) * (BODY.width + BODY.beside) - BODY.beside;
    const left = Math.max(0, (width - across) / 2);
    rest.forEach((i, k) => put(i, left + (k % per) * (BODY.width + BODY.beside), start + Math.floor(k / per) * (BODY.height + BODY.gap)));
    width = Math.max(width, across);
    height = start + lines * (BODY.height + BODY.gap) - BODY.gap;
  }
  return { boxes: [], bodies, titles: [], width, height: height + CELL.gap / 2 };
}

/** A tree that is much higher or wider than the picture goes in lines instead, the base at the bottom left. */
function snake(count, deep, aspect) {
  const per = Math.max(1, Math.round(Math.sqrt(count * aspect * (BODY.height + BODY.gap) / (BODY.width + BODY.beside))));
  const lines = Math.ceil(count / per);
  const scale = (w, h) => Math.min(aspect / w, 1 / (h + 2 * LEAF.row));
  const wide = per * (BODY.width + BODY.beside), high = lines * (BODY.height + BODY.gap);
  if (scale(wide, high) < 1.5 * scale(deep.width, deep.height)) return null;
  return (k) => [(k % per) * (BODY.width + BODY.beside), (lines - 1 - Math.floor(k / per)) * (BODY.height + BODY.gap)];
}

/** Columns side by side, in as few bands as the picture needs; rows by sweep. */
function columnsIn(plan, folded, closed, aspect) {
  const sizes = plan.clusters.map((cluster, c) => {
    if (folded.has(c) || closed.has(plan.columns.indexOf(cluster.column))) return { w: BOX.width, h: BOX.height };
    const { width, height } = innerOf(plan, c);
    return { w: Math.max(width + 2 * BOX.pad, 7 * titleOf(cluster).length + 54), h: height + BOX.title + BOX.pad };
  });
  const cells = new Map();
  plan.clusters.forEach((cluster, c) => {
    const column = plan.columns.indexOf(cluster.column), key = `${column} ${cluster.stage}`;
    if (!closed.has(column)) cells.set(key, [...(cells.get(key) ?? []), c]);
  });
  const flowed = new Map([...cells].map(([key, own]) => [key, flow(own, sizes)]));
  const cell = (column, stage) => flowed.get(`${column} ${stage}`) ?? { w: 0, h: 0, at: [] };
  const widths = plan.columns.map((name, i) => (closed.has(i) ? BODY.width
    : Math.max(70, Math.min(160, 8 * name.length), ...STAGES.map((stage) => cell(i, stage).w))));
  const bands = bandsFor(widths, STAGES.map((stage) => Math.max(...widths.map((_, i) => cell(i, stage).h))), aspect);
  const perBand = Math.ceil(plan.columns.length / bands);
  const boxes = [], bodies = [], titles = [];
  const reach = (own) => own.reduce((sum, i) => sum + widths[i] + CELL.beside, -CELL.beside);
  const lines = Array.from({ length: bands }, (_, band) => plan.columns.map((__, i) => i).slice(band * perBand, (band + 1) * perBand));
  const total = Math.max(...lines.map(reach)) + CELL.beside;
  let y = 0;
  for (const own of [...lines].reverse()) { // the last bodies on top
    let x = (total - reach(own)) / 2;
    const left = own.map((i) => { const at = x; x += widths[i] + CELL.beside; return at; });
    const start = y;
    y += CELL.title + CELL.gap / 2;
    for (const stage of [...STAGES].reverse()) {
      const height = Math.max(0, ...own.map((i) => cell(i, stage).h));
      if (!height) continue;
      own.forEach((i, k) => {
        const { w, h, at } = cell(i, stage);
        for (const [c, dx, dy] of at) boxes[c] = { x: left[k] + (widths[i] - w) / 2 + dx, y: y + height - h + dy, ...sizes[c] };
      });
      titles.push({ stage, x: left[0], y: y - 6 });
      y += height + CELL.gap;
    }
    y = Math.max(y, start + BODY.height + CELL.gap);
    own.forEach((i, k) => {
      if (closed.has(i)) bodies[i] = { column: i, x: left[k], y: (start + y - CELL.gap - BODY.height) / 2, w: BODY.width, h: BODY.height };
      else titles.push({ column: i, x: left[k], y: start, w: widths[i], h: y - start - CELL.gap / 2 });
    });
  }
  return { boxes, bodies, titles, width: total, height: y };
}

/** Into how many bands columns of these widths are broken: one, unless the picture is much larger with more. */
function bandsFor(widths, heights, aspect = CELL.aspect) {
  const high = heights.reduce((sum, each) => sum + (each ? each + CELL.gap : 0), CELL.title + CELL.gap / 2);
  const scale = (bands) => {
    const per = Math.ceil(widths.length / bands);
    let most = 0;
    for (let i = 0; i < widths.length; i += per) {
      most = Math.max(most, widths.slice(i, i + per).reduce((sum, each) => sum + each + CELL.beside, 0));
    }
    return Math.min(aspect / (most + 20), 1 / (bands * high + 2 * LEAF.row));
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

/** Leaves in centred lines: Map from each to its box. under: room below it for the sum that it is. */
function leafLines(leaves, total, y, under) {
  const at = new Map();
  let row = [], width = 0;
  const put = () => {
    let x = (total - width + LEAF.gap) / 2;
    for (const [key, w] of row) { at.set(key, { x, y, w, h: LEAF.height }); x += w + LEAF.gap; }
    y += row.length ? LEAF.row + under : 0;
    row = []; width = 0;
  };
  for (const [key, w] of leaves) {
    if (width + w > total + LEAF.gap) put();
    row.push([key, w]);
    width += w + LEAF.gap;
  }
  put();
  return { at, end: y };
}

// Where everything is in the picture: columns by body, rows by sweep, folded or not; the same for all versions.

const BOX = { width: 100, height: 28, gap: 6, title: 18, pad: 8 };
const BODY = { width: 148, height: 46, line: 15, gap: 28, beside: 26 }; // a body as one box, with a line more for long names
const NAME = { most: 34, line: 17 }; // letters of a name for which a box or column has room, and of one line of a body's
const CELL = { gap: 22, beside: 14, title: 24, aspect: 1.35 };
const LEAF = { height: 30, gap: 6, row: 38, sum: 42 };
const NODE = 34; // height of a node's ellipse or box
const FEW_LEAVES = [8, 24]; // inputs or outputs beside bodies, and beside parts of them; more of them are boxes by kind

const titleOf = (cluster) => [cluster.marked ? "spurious" : "", cluster.title].filter(Boolean).join(" ");
/** What a folded cluster of so many nodes says. */
function foldedTitle(cluster, many) {
  const first = cluster.marked ? "spurious" : cluster.title;
  return first ? `${fitted(first, NAME.most)} ${many}` : counted(many, "node");
}
const widthOf = (words) => Math.max(46, 7.4 * [...words.replace(/[\u0307\u0308]/g, "")].length + 10);

/** What the layout reads and keeps of a record: places, widths of nodes, nodes inside clusters, kinds of leaves. */
function makePlan(record, versions) {
  const plan = { ...placesOf(record, versions), inner: new Map() };
  plan.width = plan.first.map(([v, node]) => Math.max(58, widthOf(caption(versions[v], node)))); // room for a value
  plan.members = plan.clusters.map(() => []);
  plan.cluster.forEach((c, place) => { if (c >= 0) plan.members[c].push(place); });
  plan.lines = plan.clusters.map(() => new Map());
  versions.forEach((version, v) => version.edges.forEach(([source, target]) => {
    const s = plan.place[v][source], t = plan.place[v][target], c = plan.cluster[t];
    if (c >= 0 && plan.cluster[s] === c && s < t) plan.lines[c].set(`${s} ${t}`, [s, t]);
  }));
  plan.leaves = versions.map((version) => ({ // name: width
    i: new Map(version.inputs.filter(([, node]) => node >= 0).map(([name, node]) => [name, widthOf(version.names[node][1])])),
    o: new Map(version.outputs.map(([name, pretty]) => [name, Math.max(66, widthOf(pretty) + 6)])),
  }));
  plan.limbs = limbsOf(plan);
  plan.body = { ...BODY, height: BODY.height + (plan.columns.some((name) => [...name].length > NAME.line) ? BODY.line : 0) };
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
function leavesOf(widths, side, unbundled, few) {
  if (widths.size <= few) return [...widths].map(([name, width]) => [name, width, null]);
  const kinds = new Map();
  for (const name of widths.keys()) {
    const [, kind, old] = name.match(KINDS) ?? [];
    const key = `${side}${kind ? `${kind}${old ?? ""}` : "parameters"}`;
    kinds.set(key, [...(kinds.get(key) ?? []), name]);
  }
  return [...kinds].flatMap(([key, names]) => (unbundled.has(key) || names.length === 1
    ? names.map((name) => [name, widths.get(name), null]) : [[key, Math.max(150, 1.35 * widthOf(`▸ ${key.slice(1)}: ${names.length} outputs`)), names]]));
}

/** Boxes of clusters, columns, leaves and titles. folded: clusters; closed: columns; unbundled: kinds of leaves.
 *
 * Of the versions only the leaves differ in place: each has its own, in as much room. */
function arrange(plan, { folded, closed, unbundled, aspect }, index = 0) {
  const whole = plan.columns.length > 0 && closed.size === plan.columns.length;
  const leaves = plan.leaves.map((own) => ["i", "o"].map((side) => leavesOf(own[side], side, unbundled, FEW_LEAVES[whole ? 0 : 1])));
  const inside = whole ? overview(plan, aspect) : columnsIn(plan, folded, closed, aspect);
  const sums = leaves.flat().map((own) => own.reduce((sum, [, width]) => sum + width + LEAF.gap, 0));
  const widest = Math.max(0, ...leaves.flat(2).map(([, width]) => width));
  const total = Math.max(inside.width, Math.min(Math.max(420, 1.05 * inside.width), Math.max(...sums)), widest);
  const [inputs, outputs] = leaves[index];
  const top = leafLines(outputs, total, 8, plan.sums ? LEAF.sum : 0);
  const shift = (box) => ({ ...box, x: box.x + (total - inside.width) / 2, y: box.y + top.end + 4 });
  const bottom = leafLines(inputs, total, top.end + inside.height + 14, 0);
  return {
    boxes: inside.boxes.map(shift), bodies: inside.bodies.map(shift), titles: inside.titles.map(shift),
    inputs: bottom.at, outputs: top.at, width: total, height: bottom.end,
    bundles: new Map([...inputs, ...outputs].filter(([, , names]) => names).map(([key, , names]) => [key, names])),
  };
}

/** Limbs of the tree of bodies, chains from a body to a tip: [[column]] in the order of a walk, of those that a body has
 * the deepest goes on with it; all in one where nothing branches. */
function limbsOf({ columns, tree, parents }) {
  const all = columns.map((_, i) => i).filter((i) => tree[i]), own = columns.map(() => []), height = columns.map(() => 1);
  const roots = all.filter((i) => !tree[parents[i]] || !own[parents[i]].push(i));
  for (const i of [...all].reverse()) if (tree[parents[i]]) height[parents[i]] = Math.max(height[parents[i]], height[i] + 1);
  const limbs = [], starts = roots.reverse();
  while (starts.length) {
    const limb = [];
    for (let i = starts.pop(); i !== undefined;) {
      limb.push(i);
      const next = own[i].reduce((best, each) => (best === undefined || height[each] > height[best] ? each : best), undefined);
      starts.push(...own[i].filter((each) => each !== next).reverse());
      i = next;
    }
    limbs.push(limb);
  }
  return limbs;
}

/** All columns as one box each: limbs as rows or as columns, the base first; one limb as its tree, its base at the
 * bottom, or in lines where that is larger; then what is no body. */
function overview(plan, aspect = CELL.aspect) {
  const all = plan.columns.map((_, i) => i), tree = all.filter((i) => plan.tree[i]), rest = all.filter((i) => !plan.tree[i]);
  const local = new Map(tree.map((i, k) => [i, k]));
  const edges = tree.filter((i) => local.has(plan.parents[i])).map((i) => [local.get(plan.parents[i]), local.get(i)]);
  const body = plan.body, across = body.width + body.beside, down = body.height + body.gap;
  const limbs = plan.limbs, spots = limbs.length > 1 ? inLimbs(plan, limbs, local, across, down) : [];
  if (!spots.length) {
    const deep = layered(tree.map(() => across - LAYERS.gap), edges, down);
    spots.push(tree.map((_, k) => [deep.x[k] - across / 2, deep.y[k] - down / 2]));
    for (let per = 1; per <= tree.length; per++) {
      const lines = Math.ceil(tree.length / per);
      spots.push(tree.map((_, k) => [(k % per) * across, (lines - 1 - Math.floor(k / per)) * down])); // the base at the bottom left
    }
  }
  const sizeOf = (at) => [Math.max(0, ...at.map(([x]) => x + body.width)), Math.max(0, ...at.map(([, y]) => y + down))];
  const found = spots.map((at) => {
    const [wide, high] = sizeOf(at), per = Math.max(1, Math.floor((Math.max(wide, 3 * across) + body.beside) / across));
    const shift = Math.max(0, wide - Math.min(per, rest.length) * across + body.beside) / 2;
    const below = rest.map((_, k) => [shift + (k % per) * across, high + Math.floor(k / per) * down]);
    const [w, h] = sizeOf([...at, ...below]);
    return { at: [...at, ...below], w, h, scale: Math.min(aspect / w, 1 / (h + 2 * LEAF.row + LEAF.sum)) };
  });
  const best = found.reduce((a, b) => (b.scale > a.scale ? b : a));
  const { at, w, h } = edges.length && found[0].scale > 0.85 * best.scale ? found[0] : best;
  const bodies = [];
  [...tree, ...rest].forEach((i, k) => { bodies[i] = { column: i, x: at[k][0], y: at[k][1], w: body.width, h: body.height }; });
  return { boxes: [], bodies, titles: [], width: w, height: h };
}

/** Places of bodies by limb: a row each, in from where it hangs; or a column each, the base at the bottom. */
function inLimbs({ parents, tree }, limbs, local, across, down) {
  const deep = new Map(), rows = [], columns = [];
  limbs.forEach((limb, row) => limb.forEach((i) => {
    deep.set(i, tree[parents[i]] ? deep.get(parents[i]) + 1 : 0);
    rows[local.get(i)] = [deep.get(i) * across, row * down];
    columns[local.get(i)] = [row * across, -deep.get(i) * down];
  }));
  const lowest = Math.min(...columns.map(([, y]) => y));
  return [rows, columns.map(([x, y]) => [x, y - lowest])];
}

/** Columns in lines of at most so many, a limb in as few as it can be; what is no body below, beside the base where it has room. */
function linesOf({ columns, limbs, tree }, most) {
  const lines = [];
  for (const limb of limbs) {
    const last = lines.at(-1), parts = inLines(limb, most);
    if (last && parts.length === 1 && last.length + limb.length <= most) last.push(...limb); else lines.push(...parts);
  }
  const rest = columns.map((_, i) => i).filter((i) => !tree[i]);
  if (lines.length === 1 && lines[0].length + rest.length <= most) return [[...lines[0], ...rest]];
  return [...inLines(rest, most), ...lines];
}

/** Columns side by side, in as few bands as the picture needs; rows by sweep. */
function columnsIn(plan, folded, closed, aspect) {
  const sizes = plan.clusters.map((cluster, c) => {
    if (folded.has(c) || closed.has(plan.columnOf[c])) return { w: Math.max(BOX.width, widthOf(foldedTitle(cluster, plan.members[c].length))), h: BOX.height };
    const { width, height } = innerOf(plan, c);
    return { w: Math.max(width + 2 * BOX.pad, 7 * titleOf(cluster).length + 54), h: height + BOX.title + BOX.pad };
  });
  const cells = new Map();
  plan.clusters.forEach((cluster, c) => {
    const column = plan.columnOf[c], key = `${column} ${cluster.stage}`;
    if (!closed.has(column)) cells.set(key, [...(cells.get(key) ?? []), c]);
  });
  const flowed = new Map([...cells].map(([key, own]) => [key, flow(own, sizes)]));
  const cell = (column, stage) => flowed.get(`${column} ${stage}`) ?? { w: 0, h: 0, at: [] };
  const widths = plan.columns.map((name, i) => (closed.has(i) ? plan.body.width
    : Math.max(70, 8.4 * Math.min(NAME.most, [...name].length), ...plan.stages.map((stage) => cell(i, stage).w))));
  const bands = bandsFor(widths, plan.stages.map((stage) => Math.max(...widths.map((_, i) => cell(i, stage).h))), aspect);
  const boxes = [], bodies = [], titles = [];
  const reach = (own) => own.reduce((sum, i) => sum + widths[i] + CELL.beside, -CELL.beside);
  const lines = linesOf(plan, Math.ceil(plan.columns.length / bands));
  const total = Math.max(...lines.map(reach)) + CELL.beside;
  let y = 0;
  for (const own of [...lines].reverse()) { // the last bodies on top
    let x = (total - reach(own)) / 2;
    const left = own.map((i) => { const at = x; x += widths[i] + CELL.beside; return at; });
    const start = y;
    y += CELL.title + CELL.gap / 2;
    for (const stage of [...plan.stages].reverse()) {
      const height = Math.max(0, ...own.map((i) => cell(i, stage).h));
      if (!height) continue;
      own.forEach((i, k) => {
        const { w, h, at } = cell(i, stage);
        for (const [c, dx, dy] of at) boxes[c] = { x: left[k] + (widths[i] - w) / 2 + dx, y: y + height - h + dy, ...sizes[c] };
      });
      titles.push({ stage, x: left[0], y: y - 6, columns: own });
      y += height + CELL.gap;
    }
    y = Math.max(y, start + plan.body.height + CELL.gap);
    own.forEach((i, k) => {
      if (closed.has(i)) bodies[i] = { column: i, x: left[k], y: (start + y - CELL.gap - plan.body.height) / 2, w: plan.body.width, h: plan.body.height };
      else titles.push({ column: i, x: left[k], y: start, w: widths[i], h: y - start - CELL.gap / 2 });
    });
  }
  return { boxes, bodies, titles, width: total, height: y };
}

/** Into how many bands columns of these widths are broken: one, unless the picture is much larger with more. */
function bandsFor(widths, heights, aspect = CELL.aspect) {
  const high = heights.reduce((sum, each) => sum + (each ? each + CELL.gap : 0), CELL.title + CELL.gap / 2);
  const scale = (bands) => {
    const most = Math.max(0, ...inLines(widths, Math.ceil(widths.length / bands)).map((own) => own.reduce((sum, each) => sum + each + CELL.beside, 0)));
    return Math.min(aspect / (most + 20), 1 / (bands * high + 2 * LEAF.row));
  };
  let best = 1;
  for (let bands = 2; bands <= widths.length; bands++) if (scale(bands) > 1.7 * scale(1) && scale(bands) > 1.05 * scale(best)) best = bands;
  return best;
}

/** Boxes of a cell from left to right, in lines. */
function flow(own, sizes) {
  const limit = Math.max(2 * BOX.width + BOX.gap, ...own.map((c) => sizes[c].w),
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

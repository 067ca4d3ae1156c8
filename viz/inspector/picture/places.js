// One place for what the versions share, and clusters of places: by body, sweep, energy, and whether it is spurious; and places
// of nodes in layers: arguments below their uses, neighbors near one another.

const ENERGIES = ["kinetic", "potential"]; // a tag beside one of these is a body
const OTHER = "other"; // of a body, what carries no energy's tag
const LAGRANGIAN = "lagrangian"; // what formulations with a step inside tag as that, the others leave without a tag
const MANY = 60; // clusters; above, they are not split by energy
const STAGES = ["as written", "reverse sweep", "forward sweep", "both sweeps"];
const natural = new Intl.Collator("en", { numeric: true }).compare; // link 2 before link 10

/** { clusters, columns, columnOf, parents, stages, place, cluster }: of a cluster its column, of each version the place of every
 * node, of each place its cluster.
 *
 * A cluster is { column, stage, title, marked }. LEAF and RESULT stand for one: inputs, and sums that are outputs. */
const LEAF_PLACE = -1, RESULT_PLACE = -2;
function placesOf(record, versions) {
  const bodies = bodiesOf(record, versions);
  const untagged = versions.some(({ labels }) => labels.some(([tags]) => tags.includes(LAGRANGIAN))) ? LAGRANGIAN : "";
  let groups = versions.map((version) => version.ops.map((_, node) => groupOf(version, node, bodies, untagged)));
  if (new Set(groups.flat().map((each) => JSON.stringify(each))).size > MANY) {
    groups = groups.map((own) => own.map((each) => (typeof each === "number" ? each : { ...each, title: "" })));
  }
  const inputs = new Set(versions.flatMap((each) => each.inputs.map(([name]) => name)));
  const leafOf = ({ names, constants }) => (node) => { // a named node stands for the input of that name
    const name = names[node]?.[0];
    return name !== undefined && inputs.has(name) ? `name ${name}` : constants.has(node) ? numberLeaf(constants.get(node)) : null;
  };
  const found = new Map(), meaning = new Map(), keys = new Map(), clusterKeys = [], first = [];
  const place = versions.map((version, v) => {
    const means = meanings(version, leafOf(version), meaning), seen = new Map();
    return version.ops.map((_, node) => {
      const group = JSON.stringify(groups[v][node]);
      const kind = `${means[node]} ${group}`, again = seen.get(kind) ?? 0;
      seen.set(kind, again + 1);
      const key = `${again} ${kind}`;
      if (!found.has(key)) {
        found.set(key, found.size);
        first.push([v, node]);
        clusterKeys.push(group);
        if (typeof groups[v][node] !== "number") keys.set(group, groups[v][node]);
      }
      return found.get(key);
    });
  });
  const stages = versions[0].stages?.length ? versions[0].stages : STAGES;
  const columns = columnsOf(bodies, [...keys.values()], versions, groups);
  const order = (a, b) => columns.indexOf(a.column) - columns.indexOf(b.column) || stages.indexOf(a.stage) - stages.indexOf(b.stage)
    || a.marked - b.marked || natural(a.title, b.title);
  const clusters = [...keys.values()].sort(order), number = new Map(clusters.map((each, c) => [JSON.stringify(each), c]));
  const parents = new Map(record.columns);
  return {
    clusters, columns, place, first, stages, columnOf: clusters.map(({ column }) => columns.indexOf(column)),
    parents: columns.map((name) => { // the next further in that is a column
      let up = parents.get(name);
      while (up && !columns.includes(up)) up = parents.get(up);
      return columns.indexOf(up);
    }),
    tree: columns.map((name) => parents.has(name)),
    cluster: clusterKeys.map((key) => number.get(key) ?? Number(key)),
  };
}

/** Columns that are bodies: as the record says, else tags beside an energy, else tags with a number. */
function bodiesOf(record, versions) {
  const tags = versions.flatMap((version) => version.labels.map(([own]) => own));
  const used = new Set(tags.flat());
  const told = record.columns.map(([name]) => name).filter((name) => used.has(name));
  if (told.length) return told;
  const beside = new Set(tags.filter((own) => ENERGIES.some((energy) => own.includes(energy))).flat().filter((each) => !ENERGIES.includes(each)));
  return [...(beside.size ? beside : [...used].filter((each) => /\d$/.test(each)))].sort(natural);
}

function groupOf(version, node, bodies, untagged) {
  if (!version.args[node].length) return LEAF_PLACE;
  if (!version.users[node].length) return RESULT_PLACE; // nothing but an output needs it
  const [tags, , stage] = version.labels[version.label[node]];
  const own = bodies.filter((body) => tags.includes(body));
  const rest = tags.filter((each) => !own.includes(each));
  const column = own[0] ?? rest.shift() ?? untagged, said = rest.filter((each) => !ENERGIES.includes(each));
  return { column, stage, title: (said.length ? said : rest).join(", ") || (own.length ? OTHER : ""), marked: version.marked.has(node) };
}

/** Columns in their order: bodies, then other tags, those first that all versions have, so that none leaves a gap. */
function columnsOf(bodies, clusters, versions, groups) {
  const used = new Set(clusters.map((each) => each.column));
  const held = (column) => groups.filter((own) => own.some((each) => each.column === column)).length;
  const rest = [...used].filter((each) => !bodies.includes(each));
  return [...bodies.filter((body) => used.has(body)), ...rest.sort((a, b) => held(b) - held(a) || natural(a, b))];
}

const LAYERS = { step: 52, gap: 8, sweeps: 8 }; // pixels from layer to layer, and between two nodes of a layer

/** { x, y, width, height }: centers of nodes 0.. of these widths, y downward; edges lead from an earlier node to a later. */
function layered(widths, edges, step = LAYERS.step) {
  const below = widths.map(() => []), above = widths.map(() => []);
  for (const [source, target] of edges) { below[target].push(source); above[source].push(target); }
  const near = above.map((each, i) => [...each, ...below[i]]);
  const layers = broken(layersOf(below, above), widths, step);
  const place = new Float64Array(widths.length);
  for (const layer of layers) putNear(place, layer, widths, layer.map((_, i) => i));
  for (let sweep = 0; sweep < LAYERS.sweeps; sweep++) {
    for (const layer of sweep % 2 ? layers : [...layers].reverse()) {
      const wish = new Map(layer.map((node) => [node, near[node].length
        ? near[node].reduce((sum, each) => sum + place[each], 0) / near[node].length : place[node]]));
      layer.sort((a, b) => wish.get(a) - wish.get(b));
      putNear(place, layer, widths, layer.map((node) => wish.get(node)));
    }
  }
  const left = widths.reduce((least, width, i) => Math.min(least, place[i] - width / 2), widths.length ? Infinity : 0);
  const right = widths.reduce((most, width, i) => Math.max(most, place[i] + width / 2), widths.length ? -Infinity : 0);
  const y = [];
  [...layers].reverse().forEach((layer, high) => { for (const node of layer) y[node] = (high + 0.5) * step; });
  return { x: [...place].map((at) => at - left), y, width: right - left, height: layers.length * step };
}

/** Nodes by the length of the longest way to them; one without arguments here is just below its first use. */
function layersOf(below, above) {
  const rank = below.map(() => 0), layers = [];
  below.forEach((args, node) => { for (const arg of args) rank[node] = Math.max(rank[node], rank[arg] + 1); });
  below.forEach((args, node) => {
    if (!args.length && above[node].length) rank[node] = above[node].reduce((least, user) => Math.min(least, rank[user]), Infinity) - 1;
  });
  rank.forEach((high, node) => { (layers[high] ??= []).push(node); });
  return layers;
}

/** A layer that would be much wider than the whole is high is broken into several. */
function broken(layers, widths, step) {
  const wide = (nodes) => nodes.reduce((sum, node) => sum + widths[node] + LAYERS.gap, 0);
  const limit = Math.max(240, 1.3 * Math.sqrt(wide(widths.map((_, i) => i)) * step));
  return layers.flatMap((layer) => inLines(layer, Math.ceil(layer.length / Math.ceil(wide(layer) / limit))));
}
/** A list in lines of so many. */
const inLines = (list, most) => Array.from({ length: Math.ceil(list.length / most) }, (_, k) => list.slice(k * most, (k + 1) * most));

/** Put the nodes of a layer, in order, where they wish to be, as far as they do not overlap.
 *
 * The least squares of the ways they are off, by pooling: nodes that touch move together. */
function putNear(place, layer, widths, wish) {
  const offsets = [], pools = []; // of each pool the mean wish for its left end, and its size
  let offset = 0;
  layer.forEach((node, i) => {
    offset += widths[node] / 2;
    offsets.push(offset);
    let mean = wish[i] - offset, size = 1;
    while (pools.length && pools.at(-1)[0] >= mean) {
      const [other, others] = pools.pop();
      mean = (mean * size + other * others) / (size + others);
      size += others;
    }
    pools.push([mean, size]);
    offset += widths[node] / 2 + LAYERS.gap;
  });
  const starts = pools.flatMap(([mean, size]) => Array(size).fill(mean));
  layer.forEach((node, i) => { place[node] = starts[i] + offsets[i]; });
}

// Places of nodes in layers: arguments below their uses, neighbors near one another.

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
  return layers.flatMap((layer) => {
    const size = Math.ceil(layer.length / Math.ceil(wide(layer) / limit)), rows = [];
    for (let i = 0; i < layer.length; i += size) rows.push(layer.slice(i, i + size));
    return rows;
  });
}

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

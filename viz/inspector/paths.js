// What lies between nodes: ancestors, descendants, how many paths, and the heaviest.

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

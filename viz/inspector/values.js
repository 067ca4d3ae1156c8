// Values of nodes, slopes of edges and adjoints of a version at a point.

/** A graph made ready: constants as numbers, uses of each node, edges in the order of evaluation, numbers as listed. */
function prepare(version) {
  const constants = new Map();
  const args = version.args.map((each, i) => {
    if (Array.isArray(each)) return each;
    constants.set(i, Number(each));
    return [];
  });
  const users = args.map(() => []);
  const edges = [];
  args.forEach((own, target) => own.forEach((source, slot) => {
    users[source].push(target);
    edges.push([source, target, slot]);
  }));
  let operations = 0;
  const number = args.map((own) => (own.length ? ++operations : 0)); // as in Graph.listing(): %1 is the first operation
  const byNumber = new Map(number.map((each, node) => [each, node]).filter(([each]) => each));
  const functions = version.ops.map((op) => VALUE[op]);
  return { ...version, args, functions, constants, users, edges, number, byNumber, operations, marked: new Set(version.marked),
    crossed: new Set((version.blamed ?? []).map(([source, target]) => `${source} ${target}`)) };
}

/** The value of every node, inputs in the order of the version's. */
function evaluate(version, row) {
  const found = new Float64Array(version.ops.length);
  version.inputs.forEach(([, node], i) => { if (node >= 0) found[node] = row[i]; });
  version.constants.forEach((value, node) => { found[node] = value; });
  for (let i = 0; i < found.length; i++) {
    const a = version.args[i];
    if (a.length === 2) found[i] = version.functions[i](found[a[0]], found[a[1]]);
    else if (a.length === 1) found[i] = version.functions[i](found[a[0]]);
    else if (a.length) found[i] = version.functions[i](...a.map((arg) => found[arg]));
  }
  return found;
}

/** The local partials of every node, by the programs of the operation table. */
function slopesAt(version, programs, values) {
  return version.args.map((args, node) => {
    if (!args.length) return [];
    const { code, out } = programs[version.ops[node]];
    const work = [values[node], ...args.map((arg) => values[arg])];
    for (const line of code) {
      work.push(typeof line === "number" ? line : VALUE[line[0]](...line.slice(1).map((i) => work[i])));
    }
    return out.map((i) => work[i]);
  });
}

/** d output / d node for every node, after the reverse sweep has passed `steps` nodes from the end; zero wins. */
function adjoints(version, slopes, output, steps = version.ops.length) {
  const bars = new Float64Array(version.ops.length);
  bars[output] = 1;
  const last = version.ops.length - 1;
  for (let node = last; node > last - steps; node--) {
    if (bars[node] === 0) continue;
    version.args[node].forEach((arg, slot) => { bars[arg] += VALUE.zero_safe_mul(bars[node], slopes[node][slot]); });
  }
  return bars;
}

const ROUNDING = 2 ** -53; // relative error of a rounded number

/** What rounding can make of every value, to first order: errors of arguments through the slopes, and one's own.
 *
 * errors: of the inputs, in their order; by default that of a rounded number. */
function errorBounds(version, slopes, values, errors = []) {
  const bounds = new Float64Array(values.length), given = new Map(version.inputs.map(([, node], i) => [node, errors[i]]));
  version.args.forEach((args, node) => {
    let sum = version.constants.has(node) ? 0 : given.get(node) ?? ROUNDING * Math.abs(values[node]);
    args.forEach((arg, slot) => { sum += VALUE.zero_safe_mul(Math.abs(slopes[node][slot]), bounds[arg]); });
    bounds[node] = Number.isFinite(sum) ? sum : 0;
  });
  return bounds;
}

/** Bounds, with those of faint outputs from their adjoints: ways from a node count with their signs, not their sizes.
 *
 * Along a long elimination the sizes of all ways grow without end, and what they add up to does not. */
function sharpened(version, slopes, values, bounds, errors = []) {
  const given = new Map(version.inputs.map(([, node], i) => [node, errors[i]])), sharp = bounds.slice();
  const own = values.map((value, node) => (version.constants.has(node) ? 0 : given.get(node) ?? ROUNDING * Math.abs(value)));
  for (const [, , output] of version.outputs) {
    if (!(Math.abs(values[output]) <= bounds[output])) continue;
    const sum = adjoints(version, slopes, output).reduce((all, bar, node) => (bar === 0 ? all : all + Math.abs(bar) * own[node]), 0);
    if (sum < bounds[output]) sharp[output] = sum;
  }
  return sharp;
}

// A graph made ready for the page, and what rounding makes of its values.

/** A graph made ready: constants as numbers, uses of each node, edges in the order of evaluation, numbers as listed. */
function prepare(version) {
  const ops = opsOf(version), args = argsOf(version);
  const constants = new Map(version.nodes.flatMap((node, i) => (ops[i] === "constant" ? [[i, Number(node)]] : [])));
  const users = args.map(() => []);
  const edges = [];
  args.forEach((own, target) => own.forEach((source, slot) => {
    users[source].push(target);
    edges.push([source, target, slot]);
  }));
  let operations = 0;
  const number = args.map((own) => (own.length ? ++operations : 0)); // as in Graph.listing(): %1 is the first operation
  const byNumber = new Map(number.map((each, node) => [each, node]).filter(([each]) => each));
  return { ...version, run: evaluator(version), ops, args, constants, users, edges, number, byNumber, operations, marked: new Set(version.marked),
    crossed: new Set((version.blamed ?? []).map(([source, target]) => `${source} ${target}`)) };
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

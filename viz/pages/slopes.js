// Of a graph's nodes: partials, adjoints of an output, what rounding makes of values, and which compute the same.

/** The operation of every node, and the numbers of its arguments: none of a constant and an input. */
const opsOf = ({ nodes }) => nodes.map((node) => (Array.isArray(node) ? node[0] : node === null ? "variable" : "constant"));
const argsOf = ({ nodes }) => nodes.map((node) => (Array.isArray(node) ? node.slice(1) : []));

/** The partials of an operation by the program of its row, in numbers or as nodes. work: its result and its arguments. */
function partials({ code, out }, work, apply, constant) {
  for (const line of code) {
    work.push(typeof line === "number" ? constant(line) : apply(line[0], ...line.slice(1).map((i) => work[i])));
  }
  return out.map((i) => work[i]);
}

/** The partials of every node in its arguments at values of a graph. */
function slopesAt({ ops, args }, values) {
  const apply = (op, ...numbers) => VALUE[op](...numbers);
  return args.map((each, node) => (each.length
    ? partials(ROWS[ops[node]].slopes, [values[node], ...each.map((arg) => values[arg])], apply, (number) => number) : []));
}

/** d output / d node for every node, after the reverse sweep has passed `steps` nodes from the end; zero wins. */
function adjoints({ args }, slopes, output, steps = args.length) {
  const bars = new Float64Array(args.length), last = args.length - 1;
  bars[output] = 1;
  for (let node = last; node > last - steps; node--) {
    if (bars[node] === 0) continue;
    args[node].forEach((arg, slot) => { bars[arg] += VALUE.zero_safe_mul(bars[node], slopes[node][slot]); });
  }
  return bars;
}

/** What rounding can make of every value, to first order: errors of arguments through the slopes, and a node's own.
 *
 * endless: what stands for a bound that is not finite. */
function errorBounds({ args }, slopes, own, endless = Infinity) {
  const bounds = new Float64Array(args.length);
  args.forEach((each, node) => {
    const sum = each.reduce((all, arg, slot) => all + VALUE.zero_safe_mul(Math.abs(slopes[node][slot]), bounds[arg]), own[node]);
    bounds[node] = Number.isFinite(sum) ? sum : endless;
  });
  return bounds;
}

/** Of every node a number that nodes have in common that compute the same.
 *
 * leaf: what a node is by itself, if it is anything.  known: numbers of other graphs, which are joined to. */
function meanings({ ops, args }, leaf, known = new Map()) {
  const means = [];
  ops.forEach((op, node) => {
    const own = args[node].map((arg) => means[arg]);
    const key = leaf(node) ?? `${op} ${ROWS[op]?.commutative ? own.sort((a, b) => a - b) : own}`;
    if (!known.has(key)) known.set(key, known.size);
    means.push(known.get(key));
  });
  return means;
}
const numberLeaf = (value) => `number ${Object.is(value, -0) ? "-0" : value}`;

// Graphs in a page: values of their nodes, slopes of their edges, adjoints of an output; and steps of a rate.
//
// A graph is {nodes, inputs, outputs} as `graph_data` of viz/pages/operations.py has it, an operation a row of the table.

/** The operation of every node, and the numbers of its arguments: none of a constant and an input. */
const opsOf = ({ nodes }) => nodes.map((node) => (Array.isArray(node) ? node[0] : node === null ? "variable" : "constant"));
const argsOf = ({ nodes }) => nodes.map((node) => (Array.isArray(node) ? node.slice(1) : []));

/** The function from numbers of the inputs, in order, to the value of every node: the same array at every call. */
function evaluator({ nodes, inputs }) {
  const found = new Float64Array(nodes.length), steps = [];
  nodes.forEach((node, i) => {
    if (!Array.isArray(node)) found[i] = Number(node); // JSON has no infinity
    else steps.push({ i, value: VALUE[node[0]], args: node.slice(1) });
  });
  return (row) => {
    inputs.forEach(([, node], k) => { if (node >= 0) found[node] = row[k]; });
    for (const { i, value, args } of steps) {
      if (args.length === 2) found[i] = value(found[args[0]], found[args[1]]);
      else found[i] = args.length === 1 ? value(found[args[0]]) : value(...args.map((arg) => found[arg]));
    }
    return found;
  };
}

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

/** A state x' = rate(x, t) a step later, by Runge and Kutta's method of order 4. */
function rk4(rate, x, t, h) {
  const moved = (k, by) => x.map((each, i) => each + by * k[i]);
  const k1 = rate(x, t), k2 = rate(moved(k1, h / 2), t + h / 2), k3 = rate(moved(k2, h / 2), t + h / 2), k4 = rate(moved(k3, h), t + h);
  return x.map((each, i) => each + (h / 6) * (k1[i] + 2 * (k2[i] + k3[i]) + k4[i]));
}

// Graphs in a page: values of their nodes; and steps of a rate. Slopes are those of slopes.js.
//
// A graph is {nodes, inputs, outputs} as `graph_data` of viz/pages/operations.py has it, an operation a row of the table.

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

/** A state x' = rate(x, t) a step later, by Runge and Kutta's method of order 4. */
function rk4(rate, x, t, h) {
  const moved = (k, by) => x.map((each, i) => each + by * k[i]);
  const k1 = rate(x, t), k2 = rate(moved(k1, h / 2), t + h / 2), k3 = rate(moved(k2, h / 2), t + h / 2), k4 = rate(moved(k3, h), t + h);
  return x.map((each, i) => each + (h / 6) * (k1[i] + 2 * (k2[i] + k3[i]) + k4[i]));
}

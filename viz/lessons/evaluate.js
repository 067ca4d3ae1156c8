// Values of graphs in the page: a node after the other, by the functions of the table of operations.

/** The function from {input: value} to {output: value} of a graph. */
function evaluator(graph) {
  const size = graph.nodes.length;
  const value = new Float64Array(size);
  const inputs = [], work = [];
  graph.nodes.forEach((node, k) => {
    if (typeof node === "number") value[k] = node;
    else if (typeof node === "string") inputs.push([k, node]);
    else work.push([k, VALUE[node[0]], node[1], node[2] ?? 0, node[3] ?? 0]);
  });
  const outputs = Object.entries(graph.outputs);
  return (at) => {
    for (const [k, name] of inputs) value[k] = at[name];
    for (const [k, operation, a, b, c] of work) value[k] = operation(value[a], value[b], value[c]);
    const found = {};
    for (const [name, k] of outputs) found[name] = value[k];
    return found;
  };
}

/** Names of the numbered outputs of a kind, as tau0, tau1, .. */
const numbered = (kind, n, end = "") => Array.from({ length: n }, (_, i) => kind + i + end);

/** Pivots of a symmetric matrix, the last first: the matrix before every pivot, and after the last. */
function stages(matrix) {
  const left = matrix.map((row) => row.slice());
  const all = [left.map((row) => row.slice())];
  for (let k = left.length - 1; k > 0; k--) {
    for (let i = 0; i < k; i++)
      for (let j = 0; j < k; j++) left[i][j] -= (matrixAt(left, i, k) * matrixAt(left, k, j)) / left[k][k];
    all.push(left.map((row) => row.slice()));
  }
  return all;
}
const matrixAt = (matrix, i, j) => matrix[Math.max(i, j)][Math.min(i, j)];

/** A motion by Euler's method or rk4: states at every step, until one is not finite. */
function motion(rate, start, names, dt, steps, method) {
  const at = { ...start }, rows = [];
  const slope = (state) => {
    names.forEach((name, i) => { at[name] = state[i]; });
    const found = rate(at);
    return names.map((name) => found[name + "_dot"]);
  };
  const moved = (state, by, h) => state.map((x, i) => x + h * by[i]);
  let state = names.map((name) => start[name]);
  for (let k = 0; k <= steps && state.every(Number.isFinite); k++) {
    rows.push(state);
    const k1 = slope(state);
    if (method === "euler") { state = moved(state, k1, dt); continue; }
    const k2 = slope(moved(state, k1, dt / 2)), k3 = slope(moved(state, k2, dt / 2)), k4 = slope(moved(state, k3, dt));
    state = state.map((x, i) => x + (dt / 6) * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]));
  }
  return rows;
}

/** Four digits, with a minus that is one. */
const digits = (x) => (Number.isFinite(x) ? String(+x.toPrecision(4)) : "—").replace("-", "−");

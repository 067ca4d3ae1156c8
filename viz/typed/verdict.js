// The verdict on a formulation: does it differ from the chain rule, by how much, and what in its graph is to blame?

const STATES = 24, SMALLEST = 2 ** -53; // states tried, a third of size 1, the rest from 1e-6 to 1e6; a rounding
const DIFFERS = "This is not the torque of the chain rule, however small dt is";

/** With q = qd dt + q_old in it the momentum is p + dt c, c = dE/dq of E = L or K, so its rate has c too much at every dt.
 * It is the torque of the chain rule if and only if c is 0 at every state. */
function verdict(system, formulation) {
  const graph = inverseDynamics(system, formulation), energyOf = THROUGH_STEP[formulation], names = displayNames(system);
  const energy = formulation === "kinetic_only" ? "K" : "L", slope = `d${energy}/dq`;
  const alike = (reason) => ({ graph, energy, differs: false, summary: `Holds: this is the torque of the chain rule: ${reason}.`, lines: [], nodes: new Set(), edges: [], lacking: "" });
  if (!energyOf) return alike("no derivative in it is taken through a step of time");
  const build = new Builder(), [from] = folded([energyOf(system)], build);
  const c = folded(cotangents(new Map([[from, ONE()]]), system.q, build));
  if (c.every(({ value }) => value === 0)) return alike(`${slope} is 0, so nothing comes through q = qd dt + q_old`);
  const { at, finite, excess } = stateOf(system, c);
  if (finite && !excess.length) return alike(`${slope} is 0 to rounding at all ${finite} states tried, though its form does not prove it`);
  if (!finite) {
    const summary = `This is not shown to be the torque of the chain rule: ${slope} is finite at none of the ${STATES} states tried.`;
    return { ...alike(""), differs: true, summary, sentence: summary };
  }
  const { nodes, edges, cancelled } = blame(system, formulation, graph), used = new Set(topological(excess.map(([i]) => c[i])));
  const shown = [...system.q, ...system.qd, ...system.extra].filter((node) => used.has(node));
  const where = shown.map(({ name }) => `${names.get(name) ?? name}=${at.get(name)}`).join(", ");
  const term = (i, value, sign) => `${sign < 0 ? "-" : ""}${slope}.${system.coordinates[i]} = ${+(sign * value).toPrecision(6)}`;
  const missing = excess.filter(([i]) => cancelled.has(`tau${i}`)), output = ([i]) => names.get(`tau${i}`);
  const lacking = missing.length ? `In ${missing.map(output).join(", ")} this cancels a right term, and no edge is left to be marked. `
    + `Missing: ${missing.map(([i, value]) => term(i, value, -1)).join(", ")}.` : "";
  const blamed = edges.length ? [`There by mistake: ${edges.length === 1 ? "an edge" : `${edges.length} edges`}, ${nodes.size
    ? `with ${nodes.size} of ${graph.nodes.length} nodes, which serve${nodes.size === 1 ? "s" : ""} nothing else` : "and no node by itself"}.`] : [];
  const lines = [...excess.map((each) => `  ${output(each)}  ${term(...each, 1)}`), ...blamed, ...(lacking ? [lacking] : [])];
  const summary = `${DIFFERS}. Too much in it${where && ` at ${where}`}:`;
  const symbols = excess.map((each) => `${output(each)} has ${slope}.${system.coordinates[each[0]]}`).join(", ");
  return { graph, energy, differs: true, summary, lines, nodes, edges, lacking, sentence: `${DIFFERS}: ${symbols} too much.` };
}

/** The first state at which c is not 0, else the last; at how many it was finite; and c there, [[i, value]]. */
function stateOf(system, c) {
  const names = [...system.q, ...system.qd, ...system.extra].map(({ name }) => name), inner = topological(c), partials = within({ build: null },
    () => inner.map((node) => (node.args.length ? partialsOf(node) : [])));
  let seed = 20250814, finite = 0, at, excess = [];
  const random = () => { seed = (seed * 16807) % 2147483647; return seed / 2147483647; }; // the same on every page
  for (let k = 0; k < STATES && !excess.length; k++) {
    at = new Map(names.map((name) => {
      const size = k < STATES / 3 ? 1 : 10 ** (12 * random() - 6), x = size * (k % 2 ? random() : 2 * random() - 1); // a root or a logarithm needs k % 2
      return [name, system.parameters.get(name) ?? +x.toPrecision(3)];
    }));
    const values = valuesOf([...inner, ...partials.flat()], at), errors = errorsOf(inner, partials, values);
    const found = c.map((node) => [values[inner.indexOf(node)], errors.get(node)]);
    if (!found.every(([value]) => Number.isFinite(value))) continue;
    finite += 1;
    excess = found.flatMap(([value, error], i) => (value && Math.abs(value) >= 10 * error ? [[i, value]] : []));
  }
  return { at, finite, excess };
}
/** What rounding can make of every node, to first order; values: of the nodes, then of their partials. */
function errorsOf(nodes, partials, values) {
  const errors = new Map();
  let next = nodes.length;
  nodes.forEach((node, i) => {
    const own = node.args.length ? ROWS[node.op].rounding : node.value === null ? 1 : 0;
    let error = own * SMALLEST * Math.abs(values[i]);
    partials[i].forEach((_, slot) => {
      const slope = Math.abs(values[next++]), before = errors.get(node.args[slot]);
      if (slope && before) error += slope * before;
    });
    errors.set(node, error);
  });
  return errors;
}

/** What of the graph is there by the derivative through the step: nodes that serve nothing else, edges [source, target] by
 * which it enters the rest, outputs that have no such edge left, since folding took it away together with a right one.
 * All that comes through the step is multiplied by a variable. What folds to 0 when that is 0 is wrong, and the edges that
 * lead out of it are to blame; at 1 the graph is the formulation's, node by node. */
function blame(system, formulation, graph) {
  const through = variable("through the step"), marked = inverseDynamics(system, formulation, through);
  const [without, whole] = [0, 1].map((factor) => pairs(marked.nodes, folded(marked.nodes, new Builder(), new Map([[through, constant(factor)]]))));
  const wrong = new Set(marked.nodes.filter((node) => without.get(node).value === 0 && node.value !== 0));
  const alike = sameStructure(graph.nodes), reach = new Map(marked.nodes.map((node) => [node, 0]));
  [...marked.outputs.values()].forEach((node, i) => reach.set(node, reach.get(node) | (1 << i)));
  for (const node of [...marked.nodes].reverse()) for (const arg of node.args) reach.set(arg, reach.get(arg) | reach.get(node));
  const cut = new Map();
  let touched = 0, left = 0;
  for (const node of marked.nodes) {
    for (const arg of wrong.has(node) ? [] : node.args.filter((each) => wrong.has(each))) {
      const source = alike(whole.get(arg)), target = alike(whole.get(node));
      touched |= reach.get(node);
      if (!source || !target?.args.includes(source)) continue;
      left |= reach.get(node);
      cut.set(target, [...(cut.get(target) ?? []), target.args.indexOf(source)]);
    }
  }
  const needed = new Set(), stack = [...marked.outputs].filter(([, node]) => !wrong.has(node)).map(([name]) => graph.outputs.get(name));
  while (stack.length) {
    const node = stack.pop();
    if (needed.has(node)) continue;
    needed.add(node);
    stack.push(...node.args.filter((_, slot) => !cut.get(node)?.includes(slot)));
  }
  return {
    nodes: new Set(graph.nodes.filter((node) => !needed.has(node))),
    edges: [...cut].flatMap(([target, slots]) => [...new Set(slots)].map((slot) => [target.args[slot], target])),
    cancelled: new Set([...marked.outputs.keys()].filter((_, i) => touched & ~left & (1 << i))),
  };
}
/** A function from a node to the one of `nodes` that computes the same from the same, if any. */
function sameStructure(nodes) {
  const numbers = new Map(), known = new Map(), found = new Map();
  const number = (output) => {
    for (const node of topological([output])) {
      if (known.has(node)) continue;
      const args = node.args.map((arg) => known.get(arg));
      if (ROWS[node.op]?.commutative) args.sort((a, b) => a - b);
      const key = node.args.length ? `${node.op} ${args.join(" ")}` : node.value === null ? `name ${node.name}` : `number ${node.value}`;
      if (!numbers.has(key)) numbers.set(key, numbers.size);
      known.set(node, numbers.get(key));
    }
    return known.get(output);
  };
  for (const node of nodes) if (!found.has(number(node))) found.set(number(node), node);
  return (node) => found.get(number(node));
}

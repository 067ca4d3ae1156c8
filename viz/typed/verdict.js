// The verdict on a formulation: does it differ from the chain rule, by how much, and what in its graph is to blame; and lint in words.

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
  const inputs = [...system.q, ...system.qd, ...system.extra], inner = topological(c), { number, ...arrays } = numbered(inner, inputs);
  const graph = { ops: opsOf(arrays), args: argsOf(arrays) }, run = evaluator(arrays);
  const rounded = inner.map(({ op, args, value }) => SMALLEST * (args.length ? ROWS[op].rounding : value === null ? 1 : 0));
  let seed = 20250814, finite = 0, at, excess = [];
  const random = () => { seed = (seed * 16807) % 2147483647; return seed / 2147483647; }; // the same on every page
  for (let k = 0; k < STATES && !excess.length; k++) {
    at = new Map(inputs.map(({ name }) => {
      const size = k < STATES / 3 ? 1 : 10 ** (12 * random() - 6), x = size * (k % 2 ? random() : 2 * random() - 1); // a root or a logarithm needs k % 2
      return [name, system.parameters.get(name) ?? +x.toPrecision(3)];
    }));
    const values = run([...at.values()]), errors = errorBounds(graph, slopesAt(graph, values), rounded.map((each, i) => each * Math.abs(values[i])));
    const found = c.map((node) => [values[number.get(node)], errors[number.get(node)]]);
    if (!found.every(([value]) => Number.isFinite(value))) continue;
    finite += 1;
    excess = found.flatMap(([value, error], i) => (value && Math.abs(value) >= 10 * error ? [[i, value]] : []));
  }
  return { at, finite, excess };
}

/** What of the graph is there by the derivative through the step: nodes that serve nothing else, edges [source, target] by
 * which it enters the rest, outputs that have no such edge left, since folding took it away together with a right one.
 * All that comes through the step is multiplied by a variable. What folds to 0 when that is 0 is wrong, and the edges that
 * lead out of it are to blame; at 1 the graph is the formulation's, node by node. */
function blame(system, formulation, graph) {
  const through = variable("through the step"), marked = inverseDynamics(system, formulation, through);
  const [without, whole] = [0, 1].map((factor) => pairs(marked.nodes, folded(marked.nodes, new Builder(), new Map([[through, constant(factor)]]))));
  const wrong = new Set(marked.nodes.filter((node) => without.get(node).value === 0 && node.value !== 0));
  const all = topological([...graph.nodes, ...whole.values()]), { number, ...arrays } = numbered(all, []);
  const leaf = (node) => (all[node].args.length ? null : all[node].value === null ? `name ${all[node].name}` : numberLeaf(all[node].value));
  const means = meanings({ ops: opsOf(arrays), args: argsOf(arrays) }, leaf), meaning = (node) => means[number.get(node)];
  const same = new Map([...graph.nodes].reverse().map((node) => [meaning(node), node])), alike = (node) => same.get(meaning(node));
  const reach = new Map(marked.nodes.map((node) => [node, 0]));
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

const joined = (words) => (words.length > 1 ? `${words.slice(0, -1).join(", ")} and ${words.at(-1)}` : words[0] ?? "");
const verb = (subjects, word) => (subjects.length > 1 ? word : `${word}s`);

/** What people call the inputs and outputs of a graph: {q0: q.theta}. */
function displayNames({ coordinates }) {
  const kinds = [["q", ""], ["q", "_old"], ["qd", ""], ["qd", "_old"], ["qdd", ""], ["tau", ""]];
  return new Map(coordinates.flatMap((name, i) => kinds.map(([kind, old]) => [`${kind}${i}${old}`, `${kind}${old}.${name}`])));
}

/** Sentences as `cgraph lint` has them, for the verdict on a formulation of inverse dynamics. */
function lint(system, { graph, summary, lines, energy }) {
  const names = displayNames(system), shown = (name) => names.get(name) ?? name;
  const byName = new Map([...graph.inputs, ...graph.nodes].filter(({ name }) => name).map((node) => [node.name, node]));
  const group = (nodes) => nodes.map(({ name }) => byName.get(name)).filter(Boolean);
  const q = group(system.q), qd = group(system.qd), called = (nodes) => joined(nodes.map(({ name }) => shown(name)));
  const used = new Set(graph.nodes), unused = graph.inputs.filter((node) => !used.has(node));
  const first = [summary, ...lines], notes = unused.map(({ name }) => `Note: Nothing uses the input ${shown(name)}.`);
  if (!q.length || !qd.length) return [...first, ...notes];
  const proof = (nodes, on) => {
    const start = `Holds: no path leads from ${called(on)} to ${called(nodes)}`;
    if (!nodes.some((node) => node.args.length)) return `${start}: ${called(nodes)} ${nodes.length > 1 ? "are inputs" : "is an input"}.`;
    const reached = new Set(topological(nodes));
    return `${start}, made from ${called(graph.inputs.filter((node) => reached.has(node)))} alone.`;
  };
  if (!q[0].args.length) return [...first, proof(q, qd), proof(qd, q), ...notes];
  const targets = graph.nodes.filter((node) => q.includes(node));
  const edges = targets.map((node) => [byName.get(node.name.replace("q", "qd")), node]);
  const through = graph.nodes.some(({ label }) => label & COUPLING && label & ADJOINT);
  const texts = edges.map(([from, to]) => `${shown(from.name)} * dt -> ${shown(to.name)}`), width = Math.max(...texts.map((text) => text.length));
  const paths = [`${called(targets)} ${verb(targets, "depend")} on ${called(edges.map(([from]) => from))}. Without ${edges.length > 1 ? `these ${edges.length} edges` : "this edge"} there is no path:`];
  edges.forEach(([from, to], i) => paths.push(
    `  ${texts[i].padEnd(width)}  through it d${energy}/d${shown(from.name)} ${through ? "gains" : "would gain"} dt * d${energy}/d${shown(to.name)}`));
  if (!through) paths.push("No derivative in this graph was taken that way.");
  return [...first, ...paths, proof(qd, q), ...notes];
}

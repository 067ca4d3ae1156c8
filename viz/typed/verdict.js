// The verdict on a formulation: does it differ from the chain rule, by how much, and what in its graph is to blame; and lint in words.

const STATES = 24, SMALLEST = 2 ** -53; // states tried, a third of size 1, the rest from 1e-6 to 1e6; a rounding
const HOW = { by_definition: "By definition", kinetic_only: "Kinetic only", chain_rule: "By the chain rule" }; // how a sentence begins
const ENERGIES = { by_definition: "L", kinetic_only: "K" }; // what is differentiated by qd through the step
const STEP = "q = qd dt + q_old";

/** With q = qd dt + q_old in it the momentum is p + dt c, c = dE/dq of E = L or K, so its rate has c besides at every dt.
 * It is the torque of the chain rule if and only if c is 0 at every state. Words are those of the library's verdict.py. */
function verdict(system, formulation) {
  const graph = inverseDynamics(system, formulation), energy = ENERGIES[formulation], slope = `d${energy}/dq`, begin = `${HOW[formulation]}, the torque is`;
  const taken = energy === "K" ? [`K is ${system.kinetic ? "the line T" : "E - P, the energy less that at rest"}.`] : [];
  const alike = (reason) => ({ formulation, graph, energy: energy ?? "L", differs: false, sentence: `${begin} right: ${reason}.`, lines: [`${begin} right: ${reason}.`, ...taken],
    nodes: new Set(), edges: [], off: [], missing: [], why: "", lacking: "", taken });
  if (!energy) return alike("every derivative in it is taken at independent q and qd");
  const build = new Builder(), [from] = folded([THROUGH_STEP[formulation](system)], build);
  const c = folded(cotangents(new Map([[from, ONE()]]), system.q, build));
  if (c.every(({ value }) => value === 0)) {
    return alike(`${energy === "L" ? "L" : "the mass matrix"} does not depend on q, ${slope} is 0, and the derivative through ${STEP} adds nothing`);
  }
  const { at, finite, excess } = stateOf(system, c);
  if (finite && !excess.length) return alike(`${slope} is 0 to rounding at all ${finite} states tried, though its form does not prove it`);
  if (!finite) {
    const sentence = `${begin} not shown to be right: ${slope} is finite at none of the ${STATES} states tried.`;
    return { ...alike(""), differs: true, sentence, lines: [sentence, ...taken] };
  }
  const names = displayNames(system), { nodes, edges, cancelled, marked, through } = blame(system, formulation, graph);
  const [wrong, right] = [1, 0].map((factor) => torquesAt(marked, new Map([...at, ["dt", 0], [through.name, factor]])));
  const off = excess.map(([i]) => `tau${i}`), called = off.map((name) => names.get(name));
  const used = new Set(topological(off.map((name) => graph.outputs.get(name))).map(({ name }) => name?.replace("_old", "")));
  const shown = [...system.q, ...system.qd, ...system.qdd, ...system.extra].filter(({ name }) => used.has(name));
  const where = shortList(shown.map(({ name }) => `${names.get(name) ?? name}=${sixDigits(at.get(name))}`));
  const term = (i, value, sign) => `${sign < 0 ? "-" : ""}${slope}.${system.coordinates[i]} = ${sixDigits(sign * value)}`;
  const values = excess.map(([i, value], k) => `  ${called[k]} is ${sixDigits(wrong.get(`tau${i}`))}, by the chain rule ${sixDigits(right.get(`tau${i}`))}: off by ${term(i, value, 1)}`);
  const missing = excess.filter(([i]) => cancelled.has(`tau${i}`)), gone = missing.map(([i, value]) => term(i, value, -1));
  const lacking = missing.length ? `In ${shortList(missing.map(([i]) => names.get(`tau${i}`)))} nothing spurious is left to be marked: a right term is gone with it. `
    + `${shortList(gone)} ${gone.length > 1 ? "are" : "is"} missing.` : "";
  const why = `Why: the derivative by qd went through ${STEP}. That adds dt ${slope} to the momentum and ${slope} to its rate, `
    + `which cancels the -${slope} of Lagrange's equation.`;
  const terms = off.length > 1 ? `${shortList(called, NAMED)} are off, each by its ${slope}` : `${called[0]} is off by ${slope}.${system.coordinates[excess[0][0]]}`;
  const lines = [`${begin} wrong at every dt, however small. At ${where}:`, ...values, why,
    ...(edges.length ? [`${spuriousText(graph.nodes.length, nodes.size, edges.length)}.`] : []), ...(lacking ? [lacking] : []), ...taken];
  return { formulation, graph, energy, differs: true, sentence: `${begin} wrong at every dt, however small: ${terms}.`, lines, nodes, edges,
    off, missing: missing.map(([i]) => `tau${i}`), why, lacking, taken };
}

const SHOWN = 6, NAMED = 3; // texts that a list shows, and names in a sentence
const shortList = (texts, most = SHOWN) => (texts.length > most ? [...texts.slice(0, most), `and ${texts.length - most} more`] : texts).join(", ");
const sixDigits = (value) => String(+value.toPrecision(6));

/** Words on how many edges and nodes of a graph of so many nodes are spurious. */
function spuriousText(nodes, spurious, edges) {
  const serve = `${spurious} of ${nodes} node${nodes === 1 ? "" : "s"} that serve${spurious === 1 ? "s" : ""} nothing else`;
  return `Spurious: ${edges} edge${edges === 1 ? "" : "s"}, and ${spurious ? serve : "no node"}`;
}

/** A function from values of inputs to the values of nodes, and bounds of their rounding. */
function bounded(inner, inputs) {
  const { number, ...arrays } = numbered(inner, inputs), graph = { ops: opsOf(arrays), args: argsOf(arrays) }, run = evaluator(arrays);
  const rounded = inner.map(({ op, args, value }) => SMALLEST * (args.length ? ROWS[op].rounding : value === null ? 1 : 0));
  return (given) => {
    const values = run(given), errors = errorBounds(graph, slopesAt(graph, values), rounded.map((each, i) => each * Math.abs(values[i])));
    return (node) => [values[number.get(node)], errors[number.get(node)]];
  };
}
/** Outputs of a graph, {name: value}; what rounding alone made is 0. */
function torquesAt(graph, at) {
  const found = bounded(graph.nodes, graph.inputs)(graph.inputs.map(({ name }) => at.get(name.replace("_old", ""))));
  return new Map([...graph.outputs].map(([name, node]) => { const [value, error] = found(node); return [name, Math.abs(value) >= 10 * error ? value : 0]; }));
}

/** The first state at which c is not 0, else the last, with accelerations; at how many it was finite; and c there, [[i, value]]. */
function stateOf(system, c) {
  const inputs = [...system.q, ...system.qd, ...system.extra], find = bounded(topological(c), inputs);
  let seed = 20250814, finite = 0, at, excess = [];
  const random = () => { seed = (seed * 16807) % 2147483647; return seed / 2147483647; }; // the same on every page
  for (let k = 0; k < STATES && !excess.length; k++) {
    at = new Map(inputs.map(({ name }) => {
      const size = k < STATES / 3 ? 1 : 10 ** (12 * random() - 6), x = size * (k % 2 ? random() : 2 * random() - 1); // a root or a logarithm needs k % 2
      return [name, system.parameters.get(name) ?? +x.toPrecision(3)];
    }));
    const found = c.map(find([...at.values()]));
    if (!found.every(([value]) => Number.isFinite(value))) continue;
    finite += 1;
    excess = found.flatMap(([value, error], i) => (value && Math.abs(value) >= 10 * error ? [[i, value]] : []));
  }
  system.qdd.forEach(({ name }) => at.set(name, +(2 * random() - 1).toPrecision(3)));
  return { at, finite, excess };
}

/** What of the graph is there by the derivative through the step: nodes that serve nothing else, edges [source, target] by
 * which it enters the rest, outputs that have no such edge left, since folding took it away together with a right one.
 * All that comes through the step is multiplied by a variable. What folds to 0 when that is 0 is wrong, and the edges that
 * lead out of it are to blame; at 1 the graph is the formulation's, node by node. */
function blame(system, formulation, graph) {
  const through = variable("through the step"), derived = inverseDynamics(system, formulation, through);
  const marked = graphOf([...derived.inputs, through], derived.outputs);
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
    marked, through,
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
function lint(system, { graph, lines, energy }) {
  const names = displayNames(system), shown = (name) => names.get(name) ?? name;
  const byName = new Map([...graph.inputs, ...graph.nodes].filter(({ name }) => name).map((node) => [node.name, node]));
  const group = (nodes) => nodes.map(({ name }) => byName.get(name)).filter(Boolean);
  const q = group(system.q), qd = group(system.qd), called = (nodes) => joined(nodes.map(({ name }) => shown(name)));
  const used = new Set(graph.nodes), unused = graph.inputs.filter((node) => !used.has(node));
  const notes = unused.map(({ name }) => `Note: Nothing uses the input ${shown(name)}.`);
  if (!q.length || !qd.length) return [...lines, ...notes];
  const proof = (nodes, on) => {
    const start = `Holds: no path leads from ${called(on)} to ${called(nodes)}`;
    if (!nodes.some((node) => node.args.length)) return `${start}: ${called(nodes)} ${nodes.length > 1 ? "are inputs" : "is an input"}.`;
    const reached = new Set(topological(nodes));
    return `${start}, made from ${called(graph.inputs.filter((node) => reached.has(node)))} alone.`;
  };
  if (!q[0].args.length) return [...lines, proof(q, qd), proof(qd, q), ...notes];
  const targets = graph.nodes.filter((node) => q.includes(node));
  const edges = targets.map((node) => [byName.get(node.name.replace("q", "qd")), node]);
  const through = graph.nodes.some(({ label }) => label & COUPLING && label & ADJOINT);
  const texts = edges.map(([from, to]) => `${shown(from.name)} * dt -> ${shown(to.name)}`), width = Math.max(...texts.map((text) => text.length));
  const paths = [`${called(targets)} ${verb(targets, "depend")} on ${called(edges.map(([from]) => from))}. Without ${edges.length > 1 ? `these ${edges.length} edges` : "this edge"} there is no path:`];
  edges.forEach(([from, to], i) => paths.push(
    `  ${texts[i].padEnd(width)}  through it d${energy}/d${shown(from.name)} ${through ? "gains" : "would gain"} dt * d${energy}/d${shown(to.name)}`));
  if (!through) paths.push("No derivative in this graph was taken that way.");
  return [...lines, ...paths, proof(qd, q), ...notes];
}

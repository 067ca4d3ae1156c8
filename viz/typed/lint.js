// Lint: is a graph that of the chain rule, and are its coordinates and velocities independent? A proof, or the blame.

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

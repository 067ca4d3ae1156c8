// Lint: are coordinates and velocities independent of one another in a graph? A proof, or what is to blame, in words.

const joined = (words) => (words.length > 1 ? `${words.slice(0, -1).join(", ")} and ${words.at(-1)}` : words[0] ?? "");
const verb = (subjects, word) => (subjects.length > 1 ? word : `${word}s`);

/** What people call the inputs and outputs of a graph: {q0: q.theta}. */
function displayNames({ coordinates }) {
  const kinds = [["q", ""], ["q", "_old"], ["qd", ""], ["qd", "_old"], ["qdd", ""], ["tau", ""]];
  return new Map(coordinates.flatMap((name, i) => kinds.map(([kind, old]) => [`${kind}${i}${old}`, `${kind}${old}.${name}`])));
}

/** Sentences as `cg.lint` has them, for a graph of inverse dynamics, and whether all is well. */
function lint(system, graph, wrong = spuriousNodes(graph)) {
  const names = displayNames(system), shown = (name) => names.get(name) ?? name;
  const byName = new Map([...graph.inputs, ...graph.nodes].filter(({ name }) => name).map((node) => [node.name, node]));
  const group = (nodes) => nodes.map(({ name }) => byName.get(name)).filter(Boolean);
  const q = group(system.q), qd = group(system.qd), called = (nodes) => joined(nodes.map(({ name }) => shown(name)));
  const used = new Set(graph.nodes), unused = graph.inputs.filter((node) => !used.has(node));
  const notes = unused.map(({ name }) => `Note: Nothing uses the input ${shown(name)}.`);
  if (!q.length || !qd.length) return { ok: true, lines: [`Holds: the equations have no ${qd.length ? "coordinates" : "velocities"}.`, ...notes] };
  const proof = (nodes, on) => {
    const start = `Holds: no path leads from ${called(on)} to ${called(nodes)}`;
    if (!nodes.some((node) => node.args.length)) return `${start}: ${called(nodes)} ${nodes.length > 1 ? "are inputs" : "is an input"}.`;
    const reached = new Set(topological(nodes));
    return `${start}, made from ${called(graph.inputs.filter((node) => reached.has(node)))} alone.`;
  };
  if (!q[0].args.length) return { ok: true, lines: [proof(q, qd), proof(qd, q), ...notes] };
  const targets = graph.nodes.filter((node) => q.includes(node));
  const edges = targets.map((node) => [byName.get(node.name.replace("q", "qd")), node]);
  const through = graph.nodes.filter(({ label }) => label & COUPLING && label & ADJOINT);
  const texts = edges.map(([from, to]) => `${shown(from.name)} * dt -> ${shown(to.name)}`), width = Math.max(...texts.map((text) => text.length));
  const lines = [`${called(targets)} ${verb(targets, "depend")} on ${called(edges.map(([from]) => from))}. Without ${edges.length > 1 ? `these ${edges.length} edges` : "this edge"} there is no path:`];
  edges.forEach(([from, to], i) => lines.push(
    `  ${texts[i].padEnd(width)}  through it dL/d${shown(from.name)} ${through.length ? "gains" : "would gain"} dt * dL/d${shown(to.name)}`));
  if (through.length) {
    const after = new Set(through);
    for (const node of graph.nodes) if (node.args.some((arg) => after.has(arg))) after.add(node);
    const outputs = [...graph.outputs].filter(([, node]) => after.has(node)).map(([name]) => shown(name));
    const alone = `${wrong.size} node${wrong.size === 1 ? "" : "s"} of ${graph.nodes.length} ${wrong.size > 1 ? "serve" : "serves"} nothing else.`;
    lines.push(`${joined(outputs)} ${verb(outputs, "contain")} what was gained; ${alone}`);
  } else lines.push("No derivative in this graph was taken that way.");
  return { ok: false, lines: [...lines, proof(qd, q), ...notes] };
}

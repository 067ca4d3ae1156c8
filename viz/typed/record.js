// What the inspector is handed of a system: its graphs as viz/inspector/record.py describes them, one state, a motion.

const LONGEST = 42; // letters of a name for which a box has room

/** A name in mathematical letters: theta1 is θ₁. */
const pretty = (name) => name.replace(/(?<![A-Za-z0-9])([A-Za-z]+)([0-9]*)(?![A-Za-z0-9])/g, (_, word, digits) => (
  (LETTERS[word] ?? word) + [...digits].map((each) => "₀₁₂₃₄₅₆₇₈₉"[each]).join("")));

/** Inverse dynamics by all formulations, or forward dynamics, along a motion. */
function recordOf(system, motion, forward) {
  const graphs = forward ? [["forward dynamics", accelerations(system), null]]
    : FORMULATIONS.map((name) => { const found = verdict(system, name); return [name, found.graph, found]; });
  const derived = forward ? null : earlier(system), computed = new Set(derived?.outputs.keys());
  const places = placesOf(system), shownGraphs = [...graphs.map(([, graph]) => graph), ...(places ? [places] : [])];
  const needed = [...(derived?.inputs ?? []), ...shownGraphs.flatMap((graph) => graph.inputs)].map(({ name }) => name);
  const inputs = [...new Set(needed)].filter((name) => !computed.has(name));
  const letters = lettersOf(system);
  const known = new Set(graphs.flatMap(([, graph]) => [...graph.inputs, ...graph.nodes]).map(({ name }) => name));
  graphs.forEach(([, graph]) => [...graph.outputs.keys()].forEach((name) => known.add(name)));
  return {
    title: "Your Lagrangian", introduction: "",
    notices: noticesOf(system, motion),
    called: [...displayNames(system)].filter(([name]) => known.has(name)),
    units: [["t", "s"], ["dt", "s"]].filter(([name]) => known.has(name)),
    inputs, rows: rowsOf(system, motion, inputs), columns: [], tables: [],
    derived: derived && listed(derived, letters),
    versions: graphs.map(([name, graph, found]) => versionOf(name, graph, letters, found)),
    motion: motion.error ? null : { ...shownMotion(motion), joints: [], places: places && listed(places, letters) },
  };
}

function accelerations(system) {
  const graph = forwardDynamics(system);
  return graphOf(graph.inputs, new Map([...graph.outputs].filter(([name]) => name.startsWith("qdd"))));
}
/** The state that embedded formulations start from: q - dt qd and qd - dt qdd. */
function earlier({ q, qd, qdd }) {
  const dt = variable("dt"), back = (kind, from, rates) => from.map((x, i) => [`${kind}${i}_old`, sub(x, mul(dt, rates[i]))]);
  return graphOf([...q, ...qd, ...qdd, dt], new Map([...back("q", q, qd), ...back("qd", qd, qdd)]));
}
/** What the picture shows of a name: what a person calls it, of a long one the ends; without one, its letters. */
function lettersOf(system) {
  const called = displayNames(system), ends = LONGEST / 2, whole = (text) => (text.length <= LONGEST ? text : `${text.slice(0, ends)}…${text.slice(1 - ends)}`);
  return (name) => (called.has(name) ? whole(called.get(name)) : pretty(name));
}

function listed(graph, letters) {
  const { number, ...arrays } = numbered(graph.nodes, graph.inputs);
  return {
    ...arrays,
    names: Object.fromEntries(graph.nodes.map((node, i) => [i, node.name]).filter(([, name]) => name).map(([i, name]) => [i, [name, letters(name)]])),
    outputs: [...graph.outputs].map(([name, node]) => [name, letters(name), number.get(node)]),
  };
}
function versionOf(name, graph, letters, found) {
  const { nodes: wrong, edges, differs, off } = found ?? { nodes: new Set(), edges: [], differs: false, off: [] }, kinds = new Map();
  const number = new Map(graph.nodes.map((node, i) => [node, i]));
  const label = graph.nodes.map((node) => {
    const kind = [tagNames.filter((_, i) => node.label & (16 << i)), roleOf(node), stageOf(node)], key = JSON.stringify(kind);
    if (!kinds.has(key)) kinds.set(key, { i: kinds.size, kind });
    return kinds.get(key).i;
  });
  return {
    name: name.replace("_", " "), about: aboutOf(graph, found), ...listed(graph, letters), label, labels: [...kinds.values()].map(({ kind }) => kind),
    marked: graph.nodes.flatMap((node, i) => (wrong.has(node) ? [i] : [])), steps: [], flawed: differs, off,
    blamed: edges.map((edge) => edge.map((node) => number.get(node))),
  };
}
function roleOf({ args, value, label }) {
  if (!args.length) return value === null ? "input" : "constant";
  const found = [[PRIMAL, "primal"], [ADJOINT, "adjoint"], [TANGENT, "tangent"]].filter(([role]) => label & role);
  return found.length > 1 ? "several" : found[0]?.[1] ?? "primal";
}
function stageOf({ label }) {
  if (label & PRIMAL || !(label & (ADJOINT | TANGENT))) return "as written";
  return label & ADJOINT ? (label & TANGENT ? "both sweeps" : "reverse sweep") : "forward sweep";
}
function aboutOf({ nodes }, found) {
  if (!found) return `Accelerations from torques: the mass matrix is derived and eliminated, ${nodes.length} nodes.`;
  const { differs, nodes: wrong, edges, sentence, why, lacking, taken } = found;
  if (!differs) return `${[sentence, ...taken].join(" ")} Nothing else drives the joints here: the torques should be 0.`;
  return [sentence, why, ...(edges.length ? [`${spuriousText(nodes.length, wrong.size, edges.length)}.`] : []), lacking, ...taken].filter(Boolean).join(" ");
}
function noticesOf(system, motion) {
  if (motion.error) return [motion.error];
  const why = { "at rest": `At rest nothing moves, so all coordinates start at ${AWAY}`,
    past: `At 0 the accelerations are not finite, so all coordinates start at ${AWAY}, their rates at ${AWAY} and -${AWAY} in turn` }[motion.moved];
  const rest = why ? [`${why}; for another start write ${system.coordinates[0]}(0) = ....`] : [];
  if (!motion.stopped) return rest;
  const last = motion.t.at(-1).toPrecision(3);
  return [...rest, `The motion is shown up to ${last} s of ${system.time} s: from there half the step changes it by more than ${100 * UNSURE} %.`];
}
/** Values of the inputs at all instants; without a motion at the start, at rest. */
function rowsOf(system, motion, inputs) {
  const still = { t: [0], q: [system.start.q], qd: [system.start.qd], qdd: [system.q.map(() => 0)] };
  const { t, q, qd, qdd } = motion.error ? still : motion;
  return t.map((instant, k) => {
    const values = new Map([...system.parameters, ["dt", DT], ["t", instant]]);
    system.q.forEach((_, i) => [["q", q], ["qd", qd], ["qdd", qdd]].forEach(([kind, table]) => values.set(`${kind}${i}`, table[k][i])));
    return inputs.map((name) => values.get(name) ?? 0);
  });
}
/** The origin and the points as a graph of the state, which shows them where a person changes it. */
function placesOf({ q, qd, extra, points }) {
  const named = points.flatMap(([x, y], i) => [[`x${i + 1}`, x], [`y${i + 1}`, y]]);
  return points.length ? graphOf([...q, ...qd, ...extra], new Map([["x0", constant(0)], ["y0", constant(0)], ...named])) : null;
}
/** The origin and the points, where there are any. */
function shownMotion({ t, points }) {
  return points[0].length ? { t, points: points.map((frame) => [[0, 0], ...frame]), parents: rods(points) } : { t, points: null, parents: [] };
}

// Causes of an output, or of how it depends on a node: parts by cause and body that add up to it, as numbers.

/** d node / d x for every node, from {node: d node / d x} of a few: a forward sweep; zero wins. */
function tangentsOf({ args }, slopes, seeds) {
  const dots = new Float64Array(args.length);
  args.forEach((each, node) => {
    dots[node] = seeds.get(node) ?? each.reduce((sum, arg, slot) => sum + VALUE.zero_safe_mul(dots[arg], slopes[node][slot]), 0);
  });
  return dots;
}

const LEAST = 1e-13; // of the largest number of all outputs: what is smaller is rounding, and told as 0

/** {output: number} of a graph of the state; with `by`, a node of the version, the derivatives by it; null where it comes after the state. */
function numbersOf(app, graph, by) {
  const values = app.state.evaluate(graph);
  let found = values;
  if (by >= 0) {
    const { version } = app, ahead = tangentsOf(version, app.partials(), new Map([[by, 1]]));
    const named = new Map([...Object.entries(version.names).map(([node, [name]]) => [name, +node]), ...version.inputs]);
    const seeds = graph.inputs.map(([name, node]) => [node, named.has(name) ? ahead[named.get(name)] : 0]).filter(([, dot]) => dot);
    if (!seeds.length) return null;
    found = tangentsOf(graph, slopesAt(graph, values), new Map(seeds));
  }
  return new Map(graph.outputs.map(([name, , node]) => [name, found[node]]));
}

const SPURIOUS = "spurious", STEP = "step of dt"; // as `dynamics.torque_by_cause` calls them

/** [[cause, its part of an output, or of its derivative by a node]]; null where there are none to tell. */
function causesOf(app, output, by, whole) {
  const { causes } = app.state, row = causes?.rows.find(([name]) => name === output);
  const found = row && numbersOf(app, causes, by);
  if (!found) return null;
  const parts = causes.header.map((cause, i) => [cause, found.get(causes.outputs[row[1][i]][0])]);
  const { excess } = app.version, least = LEAST * largestOf([...found.values()]);
  if (excess) {
    parts.push([SPURIOUS, numbersOf(app, excess, by)?.get(output) ?? 0]);
    parts.push([STEP, whole - addedUp(parts)]); // it vanishes with dt
  }
  return parts.map(([cause, part]) => [cause, Math.abs(part) > least ? part : 0]);
}

const causeIn = (name) => name.split(/ of (?!dt$)| on /)[0]; // "gravity" of "gravity of link 2"
const addedUp = (parts) => parts.reduce((sum, [, part]) => sum + part, 0);
const sizeOf = (parts) => parts.reduce((sum, [, part]) => sum + Math.abs(part), 0);

/** Parts by cause, the largest first, [[cause, part, [[body, part]]]], without what is rounding. */
function groupedCauses(parts) {
  const least = LEAST * sizeOf(parts), groups = new Map();
  for (const [name, part] of parts) {
    if (!(Math.abs(part) > least)) continue;
    const cause = causeIn(name);
    if (!groups.has(cause)) groups.set(cause, []);
    groups.get(cause).push([name.slice(cause.length).trim(), part]);
  }
  return [...groups].map(([cause, bodies]) => [cause, addedUp(bodies),
    bodies.sort((one, other) => Math.abs(other[1]) - Math.abs(one[1]))]).sort((one, other) => Math.abs(other[1]) - Math.abs(one[1]));
}

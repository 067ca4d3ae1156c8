// Graphs made ready for the page, what rounding makes of their values, and the one state: inputs by name, from which all follows.

/** A graph made ready: constants as numbers, uses of each node, edges in the order of evaluation, numbers as listed. */
function prepare(version) {
  const ops = opsOf(version), args = argsOf(version);
  const constants = new Map(version.nodes.flatMap((node, i) => (ops[i] === "constant" ? [[i, Number(node)]] : [])));
  const users = args.map(() => []);
  const edges = [];
  args.forEach((own, target) => own.forEach((source, slot) => {
    users[source].push(target);
    edges.push([source, target, slot]);
  }));
  let operations = 0;
  const number = args.map((own) => (own.length ? ++operations : 0)); // as in Graph.listing(): %1 is the first operation
  const byNumber = new Map(number.map((each, node) => [each, node]).filter(([each]) => each));
  return { ...version, excess: version.excess ? prepare(version.excess) : null, run: evaluator(version), ops, args, constants, users, edges, number, byNumber, operations, marked: new Set(version.marked),
    off: new Set(version.off), crossed: new Set((version.blamed ?? []).map(([source, target]) => `${source} ${target}`)) };
}

const ROUNDING = 2 ** -53; // relative error of a rounded number

/** The errors that the nodes of a version make: of constants none, of inputs those of the state, else of a rounded number. */
function ownErrors({ constants, inputs }, values, errors) {
  const given = new Map(inputs.map(([, node], i) => [node, errors[i]]));
  return values.map((value, node) => (constants.has(node) ? 0 : given.get(node) ?? ROUNDING * Math.abs(value)));
}

/** Bounds, with those of faint outputs from their adjoints: ways from a node count with their signs, not their sizes.
 *
 * Along a long elimination the sizes of all ways grow without end, and what they add up to does not. */
function sharpened(version, slopes, values, bounds, own) {
  const sharp = bounds.slice();
  for (const [, , output] of version.outputs) {
    if (!(Math.abs(values[output]) <= bounds[output])) continue;
    const sum = adjoints(version, slopes, output).reduce((all, bar, node) => (bar === 0 ? all : all + Math.abs(bar) * own[node]), 0);
    if (sum < bounds[output]) sharp[output] = sum;
  }
  return sharp;
}

const GROWN = 2 ** 12; // how many times larger rounding becomes along a motion
const KINDS = /^(qdd|qd|q|tau|lambda|p)\d+(_old|_dot)?$/; // of inputs and outputs: letters with a number

/** The state of a record, and its graphs made ready.  told: called whenever a value has changed. */
function makeState(record, told = () => {}) {
  const groups = record.versions.map(({ group }) => group ?? "");
  const versions = record.versions.map((each, i) => ({ ...prepare(each), at: i, group: groups[i], index: groups.slice(0, i).filter((own) => own === groups[i]).length })), tables = (record.tables ?? []).map(prepare);
  const causes = record.causes ? prepare(record.causes) : null;
  const derived = record.derived ? prepare(record.derived) : null;
  const called = new Map(record.called), meant = new Map(record.called.map(([name, text]) => [text, name]));
  const solved = (graph) => graph.inputs.some(([name]) => KINDS.exec(name)?.[1] === "qdd");
  let frame = 0, edited = false, values = null;

  /** All values by name, derived ones too. */
  function settle(given) {
    values = new Map(given);
    if (!derived) return;
    const found = derived.run(rowOf(derived));
    for (const [name, , node] of derived.outputs) values.set(name, found[node]);
  }
  /** Errors of a graph's inputs. A state with accelerations was solved for: errors of one kind are those of the largest,
   * times their number, as of a linear system that is solved with rounding. Any other state is as it stands. */
  function errorsOf(graph) {
    if (!solved(graph)) return graph.inputs.map(([name]) => ROUNDING * Math.abs(values.get(name)));
    const grown = edited || !frame ? 1 : GROWN, most = new Map(), kind = (name) => KINDS.exec(name)?.[1] ?? name;
    for (const [name, value] of values) {
      const [largest, many] = most.get(kind(name)) ?? [0, 0];
      most.set(kind(name), [Math.max(largest, Math.abs(value)), many + 1]);
    }
    return graph.inputs.map(([name]) => { const [largest, many] = most.get(kind(name)); return grown * ROUNDING * many * largest; });
  }
  const rowOf = (graph) => graph.inputs.map(([name]) => values.get(name));
  const atFrame = () => record.inputs.map((name, i) => [name, record.rows[frame][i]]);

  function set(given) {
    const next = new Map(record.inputs.map((name) => [name, values.get(name)]));
    for (const [who, value] of Object.entries(given)) {
      const name = next.has(who) ? who : meant.get(who) ?? who;
      if (!next.has(name)) {
        throw new Error(values.has(name) ? `${who} follows from ${derived.inputs.map(([each]) => each).join(", ")}: set these`
          : `the state has no input ${who}`);
      }
      if (typeof value !== "number" || !Number.isFinite(value)) throw new Error(`${who} needs a finite number, got ${value}`);
      next.set(name, value);
    }
    edited = true;
    settle(next);
    told();
  }
  function show(at) {
    frame = at;
    edited = false;
    settle(atFrame());
    told();
  }
  settle(atFrame());
  return {
    versions, tables, causes, derived, called, solved, errorsOf, set, show, names: record.inputs,
    get frame() { return frame; },
    get edited() { return edited; },
    get: (name) => values.get(name),
    changed: () => Object.fromEntries(atFrame().flatMap(([name, value]) => (values.get(name) === value ? [] : [[name, values.get(name)]]))),
    values: () => Object.fromEntries(values),
    evaluate: (graph) => graph.run(rowOf(graph)).slice(),
  };
}

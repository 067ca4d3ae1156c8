// Numbers: values of nodes, and a motion by Runge and Kutta with as many steps as its error asks for.

const FRAMES = 150, WORK = 2e7, OVERHEAD = 60; // instants; operations at most, and those that a rate takes beside its own
const AWAY = 0.5; // where coordinates start that would rest, as nobody said where
const TOLERANCE = 1e-6, UNSURE = 1e-2; // relative change by halving the step that is little enough, and too much to be shown

/** A function from numbers of the inputs, in order, to numbers of some nodes. */
function compiled(inputs, nodes) {
  const order = topological(nodes), { number, ...graph } = numbered(order, inputs), evaluated = evaluator(graph);
  const out = nodes.map((node) => number.get(node));
  const run = (values) => { const found = evaluated(values); return out.map((i) => found[i]); };
  run.size = order.filter(({ args }) => args.length).length;
  return run;
}

/** The free motion of a system from its start: instants, states, accelerations, energies, points, and how exact it is. */
function motionOf(system, parameters = system.parameters) {
  const n = system.q.length, graph = forwardDynamics(system);
  const run = compiled(graph.inputs, [...graph.outputs.values()]), draw = compiled(graph.inputs, system.points.flat());
  const values = Float64Array.from(graph.inputs, ({ name }) => parameters.get(name) ?? 0), time = graph.inputs.indexOf(system.t);
  const at = (state, t) => {
    values.set(state);
    if (time >= 0) values[time] = t;
    return values;
  };
  const start = Float64Array.of(...system.start.q, ...system.start.qd);
  let first = run(at(start, 0)), moved = "";
  if (!system.start.said && !first.slice(0, n).some((qdd) => Number.isFinite(qdd) && qdd)) { // at rest nothing is to be seen
    moved = first.slice(0, n).every(Number.isFinite) ? "at rest" : "past";
    start.fill(AWAY, 0, n);
    if (moved === "past") for (let i = 0; i < n; i++) start[n + i] = i % 2 ? -AWAY : AWAY; // from rest it would fall into such a place
    first = run(at(start, 0));
  }
  const infinite = system.coordinates.find((_, i) => !Number.isFinite(first[i]));
  if (infinite && first.slice(n, 2 * n).every((pivot) => pivot > 0)) return { error: `At the start the acceleration of ${infinite} is not finite.` };
  const singular = system.coordinates.findLast((_, i) => !(first[n + i] > 0));
  if (singular) return { error: `At the start ${singular} has no inertia left: the mass matrix is not positive definite.` };
  const rate = (state, t) => [...state.subarray(n), ...run(at(state, t)).slice(0, n)];
  const most = WORK / (run.size + OVERHEAD) / 4 / FRAMES;
  let each = 1, states = integrate(rate, start, system.time, each), sure;
  do {
    each *= 2;
    const finer = integrate(rate, start, system.time, each);
    sure = difference(states, finer);
    states = finer;
  } while (each * 2 <= most && !(sure.change < TOLERANCE));
  states.length = sure.frames;
  const t = states.map((_, k) => (system.time * k) / (FRAMES - 1)), rows = states.map((state, k) => run(at(state, t[k])));
  return {
    t, q: states.map((state) => [...state.slice(0, n)]), qd: states.map((state) => [...state.slice(n)]), qdd: rows.map((row) => row.slice(0, n)),
    energy: rows.map((row) => row[2 * n]), steps: each * (FRAMES - 1), change: sure.change, stopped: states.length < FRAMES, moved,
    points: states.map((state, k) => { const all = draw(at(state, t[k])); return system.points.map((_, i) => all.slice(2 * i, 2 * i + 2)); }),
  };
}
/** States at the frames by RK4 with so many steps a frame, as far as they are finite. */
function integrate(rate, start, time, each) {
  const h = time / (FRAMES - 1) / each, states = [start];
  let x = start;
  for (let frame = 1; frame < FRAMES; frame++) {
    for (let step = 0; step < each; step++) x = rk4(rate, x, ((frame - 1) * each + step) * h, h);
    if (!x.every(Number.isFinite)) break;
    states.push(x);
  }
  return states;
}
/** How far two motions differ, over the frames where that is little: beside the largest value that an entry has had,
 * and at least a millionth of the largest of its kind, since an entry may be rounding alone. */
function difference(coarse, fine) {
  const sizes = new Float64Array(fine[0].length), n = sizes.length / 2;
  let change = 0, frames = 0;
  for (; frames < Math.min(coarse.length, fine.length); frames++) {
    fine[frames].forEach((value, i) => { sizes[i] = Math.max(sizes[i], Math.abs(value)); });
    const least = [sizes.slice(0, n), sizes.slice(n)].map((kind) => 1e-6 * Math.max(...kind));
    const off = sizes.map((size, i) => Math.abs(fine[frames][i] - coarse[frames][i]) / Math.max(size, least[i < n ? 0 : 1]) || 0);
    const most = Math.max(...off);
    if (!(most < UNSURE)) return { frames, change: Infinity };
    change = Math.max(change, most);
  }
  return { frames, change: frames < FRAMES ? Infinity : change };
}

/** For each point the earlier one that it keeps its distance from, nearest in the list first; -1 for none. 0: the origin. */
function rods(points) {
  const places = points.map((frame) => [[0, 0], ...frame]);
  const length = (k, i, j) => Math.hypot(places[k][i][0] - places[k][j][0], places[k][i][1] - places[k][j][1]);
  return places[0].map((_, i) => {
    for (let j = i - 1; j >= 0; j--) {
      const first = length(0, i, j);
      if (first && places.every((_, k) => Math.abs(length(k, i, j) - first) < TOLERANCE * first)) return j;
    }
    return -1;
  });
}

// Equations of motion of a system: three formulations of inverse dynamics, forward dynamics, energy.

const DT = 1e-3; // s, the step that the embedded formulations take
const ONE = () => constant(1);
const pairs = (keys, values) => new Map(keys.map((key, i) => [key, values[i]]));

/** By the chain rule: d/dt p for p = dL/dqd along (qd, qdd), one reverse sweep and one forward. */
function chainRule(system) {
  const { q, qd, qdd } = system, build = new Builder();
  const bars = cotangents(new Map([[system.lagrangian, ONE()]]), [...q, ...qd], build);
  const momentum = bars.slice(q.length);
  const rate = tangents(pairs([...q, ...qd, ...timeOf(system)], [...qd, ...qdd, ONE()]), momentum, build);
  return { inputs: [...q, ...qd, ...qdd], q, qd, rate, gradient: bars.slice(0, q.length) };
}
const timeOf = (system) => system.extra.filter((node) => node === system.t);

/** By definition: dL/dqd is taken through q = qd dt + q_old, which is wrong; or of the kinetic energy alone.
 * through: a factor of all that comes through q, 1 in the formulation; at 0 the momentum is the right one. */
function embedded(system, energyOf, through) {
  const { q, qd, qdd } = system, dt = variable("dt");
  const old = (kind) => q.map((_, i) => variable(`${kind}${i}_old`)), qOld = old("q"), qdOld = old("qd");
  const step = (label, rates, from, kind) => rates.map((rate, i) => {
    const moved = within({ label, build: null }, () => mul(rate, dt));
    return new Node("add", [moved, from[i]], PRIMAL | EULER, null, `${kind}${i}`);
  });
  const qdNew = step(PRIMAL | EULER, qdd, qdOld, "qd");
  const qNew = step(PRIMAL | EULER | COUPLING, qdNew, qOld, "q");
  const replace = pairs([...q, ...qd], [...qNew, ...qdNew]);
  // All with tags: derivatives of nodes without would take those of the relation from their arguments.
  const [lagrangian, energy] = substitute([system.lagrangian, energyOf(system)], replace, LAGRANGIAN);
  const factors = new Map(qNew.map((node) => [node, through]));
  const momentum = cotangents(new Map([[energy, ONE()]]), qdNew, new Builder(), factors); // through q as well: the unwanted coupling
  const gradient = cotangents(new Map([[lagrangian, ONE()]]), qNew);
  const rate = tangents(pairs([dt, ...timeOf(system)], [ONE(), ONE()]), momentum);
  return { inputs: [...qOld, ...qdOld, ...qdd, dt], q: qNew, qd: qdNew, rate, gradient };
}
/** What is differentiated by qd through q = qd dt + q_old, by the formulations that do that. */
const THROUGH_STEP = { by_definition: ({ lagrangian }) => lagrangian, kinetic_only: (system) => withoutPotential(system) };
const FORMULATIONS = ["by_definition", "kinetic_only", "chain_rule"];

/** L + P as the library has it: T, and what of V depends on velocities; of an L alone P is the energy at rest. */
function withoutPotential({ lagrangian, kinetic, qd }) {
  const moving = new Set(qd), stack = [[1, lagrangian]], terms = [];
  for (const node of topological([lagrangian])) if (node.args.some((arg) => moving.has(arg))) moving.add(node);
  if (kinetic) return moving.has(lagrangian.args[1]) && kinetic !== lagrangian ? lagrangian : kinetic;
  while (stack.length) {
    const [sign, node] = stack.pop();
    if (!moving.has(node)) continue;
    if (isSum(node)) stack.push([node.op === "sub" ? -sign : sign, node.args[1]], [sign, node.args[0]]);
    else if (node.op === "neg") stack.push([-sign, node.args[0]]);
    else terms.push(sign > 0 ? node : neg(node));
  }
  const build = new Builder(), whole = terms.reduce((sum, term) => add(sum, term)), [energy] = folded([whole], build);
  const slopes = cotangents(new Map([[energy, ONE()]]), qd, build);
  const [rest, ...linear] = folded([energy, ...slopes], build, pairs(qd, qd.map(() => constant(0))));
  if (rest.value === 0) return whole;
  const masses = slopes.map((slope, i) => cotangents(new Map([[slope, ONE()]]), qd.slice(0, i + 1), build));
  const quadratic = !topological(masses.flat()).some((node) => qd.includes(node)) && linear.every(({ value }) => value === 0);
  return within({ build }, () => (quadratic ? masses.flatMap((row, i) => row.map((mass, j) => mul(mass, i === j ? mul(mul(0.5, qd[i]), qd[i]) : mul(qd[i], qd[j]))))
    .reduce((sum, term) => add(sum, term)) : sub(energy, rest)));
}

/** tau = d/dt dL/dqd - dL/dq + damping qd - forces, simplified. */
function inverseDynamics(system, formulation, through = ONE()) {
  const energyOf = THROUGH_STEP[formulation], terms = energyOf ? embedded(system, energyOf, through) : chainRule(system);
  const applied = terms.q === system.q ? system.forces
    : substitute(system.forces, pairs([...system.q, ...system.qd], [...terms.q, ...terms.qd]));
  const outputs = within({ build: new Builder() }, () => terms.rate.map((rate, i) => {
    const tau = sub(rate, terms.gradient[i]);
    return sub(within({ label: PRIMAL | DAMPING }, () => add(tau, mul(system.damping[i], terms.qd[i]))), applied[i]);
  }));
  return simplified(graphOf([...terms.inputs, ...system.extra], new Map(outputs.map((node, i) => [`tau${i}`, node]))));
}

/** Lower triangle of M = d2L/dqd2. */
function massMatrix({ lagrangian, qd }, build = new Builder()) {
  const momentum = cotangents(new Map([[lagrangian, ONE()]]), qd, build);
  return momentum.map((p, i) => qd.slice(0, i + 1).map((x) => tangents(new Map([[x, ONE()]]), [p], build)[0]));
}

/** qdd = M^-1 (tau - tau at qdd = 0), by elimination from the last row up; with the pivots, and the energy. */
function forwardDynamics(system) {
  const { q, qd, qdd, tau } = system, build = new Builder(), n = q.length;
  const atRest = substitute([...inverseDynamics(system, "chain_rule").outputs.values()], new Map(qdd.map((a) => [a, constant(0)])));
  const [lagrangian, ...bias] = folded([system.lagrangian, ...atRest], build);
  const a = massMatrix({ lagrangian, qd }, build), momentum = cotangents(new Map([[lagrangian, ONE()]]), qd, build);
  return within({ build }, () => {
    const b = tau.map((each, i) => sub(each, bias[i])), gain = a.map(() => []), x = [];
    for (let i = n - 1; i >= 0; i--) {
      for (let j = 0; j < i; j++) gain[i][j] = div(a[i][j], a[i][i]);
      for (let j = 0; j < i; j++) {
        for (let k = 0; k <= j; k++) a[j][k] = sub(a[j][k], mul(gain[i][j], a[i][k]));
        b[j] = sub(b[j], mul(gain[i][j], b[i]));
      }
    }
    for (let i = 0; i < n; i++) x.push(x.reduce((total, known, j) => sub(total, mul(gain[i][j], known)), div(b[i], a[i][i])));
    const energy = momentum.reduce((sum, p, i) => add(sum, mul(p, qd[i])), constant(0));
    const outputs = [...x.map((each, i) => [`qdd${i}`, each]), ...a.map((row, i) => [`pivot${i}`, row[i]]), ["E", sub(energy, lagrangian)]];
    return simplified(graphOf([...q, ...qd, ...tau, ...system.extra], new Map(outputs)));
  });
}

// From statements to a system: names get their meaning, formulas become nodes, and what cannot be is said in a sentence.

const MOST_COORDINATES = 4, MOST_NODES = 2000, TIME = 10;
const RESERVED = /^((q|qd|qdd|tau|lambda)\d+(_old)?|t|dt|pi|π)$/;
const RATE = /^(.+?)_?(d?)dot(\d*)$/;

/** The system that a text writes down. Throws TextError. */
function parse(text) {
  return new Meaning(statementsOf(text)).system();
}

class Meaning {
  constructor(statements) {
    this.statements = statements;
    this.defined = new Map();
    for (const each of statements) if (each.kind === "define" && !["damping", "tau", "time"].includes(each.name)) this.define(each);
    this.coordinates = this.findCoordinates();
    const { length } = this.coordinates;
    [this.q, this.qd, this.qdd, this.tau] = ["q", "qd", "qdd", "tau"].map((kind) => Array.from({ length }, (_, i) => variable(kind + i)));
    this.t = variable("t");
    this.parameters = new Map();
    const used = new Set(this.statements.flatMap(({ items }) => items.flat()).map(({ name }) => name));
    for (const [name, each] of this.defined) { // where a point stays, as in y1 = 0, is no parameter
      if (isNumber(each) && (used.has(name) || !this.pointNames().flat().includes(name))) this.parameters.set(name, this.number(each));
    }
  }
  define(each) {
    const { name, at, end } = each;
    if (RESERVED.test(name) || isFunction(name)) throw new TextError(`${quoted(name)} has a meaning of its own; choose another name.`, at, end);
    if (this.defined.has(name)) throw new TextError(`${quoted(name)} is defined twice.`, at, end);
    this.defined.set(name, each);
  }

  // Names

  /** A name's base and how many dots it has, where it is not itself defined: of thetadot theta and 1. */
  undotted({ name, dots }) {
    const found = !dots && !this.defined.has(name) && !this.coordinates?.includes(name) && RATE.exec(name);
    return found ? { base: found[1] + found[3], dots: found[2] ? 2 : 1 } : { base: name, dots };
  }
  /** Those of a line q:, or all that have a dot or a start somewhere and no definition. */
  findCoordinates() {
    const lists = this.statements.filter(({ kind, name }) => kind === "list" && name === "q");
    const listed = lists.flatMap(({ items }) => items.map(({ text, at, end }) => ({ name: text, at, end })));
    const used = this.statements.flatMap(({ items, kind, name }) => (kind === "list" && name === "q" ? [] : items.flat()));
    const known = [...used.filter(({ kind }) => kind === "name"), ...this.statements.filter(({ kind }) => kind === "start")];
    const bases = known.map((each) => ({ ...each, ...this.undotted(each) })).filter(({ dots, kind }) => dots || kind === "start");
    const inferred = bases.map((each) => ({ ...each, name: each.base })).filter(({ name }) => !this.defined.has(name));
    const found = new Map((listed.length ? listed : inferred).map((each) => [each.name, each]));
    for (const { name, at, end } of listed) {
      if (RESERVED.test(name) || isFunction(name)) throw new TextError(`${quoted(name)} has a meaning of its own; choose another name.`, at, end);
      if (this.defined.has(name)) throw new TextError(`${quoted(name)} is a coordinate, and no line may set it; for the start write ${name}(0) = a number.`, at, end);
    }
    if (found.size < listed.length) throw new TextError("A coordinate is listed twice.", lists[0].at, lists[0].end);
    const fifth = [...found.values()][MOST_COORDINATES];
    if (fifth) throw new TextError(`This page takes up to ${MOST_COORDINATES} coordinates, and ${quoted(fifth.name)} is one more; the library takes any number.`, fifth.at, fifth.end);
    return [...found.keys()];
  }
  /** The node or number of a name in a formula. */
  resolve(step) {
    const { at, end } = step, { base, dots } = this.undotted(step), i = this.coordinates.indexOf(base);
    const shown = quoted(step.name + "'".repeat(step.dots));
    if (dots > 1) throw new TextError(`${shown} is an acceleration; a formula may have coordinates and velocities.`, at, end);
    if (i >= 0) return (dots ? this.qd : this.q)[i];
    if (!dots && base === "t") return this.t;
    if (!dots && (base === "pi" || base === "π")) return Math.PI;
    const each = this.defined.get(base);
    if (!each) throw this.unknown(step, base, dots);
    if (!dots) return this.parameters.has(base) ? variable(base) : this.node(each);
    if (isNumber(each)) {
      throw new TextError(`${quoted(base)} is set to a number, so it has no rate; for the start write ${base}(0) = that number.`, at, end);
    }
    return this.rate(each);
  }
  unknown({ name, at, end }, base, dots) {
    const known = [...this.coordinates, ...this.defined.keys(), "t", "pi"];
    const near = nearest(base, known);
    const hint = near ? `did you mean ${near}?` : dots ? "a line q: lists all coordinates." : `a line such as ${base} = 1 gives its value.`;
    return new TextError(`There is no ${quoted(name)}: ${hint}`, at, end);
  }
  /** d/dt of a definition, as written: by its partials, along the velocities. */
  rate(each) {
    if (each.rate === undefined) {
      const node = asNode(this.node(each));
      const seeds = new Map([...this.q.map((q, i) => [q, this.qd[i]]), [this.t, constant(1)]]);
      if (topological([node]).some((inner) => this.qd.includes(inner))) {
        throw new TextError(`${quoted(each.name)} has velocities in it, so its rate would have accelerations.`, each.at, each.end);
      }
      [each.rate] = tangents(seeds, [node], new Builder(), PRIMAL);
    }
    return each.rate;
  }

  // Formulas

  /** The node or number of a definition, made once. */
  node(each) {
    if (each.busy) throw new TextError(`${quoted(each.name)} is defined by itself.`, each.at, each.end);
    if (each.value === undefined) {
      each.busy = true;
      const tag = each.name === "T" ? KINETIC : each.name === "V" ? POTENTIAL : each.name === "L" ? 0 : DEFINITION;
      each.value = this.formula(each.items[0], PRIMAL | tag);
      each.busy = false;
    }
    return each.value;
  }
  formula(steps, label = PRIMAL) {
    const stack = [];
    for (const step of steps) {
      if (step.kind === "number") stack.push(step.value);
      else if (step.kind === "name") stack.push(this.resolve(step));
      else stack.push(this.applied(step, stack.splice(-step.count), label));
    }
    return stack[0];
  }
  applied({ op, at, end }, args, label) {
    if (op === "div" && (args[1] === 0 || args[1].value === 0)) throw new TextError("Here something is divided by zero.", at, end);
    if (args.some((arg) => arg instanceof Node)) return within({ label, build: null }, () => apply(op, ...args));
    const value = VALUE[op](...args);
    if (!Number.isFinite(value)) throw new TextError("Here the numbers have no finite result.", at, end);
    return value;
  }
  /** The number of a formula that may have parameters, and nothing that moves. */
  number({ items: [steps], at, end, name }) {
    const node = asNode(this.formula(steps)), inputs = topological([node]).filter(({ op }) => op === "variable");
    if (inputs.some((input) => [...this.q, ...this.qd, this.t].includes(input))) {
      throw new TextError(`${quoted(name)} is set to a number here, and coordinates, velocities and t have none.`, at, end);
    }
    const [value] = compiled(inputs, [node])(inputs.map((input) => this.parameters.get(input.name)));
    if (!Number.isFinite(value)) throw new TextError(`${quoted(name)} has no finite value.`, at, end);
    return value;
  }

  // The system

  system() {
    const lagrangian = this.lagrangian();
    const result = {
      coordinates: this.coordinates, q: this.q, qd: this.qd, qdd: this.qdd, tau: this.tau, t: this.t,
      parameters: this.parameters, lagrangian, kinetic: this.defined.has("L") ? null : asNode(this.node(this.defined.get("T"))), start: this.start(), points: this.points(),
      damping: this.perCoordinate("damping"), forces: this.perCoordinate("tau").map(asNode),
    };
    this.defined.forEach((each) => this.node(each)); // also what nothing uses must have a meaning
    result.damping.forEach((each) => this.checkDamping(each));
    const time = this.statements.find(({ name, kind }) => kind === "define" && name === "time");
    result.time = time ? this.number(time) : TIME;
    if (!(result.time > 0)) throw new TextError("The time of a motion must be positive.", time.at, time.end);
    result.extra = topological([lagrangian, ...result.forces, ...result.points.flat()]).includes(this.t) ? [this.t] : [];
    result.extra.push(...[...this.parameters.keys()].map(variable));
    return result;
  }
  lagrangian() {
    const [whole, kinetic, potential] = ["L", "T", "V"].map((name) => this.defined.get(name));
    const last = this.statements.at(-1) ?? { at: 0, end: 1 };
    if (!whole && !kinetic) throw new TextError("There is no Lagrangian: write a line L = ..., or T = ... and V = ....", last.at, last.end);
    const node = whole ? asNode(this.node(whole)) : this.difference(kinetic, potential);
    if (!this.coordinates.length) throw new TextError("There is no coordinate: write q: x, or a velocity such as x'.", last.at, last.end);
    const { at, end } = whole ?? kinetic, reached = new Set(topological([node]));
    if (reached.size > MOST_NODES) throw new TextError(`L has ${reached.size} nodes, and this page takes up to ${MOST_NODES}.`, at, end);
    const still = this.coordinates.find((_, i) => !reached.has(this.qd[i]));
    if (still) throw new TextError(`L has no ${still}', so ${quoted(still)} has no inertia: a coordinate needs its velocity in L.`, at, end);
    return node;
  }
  difference(kinetic, potential) {
    const T = asNode(this.node(kinetic));
    return potential ? within({ label: PRIMAL, build: null }, () => sub(T, this.node(potential))) : T;
  }
  /** A formula for each coordinate, from a line for all, a list, or a line for one; else 0. */
  perCoordinate(kind) {
    const label = PRIMAL | (kind === "tau" ? FORCE : 0), found = this.coordinates.map(() => 0), { length } = found;
    for (const each of this.statements.filter((one) => one.name === kind && one.kind !== "start")) { // tau(0) is a coordinate's
      const { at, end, items } = each, of = each.of && this.coordinates.indexOf(each.of.text);
      if (of === -1) throw this.unknown({ ...each.of, name: each.of.text }, each.of.text, 1);
      if (each.kind === "list" && items.length !== length) throw new TextError(`${quoted(kind)} needs a value for each of ${this.coordinates.join(", ")}, not ${items.length}.`, at, end);
      if (kind === "tau" && each.kind === "define" && length > 1) throw new TextError(`Say on which coordinate: tau ${this.coordinates[0]} = ....`, at, end);
      const values = items.map((steps) => this.formula(steps, label));
      found.forEach((_, i) => { if (of === undefined || of === i) found[i] = values[i % values.length]; });
    }
    return found;
  }
  checkDamping(value) {
    const { at, end } = this.statements.find(({ name }) => name === "damping") ?? {};
    if (value < 0) throw new TextError("Damping must be at least 0.", at, end);
    const moving = [...this.q, ...this.qd, this.t];
    if (value instanceof Node && topological([value]).some((node) => moving.includes(node))) {
      throw new TextError("Damping must be a number or made from parameters; a force of another kind is a line tau.", at, end);
    }
  }
  start() {
    const start = { q: this.coordinates.map(() => 0), qd: this.coordinates.map(() => 0), said: false };
    for (const each of this.statements.filter(({ kind }) => kind === "start")) {
      start.said = true;
      const { base, dots } = this.undotted(each), i = this.coordinates.indexOf(base);
      if (i < 0) throw this.unknown(each, base, 1);
      if (dots > 1) throw new TextError("An acceleration has no start: it follows from the forces.", each.at, each.end);
      start[dots ? "qd" : "q"][i] = this.number(each);
    }
    return start;
  }
  pointNames() {
    const names = [...new Set([...this.coordinates, ...this.defined.keys()])];
    return names.filter((name) => name[0] === "x").map((name) => [name, `y${name.slice(1)}`]).filter(([, y]) => names.includes(y));
  }
  /** Points to draw: x and y, x1 and y1, and so on, of which one at least moves. */
  points() {
    const pairs = this.pointNames().map((pair) => pair.map((name) => this.resolve({ name, dots: 0 })));
    return pairs.filter((pair) => pair.some((each) => each instanceof Node && !this.parameters.has(each.name))).map((pair) => pair.map(asNode));
  }
}
const isNumber = ({ items: [steps] }) => steps.every(({ kind, name }) => kind !== "name" || name === "pi" || name === "π");

/** The sentence of an error with its place: the line, and where in it. */
function explained(text, error) {
  const before = text.slice(0, error.at), line = before.split("\n").length, column = error.at - before.lastIndexOf("\n") - 1;
  const source = text.split("\n")[line - 1];
  const length = Math.max(1, Math.min(error.end, error.at - column + source.length) - error.at);
  return { sentence: `Line ${line}: ${error.message}`, line, column, source, length };
}

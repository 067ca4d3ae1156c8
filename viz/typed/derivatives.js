// Forward and reverse mode over nodes, with the partials that the operation table ships as small programs.

/** The partials of a node in its arguments: the row's program, each line built as the scope says. */
const partialsOf = (node) => partials(ROWS[node.op].slopes, [node, ...node.args], apply, constant);

/** Flags of nodes that one sweep reaches through operations that select, which keep an infinity elsewhere out of it. */
class Reached {
  constructor(seeds) {
    this.flags = new Map([...seeds].map((node) => [node, null])); // what is not 0 where the sweep reaches; null: always
    this.behind = new Set();
  }
  product(op, source, a, b) {
    const row = ROWS[op];
    if (row.selects || a.value === 0 || b.value === 0) return apply("zero_safe_mul", a, b);
    const flag = this.flags.get(source) ?? null;
    const finite = [a, b].some((each) => each.value !== null && Number.isFinite(each.value));
    if (!flag || !(row.singular || this.behind.has(source)) || finite) return mul(a, b);
    return apply("where", flag, mul(a, b), 0);
  }
  passOn(op, source, target, partial) {
    let flag = this.flags.get(source) ?? null;
    const { selects } = ROWS[op];
    if (selects) flag = flag ? apply("where", flag, partial, 0) : partial;
    if (selects || this.behind.has(source)) this.behind.add(target);
    if (!this.flags.has(target)) this.flags.set(target, flag);
    const other = this.flags.get(target);
    if (other !== flag) this.flags.set(target, flag && other ? apply("where", other, 1, flag) : null);
  }
}

/** Reverse mode: the cotangents of `wrt` for seeds Map {y: y_bar}; 0 where no seed depends on one.
 * through: Map {inner node: factor} of its cotangent before that goes on. */
function cotangents(seeds, wrt, build = new Builder(), through = new Map()) {
  const order = topological(seeds.keys()), active = new Set(wrt), bars = new Map(seeds);
  for (const node of order) if (node.args.some((arg) => active.has(arg))) active.add(node);
  const reached = new Reached(seeds.keys());
  const bare = new Map(); // labels of cotangents that are constants, which carry no tags of their own
  const labelOf = (node) => withTagsOf(derived(node.label, ADJOINT), bare.get(node) ?? 0);
  within({ build }, () => {
    for (const node of order.reverse()) {
      let bar = bars.get(node);
      if (!bar || !active.has(node) || !node.args.length) continue;
      scope.label = labelOf(node);
      if (through.has(node)) bar = mul(bar, through.get(node));
      const terms = new Map(); // by argument first, so that x * x gives 2 * (bar * x)
      partialsOf(node).forEach((partial, slot) => {
        const arg = node.args[slot];
        if (!active.has(arg)) return;
        const term = reached.product(node.op, node, bar, partial);
        terms.set(arg, terms.has(arg) ? add(terms.get(arg), term) : term);
        if (term.value !== 0) reached.passOn(node.op, node, arg, partial);
      });
      for (const [arg, term] of terms) {
        if (term.value === 0) continue;
        if (term.value !== null) bare.set(arg, withTagsOf(bare.get(arg) ?? 0, node.label));
        if (bars.has(arg)) scope.label = labelOf(arg); // the sum over all uses of arg is about arg
        bars.set(arg, bars.has(arg) ? add(bars.get(arg), term) : term);
      }
    }
  });
  return wrt.map((node) => bars.get(node) ?? constant(0));
}

/** Forward mode: the tangents of `outputs` for seeds Map {x: x_dot}. role: of the nodes made. */
function tangents(seeds, outputs, build = new Builder(), role = TANGENT) {
  const dots = new Map(seeds), reached = new Reached(seeds.keys());
  within({ build }, () => {
    for (const node of topological(outputs)) {
      if (dots.has(node) || !node.args.some((arg) => dots.has(arg))) continue;
      scope.label = derived(node.label, role);
      let total = null;
      partialsOf(node).forEach((partial, slot) => {
        const arg = node.args[slot];
        if (!dots.has(arg)) return;
        const term = reached.product(node.op, arg, partial, dots.get(arg));
        total = total ? add(total, term) : term;
        if (term.value !== 0) reached.passOn(node.op, arg, node, partial);
      });
      if (total.value !== 0) dots.set(node, total);
    }
  });
  return outputs.map((node) => dots.get(node) ?? constant(0));
}

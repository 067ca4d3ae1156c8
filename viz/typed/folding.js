// Folding: a simpler node that stands for an operation on some arguments, by the library's rules, or nothing.

// Operands count as finite and divisors as not zero: 0 * x = 0, x - x = 0. Zeros have no sign: x + 0 = x.
const isSum = (node) => node.op === "add" || node.op === "sub";
const POWERS = new Map([
  [0, () => constant(1)], [1, (a) => a], [2, (a) => mul(a, a)], [0.5, (a) => apply("sqrt", a)], [-1, (a) => div(1, a)],
]);

/** c + b, c - b where b has a constant of its own to join with; sign: of b. */
function offset(c, b, sign) {
  if (!isSum(b) || b.args[0].value === null) return null;
  const joined = constant(c + sign * b.args[0].value);
  if (!Number.isFinite(joined.value)) return null;
  return (b.op === "add") === (sign > 0) ? add(joined, b.args[1]) : sub(joined, b.args[1]);
}
function foldAdd(a, b) {
  if (b.value !== null) [a, b] = [b, a];
  if (a.value !== null) return a.value === 0 ? b : offset(a.value, b, 1);
  if (b.op === "neg") return sub(a, b.args[0]);
  if (a.op === "neg") return sub(b, a.args[0]);
  return a === b ? mul(2, a) : doubled("add", a, b);
}
function foldSub(a, b) {
  if (a.value === 0) return neg(b);
  if (b.value !== null) return add(constant(-b.value), a);
  const joined = a.value === null ? null : offset(a.value, b, -1);
  if (joined) return joined;
  if (a === b) return constant(0);
  if (b.op === "neg") return add(a, b.args[0]);
  return a.op === "neg" ? neg(add(a.args[0], b)) : doubled("sub", a, b);
}
/** 2 * x + 2 * y or their difference with the factor taken out. */
const doubled = (op, ...terms) => (terms.every((term) => term.op === "mul" && term.args[0].value === 2) ? mul(2, apply(op, ...terms.map((term) => term.args[1]))) : null);
function foldMul(a, b) {
  if (b.value !== null) [a, b] = [b, a];
  if (a.value !== null) return timesConstant(a.value, b);
  if (a.op === "neg") return b.op === "neg" ? mul(a.args[0], b.args[0]) : neg(mul(a.args[0], b));
  if (b.op === "neg") return neg(mul(a, b.args[0]));
  const quotient = (b.op === "div" && timesQuotient(a, b)) || (a.op === "div" && timesQuotient(b, a));
  if (quotient) return quotient;
  if (a.op !== "mul" || b.op !== "mul" || a.args[0].value === null || b.args[0].value === null) return null;
  const both = a.args[0].value * b.args[0].value;
  return Number.isFinite(both) && both ? mul(constant(both), mul(a.args[1], b.args[1])) : null;
}
function timesConstant(c, b) {
  if (c === 0) return constant(0);
  if (c === 1) return b;
  if (c === -1) return neg(b);
  if (b.op === "neg") return mul(constant(-c), b.args[0]);
  if (b.op === "div") return timesQuotient(constant(c), b);
  if (b.op !== "mul") return null;
  const inner = b.args[0].value;
  if (inner !== null && Number.isFinite(c * inner) && c * inner) return mul(constant(c * inner), b.args[1]);
  for (const [factor, other] of [b.args, [b.args[1], b.args[0]]]) { // 2 * ((0.5 * x) * y) = x * y
    const d = factor.op === "mul" ? factor.args[0].value : null;
    if (d !== null && Math.abs(c * d) === 1) return mul(constant(c * d), mul(factor.args[1], other));
  }
  return null;
}
/** a * (1 / c) = a / c, and x * (b / (x * y)) = b / y. */
function timesQuotient(a, { args: [b, c] }) {
  if (b.value === 1) return div(a, c);
  return c.op === "mul" && c.args.includes(a) ? div(b, c.args[c.args[0] === a ? 1 : 0]) : null;
}
function foldDiv(a, b) {
  if (b.value === 1) return a;
  if (b.value === -1) return neg(a);
  if (a.value === 0) return constant(0);
  if (a === b) return constant(1);
  if (a.op === "neg") return b.op === "neg" ? div(a.args[0], b.args[0]) : neg(div(a.args[0], b));
  return b.op === "neg" ? neg(div(a, b.args[0])) : null;
}
function foldNeg(a) {
  if (a.op === "neg") return a.args[0];
  return a.op === "mul" && a.args[0].value !== null ? mul(constant(-a.args[0].value), a.args[1]) : null;
}
function foldZeroSafe(a, b) {
  for (const [c, other] of [[a, b], [b, a]]) {
    if (c.value === 0) return constant(0);
    if (c.value !== null && Number.isFinite(c.value)) return mul(c, other);
  }
  return null;
}
const even = (op) => (a) => (a.op === "neg" ? apply(op, a.args[0]) : null);
const odd = (op) => (a) => (a.op === "neg" ? neg(apply(op, a.args[0])) : null);
const whole = (a) => (["floor", "ceil", "round"].includes(a.op) ? a : null);
const same = (a, b) => (a === b ? a : null);

const FOLD = {
  add: foldAdd, sub: foldSub, mul: foldMul, div: foldDiv, neg: foldNeg, zero_safe_mul: foldZeroSafe,
  pow: (a, b) => POWERS.get(b.value)?.(a),
  where: (c, a, b) => (c.value !== null ? (c.value !== 0 ? a : b) : same(a, b)),
  sin: odd("sin"), cbrt: odd("cbrt"), erf: odd("erf"), cos: even("cos"), abs: even("abs"),
  floor: whole, ceil: whole, round: whole, minimum: same, maximum: same,
};

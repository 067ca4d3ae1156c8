// The equation of a node as MathML, down to named nodes or a depth.

const escaped = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
const number = (value) => `<mn>${escaped(Number.isFinite(value) ? String(+value.toPrecision(4)) : String(value))}</mn>`;
const sign = (text) => `<mo>${escaped(text)}</mo>`;
const row = (...parts) => `<mrow>${parts.join("")}</mrow>`;
const fenced = (text) => row('<mo stretchy="false">(</mo>', text, '<mo stretchy="false">)</mo>');
const RELATIONS = { less: "<", less_equal: "≤", equal: "=", not_equal: "≠" };
const SUM = 1, PRODUCT = 2, ATOM = 3;

/** A node as an identifier: its name, or v with its number. */
function symbol(version, node) {
  const name = version.names[node];
  return name ? `<mi>${escaped(name[1])}</mi>` : `<msub><mi>v</mi><mn>${node}</mn></msub>`;
}

/** The node's equation, `depth` operations deep. */
function equation(version, node, depth) {
  const kept = version.args[node].length ? row(symbol(version, node), sign("="), text(version, node, depth, true)[0])
    : row(symbol(version, node));
  return `<math display="block">${kept}</math>`;
}

/** [MathML, how tightly it binds]. */
function text(version, node, depth, whole) {
  if (version.constants.has(node)) {
    const value = version.constants.get(node);
    return [number(value), value < 0 ? SUM : ATOM];
  }
  const args = version.args[node];
  if (!args.length || (!whole && (version.names[node] || depth <= 0))) return [symbol(version, node), ATOM];
  const inner = args.map((arg) => text(version, arg, depth - 1, false));
  const at = (i, least) => (inner[i][1] < least ? fenced(inner[i][0]) : inner[i][0]);
  const op = version.ops[node];
  switch (op) {
    case "add": return [row(at(0, SUM), sign("+"), at(1, PRODUCT)), SUM];
    case "sub": return [row(at(0, SUM), sign("−"), at(1, PRODUCT)), SUM];
    case "neg": return [row(sign("−"), at(0, PRODUCT)), SUM];
    case "mul": case "strong_mul": return [row(at(0, PRODUCT), sign("·"), at(1, PRODUCT)), PRODUCT];
    case "div": return [`<mfrac>${inner[0][0]}${inner[1][0]}</mfrac>`, PRODUCT];
    case "pow": return [`<msup>${row(version.args[args[0]].length && !version.names[args[0]] ? fenced(inner[0][0])
      : at(0, ATOM))}${inner[1][0]}</msup>`, PRODUCT];
    case "sqrt": return [`<msqrt>${inner[0][0]}</msqrt>`, ATOM];
    case "abs": return [row(sign("|"), inner[0][0], sign("|")), ATOM];
    default:
  }
  if (op in RELATIONS) return [row(at(0, SUM), sign(RELATIONS[op]), at(1, SUM)), 0];
  const listed = inner.map(([each]) => each).join(sign(","));
  return [row(`<mi>${op}</mi>`, fenced(listed)), ATOM];
}

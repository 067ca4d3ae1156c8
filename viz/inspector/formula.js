// The equation of a node as MathML, down to named nodes or a depth.

const escaped = (text) => text.replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
const number = (value) => `<mn>${escaped(Number.isFinite(value) ? String(+value.toPrecision(4)) : String(value))}</mn>`;
const sign = (text) => `<mo>${escaped(text)}</mo>`;
const row = (...parts) => `<mrow>${parts.join("")}</mrow>`;
const fenced = (text) => row('<mo stretchy="false">(</mo>', text, '<mo stretchy="false">)</mo>');
const BINDS = { sum: 1, function: 3, leaf: 4 }; // how strongly a text binds, as in the table of operations

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
    return [number(value), value < 0 ? BINDS.sum : BINDS.leaf];
  }
  const args = version.args[node];
  if (!args.length || (!whole && (version.names[node] || depth <= 0))) return [symbol(version, node), BINDS.leaf];
  const inner = args.map((arg) => text(version, arg, depth - 1, false));
  const formula = FORMULA[version.ops[node]];
  if (!formula) {
    const listed = inner.map(([each]) => each).join(sign(","));
    return [row(`<mi>${version.ops[node]}</mi>`, fenced(listed)), BINDS.function];
  }
  const [template, least, binding] = formula;
  const filled = template.replace(/\{(\d)\}/g, (_, slot) => {
    const [each, binds] = inner[slot];
    return binds < least[slot] ? fenced(each) : each;
  });
  return [row(filled), binding];
}

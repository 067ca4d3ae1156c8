// The equation of a node as MathML elements, down to named nodes or a depth.

const MATHML = "http://www.w3.org/1998/Math/MathML";
const BINDS = { sum: 1, function: 3, leaf: 4 }; // how strongly a text binds, as in the table of operations

/** An element of MathML around texts and other elements. */
function math(name, ...inside) {
  const made = document.createElementNS(MATHML, name);
  made.append(...inside);
  return made;
}
const number = (value) => math("mn", Number.isFinite(value) ? String(+value.toPrecision(4)) : String(value));
const parenthesis = (text) => { const made = math("mo", text); made.setAttribute("stretchy", "false"); return made; };
const fenced = (inside) => math("mrow", parenthesis("("), inside, parenthesis(")"));

/** A node as an identifier: its name, or v with its number. */
function symbol(version, node) {
  const name = version.names[node];
  return name ? math("mi", name[1]) : math("msub", math("mi", "v"), math("mn", String(node)));
}

/** The node's equation, `depth` operations deep. */
function equation(version, node, depth) {
  const kept = version.args[node].length
    ? math("mrow", symbol(version, node), math("mo", "="), formula(version, node, depth, true)[0])
    : math("mrow", symbol(version, node));
  const made = math("math", kept);
  made.setAttribute("display", "block");
  return made;
}

/** [MathML, how tightly it binds]. */
function formula(version, node, depth, whole) {
  if (version.constants.has(node)) {
    const value = version.constants.get(node);
    return [number(value), value < 0 ? BINDS.sum : BINDS.leaf];
  }
  const args = version.args[node];
  if (!args.length || (!whole && (version.names[node] || depth <= 0))) return [symbol(version, node), BINDS.leaf];
  const inner = args.map((arg) => formula(version, arg, depth - 1, false));
  const known = FORMULA.get(version.ops[node]);
  if (!known) {
    const listed = inner.flatMap(([each], i) => (i ? [math("mo", ","), each] : [each]));
    return [math("mrow", math("mi", version.ops[node]), fenced(math("mrow", ...listed))), BINDS.function];
  }
  const [template, least, binding] = known;
  const fill = (part) => {
    if (typeof part === "string") return part;
    if (typeof part === "number") {
      const [each, binds] = inner[part];
      const filled = binds < least[part] ? fenced(each) : each;
      return used.has(part) ? filled.cloneNode(true) : (used.add(part), filled); // an element has one place
    }
    const [name, attributes, ...inside] = part;
    const made = math(name, ...inside.map(fill));
    for (const key in attributes) made.setAttribute(key, attributes[key]);
    return made;
  };
  const used = new Set();
  return [fill(template), binding];
}

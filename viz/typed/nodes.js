// Nodes: constants, variables and operations, kept as written or made by a builder that folds and shares.

// A label is a number: its low bits are roles, the others tags, by their place in `tagNames`.
const INPUT = 1, PRIMAL = 2, ADJOINT = 4, TANGENT = 8, ROLES = 15;
const tagNames = ["Euler relation", "qd dt", "damping", "force", "kinetic", "potential", "definition", "lagrangian"];
const [EULER, COUPLING, DAMPING, FORCE, KINETIC, POTENTIAL, DEFINITION, LAGRANGIAN] = tagNames.map((_, i) => 16 << i);
const derived = (label, role) => (label & ~(INPUT | PRIMAL)) | role;
const withTagsOf = (label, other) => label | (other & ~ROLES);

let scope = { label: PRIMAL, build: null }; // what new nodes get, and how they are built; null: kept as written
let made = 0;

class Node {
  constructor(op, args, label, value = null, name = null) {
    this.op = op;
    this.args = args;
    this.label = label;
    this.value = value;
    this.name = name;
    this.id = made++;
  }
}

const constants = new Map(), variables = new Map();

/** The node of a number; 0 and -0 stay apart. */
function constant(value) {
  const key = Object.is(value, -0) ? "-0" : value;
  if (!constants.has(key)) constants.set(key, new Node("constant", [], 0, value));
  return constants.get(key);
}
/** The variable of a name. */
function variable(name) {
  if (!variables.has(name)) variables.set(name, new Node("variable", [], INPUT, null, name));
  return variables.get(name);
}
const asNode = (value) => (value instanceof Node ? value : constant(value));

/** A node of an operation on nodes and numbers, built as the scope says. */
function apply(op, ...args) {
  const nodes = args.map(asNode);
  return scope.build ? scope.build.make(op, nodes, scope.label) : new Node(op, nodes, scope.label);
}
const add = (a, b) => apply("add", a, b), sub = (a, b) => apply("sub", a, b), mul = (a, b) => apply("mul", a, b);
const div = (a, b) => apply("div", a, b), neg = (a) => apply("neg", a);

/** What `body` makes, with other settings of the scope. */
function within(settings, body) {
  const before = scope;
  scope = { ...before, ...settings };
  try {
    return body();
  } finally {
    scope = before;
  }
}

/** Builds nodes folded and shared: the same operation on the same arguments is made once, labels united. */
class Builder {
  made = new Map();
  make(op, args, label, name = null) {
    if (args.every((arg) => arg.op === "constant")) {
      const value = VALUE[op](...args.map((arg) => arg.value));
      if (!Number.isNaN(value)) return constant(value);
    } else {
      const [{ op: inner, args: [a, b] }] = args; // of a difference that was made here the sign is turned round
      if (op === "neg" && inner === "sub" && this.made.get(`sub ${a.id} ${b.id}`) === args[0]) return this.make("sub", [b, a], label);
      const simpler = FOLD[op]?.(...args);
      if (simpler) return simpler;
    }
    const { commutative } = ROWS[op];
    if (commutative && args[1].value !== null && args[0].value === null) args = [args[1], args[0]];
    const ids = args.map((arg) => arg.id);
    if (commutative) ids.sort((a, b) => a - b);
    const key = `${op} ${ids.join(" ")}`;
    let node = this.made.get(key);
    if (!node) {
      if (!(label & ~ROLES)) label = args.reduce((united, arg) => withTagsOf(united, arg.label), label);
      node = new Node(op, args, label, null, name);
      this.made.set(key, node);
    }
    node.label |= label;
    node.name ??= name;
    return node;
  }
}

/** Nodes and inputs as the arrays of a graph that `evaluator` takes, and the number of every node. */
function numbered(nodes, inputs) {
  const number = new Map(nodes.map((node, i) => [node, i]));
  return { number, nodes: nodes.map(({ op, value, args }) => (args.length ? [op, ...args.map((arg) => number.get(arg))] : value)),
    inputs: inputs.map((node) => [node.name, number.get(node) ?? -1]) };
}

/** What some nodes reach, arguments first, without recursion. */
function topological(outputs) {
  const order = [], closed = new Set();
  for (const output of outputs) {
    if (closed.has(output)) continue;
    const stack = [[output, 0]];
    while (stack.length) {
      const top = stack[stack.length - 1], [node] = top;
      if (top[1] < node.args.length) {
        const arg = node.args[top[1]++];
        if (!closed.has(arg)) stack.push([arg, 0]);
      } else {
        stack.pop();
        if (!closed.has(node)) order.push(node);
        closed.add(node);
      }
    }
  }
  return order;
}

/** Map from each node that `outputs` reach to its copy: what `replace` has, else made from its new arguments. */
function rebuild(outputs, replace, make) {
  const copies = new Map(replace);
  for (const node of topological(outputs)) {
    if (!copies.has(node)) copies.set(node, node.args.length ? make(node, node.args.map((arg) => copies.get(arg))) : node);
  }
  return copies;
}

/** Copies with other nodes in place of variables, operations kept as written. tag: of copies of nodes that have none. */
function substitute(nodes, replace, tag = 0) {
  const labelOf = ({ label }) => (label & ~ROLES ? label : label | tag);
  const copies = rebuild(nodes, replace, (node, args) => new Node(node.op, args, labelOf(node), null, node.name));
  return nodes.map((node) => copies.get(node));
}

/** Copies of nodes made by a builder. replace: Map {node: what stands in its place}. */
function folded(nodes, build = new Builder(), replace = new Map()) {
  const copies = rebuild(nodes, replace, (node, args) =>
    within({ build, label: node.label }, () => build.make(node.op, args, node.label, node.name)));
  return nodes.map((node) => copies.get(node));
}

const edgeCount = (nodes) => nodes.reduce((sum, node) => sum + node.args.length, 0);

/** A graph: inputs, and Map from names to outputs; `nodes` arguments first. */
const graphOf = (inputs, outputs) => ({ inputs, outputs, nodes: topological(outputs.values()) });

/** The same function in fewer nodes, or the graph itself where folding makes none fewer. */
function simplified(graph) {
  const nodes = folded([...graph.outputs.values()]);
  const other = graphOf(graph.inputs, new Map([...graph.outputs.keys()].map((name, i) => [name, nodes[i]])));
  const fewer = other.nodes.length - graph.nodes.length || edgeCount(other.nodes) - edgeCount(graph.nodes);
  return fewer < 0 ? other : graph;
}

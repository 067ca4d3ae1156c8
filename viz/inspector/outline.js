// The graph as text, for who hears it or goes through it by keys: columns, clusters, nodes, each in what it is part of.

/** Write the outline anew where it is open and its version is another. */
function showOutline(app) {
  const box = byId("outline");
  if (!box.open || app.outlined === app.version) return;
  app.outlined = app.version;
  const { version, plan } = app, { marked, ops, edges, inputs, outputs } = version;
  const sum = `${version.name}: ${counted(ops.length, "node")}, ${counted(edges.length, "edge")}, ${marked.size} spurious.`;
  const leaf = (name, letters, node) => tag("li", {}, node < 0 ? shownName(app, name, letters) : nodeButton(app, node, shownName(app, name, letters)));
  const columns = new Map();
  ops.forEach((_, node) => {
    const c = plan.cluster[plan.place[version.index][node]];
    if (c < 0) return;
    const { column } = plan.clusters[c];
    if (!columns.has(column)) columns.set(column, new Map());
    columns.get(column).set(c, [...(columns.get(column).get(c) ?? []), node]);
  });
  const order = plan.columns.filter((column) => columns.has(column));
  byId("outlined").replaceChildren(tag("p", {}, sum), tag("ul", {},
    branch(`inputs: ${inputs.length}`, () => inputs.map(([name, node]) => leaf(name, name, node))),
    ...order.map((column) => columnBranch(app, column || "no tag", columns.get(column))),
    branch(`outputs: ${outputs.length}`, () => outputs.map(([name, letters, node]) => leaf(name, letters, node)))));
}
function columnBranch(app, name, clusters) {
  const all = [...clusters.values()].flat();
  return branch(summed(app, name, all), () => [...clusters].map(([c, nodes]) => {
    const { stage } = app.plan.clusters[c], words = [stage, titleOf(app.plan.clusters[c])].filter(Boolean).join(", ");
    return branch(summed(app, words, nodes), () => nodes.map((node) => tag("li", {}, nodeButton(app, node, lineOf(app, node)))));
  }));
}
function summed(app, name, nodes) {
  const wrong = nodes.filter((node) => app.version.marked.has(node)).length;
  return `${name}: ${counted(nodes.length, "node")}${wrong ? `, ${wrong} spurious` : ""}`;
}
/** A line that unfolds; what is in it is made when it is first opened. */
function branch(words, inside) {
  const list = tag("ul"), made = tag("details", {}, tag("summary", {}, words), list);
  made.ontoggle = () => { if (!list.children.length) list.append(...inside()); };
  return tag("li", {}, made);
}
const lineOf = (app, node) => `${told(app, node)} of ${app.version.args[node].map((arg) => (app.version.constants.has(arg) ? brief(app.version.constants.get(arg)) : nameOf(app, arg))).join(", ")}`;
function nodeButton(app, node, words) {
  const button = tag("button", { type: "button", class: "line-of" }, words);
  button.onclick = () => goTo(app, node);
  return button;
}

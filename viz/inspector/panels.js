// Words and numbers beside the picture: the node, why, results, inputs, counts, the legend.

const PATHS = 5, DEPTH = 4;

const shownName = (app, name, letters) => app.state.called.get(name) ?? letters ?? name;
const unitOf = (app, name) => (app.units.has(name) ? [" ", tag("span", { class: "unit" }, `[${app.units.get(name)}]`)] : []);

/** What a node is called: its name, that of its output, or its number in the listing. */
function nameOf(app, node) {
  const { version } = app;
  const [name, letters] = version.names[node] ?? version.outputs.find(([, , out]) => out === node) ?? [`%${version.number[node]}`];
  return shownName(app, name, letters);
}
function told(app, node) {
  const operation = app.version.args[node].length > 0;
  const number = operation && !nameOf(app, node).startsWith("%") ? `%${app.version.number[node]}, ` : "";
  return `${nameOf(app, node)}${operation ? ` (${number}${caption(app.version, node)})` : ""}`;
}

function showNode(app, bars) {
  const { picked: node, version } = app;
  if (node < 0) byId("node").replaceChildren(quiet("Click a node to see its equation and value. Click a box to unfold it."));
  else {
    const [tags, role] = version.labels[version.label[node]];
    const bar = bars ?? adjoints(version, app.partials(), app.output());
    const number = version.number[node] ? [`%${version.number[node]}`] : [];
    const words = [[...number, version.ops[node], version.marked.has(node) ? `spurious, ${role}` : role].join(", "),
      ...(tags.length ? [tag("br"), `tags: ${tags.join(", ")}`] : []), tag("br"),
      `value ${brief(app.values[node], app.noise()[node])}, ∂${nameOf(app, app.output())} by it ${brief(bar[node])}`];
    byId("node").replaceChildren(scrolled(equation(version, node, DEPTH)), tag("p", {}, ...words));
  }
  showWhy(app);
}

function showWhy(app) {
  const [a, b] = [app.before, app.picked].sort((one, other) => one - other);
  if (a < 0) {
    byId("why").replaceChildren(quiet("Click two nodes, such as an input and an output: how many paths lead from one to the other, and which weigh most?"));
    return;
  }
  const { version } = app, count = pathCount(version, a, b);
  const head = tag("p", {}, tag("b", {}, nameOf(app, a)), " → ", tag("b", {}, nameOf(app, b)), `: ${digits(count)} path${count === 1n ? "" : "s"}`);
  byId("why").replaceChildren(head);
  if (!count) { head.append("; the one does not depend on the other."); return; }
  const bars = adjoints(version, app.partials(), b);
  const found = heaviest(version, app.partials(), a, b, PATHS);
  head.append(`. The derivative here is ${brief(bars[a])}, the sum of their products of partials.`,
    ` ${found.length ? "The heaviest:" : "Here a partial on each is zero."}`);
  const alike = (nodes) => found.filter((each) => each.nodes.join() === nodes.join()).length > 1;
  found.forEach(({ nodes, slots, product }) => {
    const words = nodes.map((node, i) => (i && alike(nodes) ? `argument ${slots[i - 1] + 1} of ` : "") + told(app, node));
    const crossed = nodes.filter((node) => version.marked.has(node)).length, on = app.path?.join() === nodes.join();
    const button = tag("button", { type: "button", class: `path${on ? " on" : ""}` },
      `${brief(product)}: ${words.join(" → ")}${crossed ? `  (${crossed} spurious)` : ""}`);
    button.onclick = () => { app.path = on ? null : nodes; paintPath(app); showWhy(app); };
    byId("why").append(button);
  });
}

/** Fields for the inputs of the state, and what follows from them: the same for all versions. */
function makeInputs(app) {
  const { state } = app;
  app.fields = new Map();
  const rows = state.names.map((name) => {
    const field = tag("input", { type: "number", step: "any", "aria-label": shownName(app, name) });
    field.onchange = () => {
      if (!Number.isFinite(field.valueAsNumber)) { showInputs(app); return; }
      play(app, false);
      state.set({ [name]: field.valueAsNumber });
    };
    app.fields.set(name, field);
    const users = state.versions.filter((each) => each.inputs.some(([own]) => own === name));
    const only = users.length && users.length < state.versions.length && !state.derived?.inputs.some(([own]) => own === name)
      ? [tag("br"), tag("span", { class: "unit" }, `only in ${users.map((each) => each.name).join(", ")}`)] : [];
    return tag("tr", {}, tag("td", {}, shownName(app, name), ...unitOf(app, name), ...only), tag("td", {}, field));
  });
  const follow = (state.derived?.outputs ?? []).map(([name, letters]) => {
    const shown = tag("output", { "aria-label": shownName(app, name, letters) });
    app.fields.set(name, shown);
    return tag("tr", {}, tag("td", {}, shownName(app, name, letters), ...unitOf(app, name)), tag("td", {}, shown));
  });
  const from = state.derived ? state.derived.inputs.map(([name]) => shownName(app, name)).join(", ") : "";
  const told = follow.length ? [tag("details", {}, tag("summary", {}, `${follow.length} that follow`),
    quiet(`Computed from ${fitted(from, 90)}; the other versions do not have them.`), scrolled(tag("table", {}, tag("tbody", {}, ...follow))))] : [];
  byId("inputs").replaceChildren(quiet("One state for all versions."), scrolled(tag("table", {}, tag("tbody", {}, ...rows))), ...told);
  showInputs(app);
}
function showInputs(app) {
  for (const [name, field] of app.fields) {
    const value = app.state.get(name);
    if (field.tagName === "INPUT") field.value = +value.toPrecision(5); else field.textContent = brief(value);
  }
  byId("reset").hidden = byId("edited").hidden = !app.state.edited;
}

/** How many nodes are there by mistake; where there are none, what else is wrong. */
function spuriousIn({ marked, blamed, flawed }) {
  const nodes = marked.size ?? marked.length;
  return nodes || (blamed.length ? counted(blamed.length, "edge") : flawed ? "a term gone" : 0);
}
function showCounts(app) {
  const { version } = app;
  const rows = app.state.versions.map((each) => tag("tr", {}, rowHead(each.name),
    ...[each.ops.length, each.edges.length, spuriousIn(each)].map((count) => tag("td", {}, String(count)))));
  const ops = new Map();
  version.ops.forEach((op) => { ops.set(op, (ops.get(op) ?? 0) + 1); });
  const kinds = [...ops].sort((a, b) => b[1] - a[1]).map(([op, many]) => `${op} ${many}`);
  byId("counts").replaceChildren(table(["nodes", "edges", "spurious"], rows),
    quiet(`Constants (${version.constants.size}) are written where they are used. ${kinds.join(", ")}.`));
}

function showLegend(app) {
  const kinds = [["input", "input"], ["primal", "as written"], ["adjoint", "adjoint: reverse"], ["tangent", "tangent: forward"], ["several", "several roles"], ["wrong", "spurious"]];
  const present = new Set(app.version.labels.map(([, role]) => role));
  if (app.version.marked.size || app.version.blamed.length) present.add("wrong");
  byId("legend").replaceChildren(...kinds.filter(([kind]) => present.has(kind)).map(([kind, words]) => tag("span", { class: kind }, words)));
}

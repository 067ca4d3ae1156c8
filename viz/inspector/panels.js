// Words, formulas and numbers beside the picture: the node, why, results, inputs, counts, the legend, tables.

const quiet = (words) => tag("p", { class: "quiet" }, words);
const rowHead = (...words) => tag("th", { scope: "row" }, ...words);
const counted = (many, word) => `${many} ${word}${many === 1 ? "" : "s"}`;

/** A number in three digits; at most `noise` in size it is rounding alone, and is 0. */
function brief(value, noise = 0) {
  if (Number.isNaN(value)) return "NaN";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  return Math.abs(value) <= noise ? "0" : numeral(value, 3).replace("e−", "e-");
}

/** A text of at most so many letters: of a longer one, its ends. */
function fitted(text, most) {
  const letters = [...text], room = Math.max(4, Math.floor(most) - 1);
  if (letters.length <= room + 1) return text;
  return `${letters.slice(0, Math.ceil(room / 2)).join("")}…${letters.slice(letters.length - Math.floor(room / 2)).join("")}`;
}

const MATHML = "http://www.w3.org/1998/Math/MathML";
const BINDS = { sum: 1, function: 3, leaf: 4 }; // how strongly a text binds, as in the table of operations

/** An element of MathML around texts and other elements; with attributes, too. */
const mathWith = (name, attributes, ...inside) => filled(document.createElementNS(MATHML, name), attributes, inside);
const math = (name, ...inside) => mathWith(name, {}, ...inside);
const number = (value) => math("mn", Number.isFinite(value) ? String(+value.toPrecision(4)) : String(value));
const parenthesis = (text) => mathWith("mo", { stretchy: "false" }, text);
const fenced = (inside) => math("mrow", parenthesis("("), inside, parenthesis(")"));

/** A node as an identifier: its name, or v with its number in the listing. */
function symbol(version, node) {
  const name = version.names[node];
  if (version.symbol) return version.symbol(node);
  return name ? math("mi", name[1]) : math("msub", math("mi", "v"), math("mn", String(version.number[node])));
}

/** The node's equation, `depth` operations deep. */
function equation(version, node, depth) {
  const kept = version.args[node].length
    ? math("mrow", symbol(version, node), math("mo", "="), formula(version, node, depth, true)[0])
    : math("mrow", symbol(version, node));
  return mathWith("math", { display: "block" }, kept);
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
    return mathWith(name, attributes, ...inside.map(fill));
  };
  const used = new Set();
  return [fill(template), binding];
}

const DEPTH = 4;

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
  const needed = state.derived ? state.derived.inputs.map(([name]) => shownName(app, name)) : [];
  const from = needed.length > 6 ? `${needed.slice(0, 4).join(", ")} and ${needed.length - 4} more` : needed.join(", ");
  const told = follow.length ? [tag("details", {}, tag("summary", {}, `${follow.length} that follow`),
    quiet(`Computed from ${from}; the other versions do not have them.`), scrolled(tag("table", {}, tag("tbody", {}, ...follow))))] : [];
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

/** The state as one line: what is not 0, to rounding. */
function inputsInWords(app) {
  const { state, units } = app, noise = state.errorsOf({ inputs: state.names.map((name) => [name]) });
  const unit = (name) => (["1", undefined].includes(units.get(name)) ? "" : ` ${units.get(name)}`);
  const told = state.names.map((name, i) => [name, brief(state.get(name), noise[i])]).filter(([, text]) => text !== "0");
  const rest = told.length < state.names.length ? [told.length ? "all others 0" : "all 0"] : [];
  return `${[...told.map(([name, text]) => `${shownName(app, name)} = ${text}${unit(name)}`), ...rest].join(", ")}.`;
}

function showCounts(app) {
  const { version } = app;
  const rows = app.state.versions.map((each) => tag("tr", {}, rowHead(each.name),
    ...[each.ops.length, each.edges.length, ...spuriousIn(each)].map((count) => tag("td", {}, String(count)))));
  const ops = new Map();
  version.ops.forEach((op) => { ops.set(op, (ops.get(op) ?? 0) + 1); });
  const kinds = [...ops].sort((a, b) => b[1] - a[1]).map(([op, many]) => `${op} ${many}`);
  byId("counts").replaceChildren(table(["", "nodes", "edges", ...SPURIOUS_HEADS], rows),
    quiet(`Constants (${version.constants.size}) are written where they are used. ${kinds.join(", ")}.`));
}

function showLegend(app) {
  const kinds = [["input", "input"], ["primal", "as written"], ["adjoint", "adjoint: reverse"], ["tangent", "tangent: forward"], ["several", "several roles"], ["wrong", "spurious"], ["off", "wrong result"], ["switch", "switches: jumps or kinks"]];
  const present = new Set([...app.version.labels.map(([, role]) => role), app.version.ops.some((op) => ROWS[op]?.switches) ? "switch" : ""]);
  if (app.version.marked.size || app.version.blamed.length) present.add("wrong");
  else if (app.version.off.size) present.add("off");
  byId("legend").replaceChildren(...kinds.filter(([kind]) => present.has(kind)).map(([kind, words]) => tag("span", { class: kind }, words)));
}

const OFF = 0.01; // relative: what differs by more from the right version is marked
const FITTING = 3; // columns of numbers for which there is room beside the picture

const namedHead = (words, ...unit) => tag("th", { scope: "row" }, words, ...unit);
const largestOf = (values) => values.reduce((most, value) => (Number.isFinite(value) ? Math.max(most, Math.abs(value)) : most), 0);

/** A table with a row for each name and a column for each head: its element, and its cells by row and column. */
function numbers(app, heads, names) {
  const cells = names.map(() => heads.map(() => tag("td")));
  const rows = names.map(([name, words], i) => tag("tr", {}, namedHead(words, ...unitOf(app, name)), ...cells[i]));
  return [scrolled(table(["", ...heads], rows)), cells];
}
function write(cell, text, kind = "") {
  if (cell.textContent !== text) cell.textContent = text;
  if (cell.className !== kind) cell.className = kind;
}

function makeResults(app) {
  const { tables } = app.state, versions = app.compared = alike(app.state.versions, app.version);
  app.names = [...new Map(versions.flatMap((each) => each.outputs.map(([name, letters]) => [name, shownName(app, name, letters)])))];
  app.right = versions.findIndex((each) => !each.flawed && versions.some((other) => other.flawed));
  const [shown, cells] = numbers(app, versions.map((each) => each.name), app.names);
  app.cells = cells;
  byId("results").replaceChildren(tag("p", { id: "now" }), shown, ...(app.right < 0 ? []
    : [quiet(`In vermillion: differs from ${versions[app.right].name} by more than a hundredth${app.state.names.includes("dt") ? ", however small dt is; other differences are smaller, or vanish with dt" : ""}. All at the same state; values within rounding error are shown as 0.`)]));
  byId("statetables").replaceChildren();
  byId("wide").replaceChildren();
  tables.forEach((each) => showTable(app, each));
  for (const id of ["statetables", "wide"]) byId(id).hidden = !byId(id).children.length;
}

/** A table of the record: beside the picture, if need be with rows as columns; below it where both are many. */
function showTable(app, each) {
  const names = each.rows.map(([name]) => [name, shownName(app, name)]), wide = each.header.length > FITTING;
  if (wide && names.length > FITTING) {
    const [inside, cells] = numbers(app, each.header, names), made = tag("details", {}, tag("summary", {}, each.caption), inside);
    made.ontoggle = () => dispatchEvent(new Event("resize")); // the picture has other room
    each.cells = cells;
    byId("wide").append(made);
    return;
  }
  const unit = (name) => (app.units.has(name) ? ` [${app.units.get(name).replaceAll(" ", "\u00a0")}]` : "");
  const [inside, cells] = wide ? numbers(app, names.map(([name, words]) => words + unit(name)), each.header.map((head) => ["", head]))
    : numbers(app, each.header, names);
  each.cells = wide ? names.map((_, i) => cells.map((row) => row[i])) : cells;
  byId("statetables").append(tag("div", {}, tag("h2", {}, each.caption), inside));
}

/** Results of all versions at the one state, and what differs from the version that is right. */
function showResults(app) {
  const found = app.compared.map((each) => {
    const own = each === app.version ? app.values : app.state.evaluate(each), noise = noiseIn(app, each, own);
    return new Map(each.outputs.map(([name, , node]) => [name, [own[node], noise[node]]]));
  });
  app.names.forEach(([name], row) => found.forEach((each, column) => {
    if (!each.has(name)) return;
    const [value, noise] = each.get(name), [truth, blur] = found[app.right]?.get(name) ?? [value, 0];
    const off = wrongIn(app.compared[column], name) && Math.abs(value - truth) > noise + blur + OFF * Math.max(Math.abs(value), Math.abs(truth));
    write(app.cells[row][column], brief(value, noise), off ? "off" : "");
  }));
  tellNow(app, app.compared, found);
  for (const each of app.state.tables) {
    const values = app.state.evaluate(each), noise = noiseIn(app, each, values);
    each.rows.forEach(([, outputs], row) => outputs.forEach((out, column) => {
      const node = each.outputs[out][2];
      write(each.cells[row][column], brief(values[node], noise[node]));
    }));
  }
}

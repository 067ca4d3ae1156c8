// Tables of numbers that follow the state: made once for a record, then only their texts change.

const OFF = 0.01; // relative: what differs by more from the right version is marked
const FITTING = 3; // columns of numbers for which there is room beside the picture

const namedHead = (words, ...unit) => tag("th", { scope: "row", class: words.length > 16 ? "long" : "" }, words, ...unit);
const largestOf = (values) => values.reduce((most, value) => (Number.isFinite(value) ? Math.max(most, Math.abs(value)) : most), 0);

/** A table with a row for each name and a column for each head: its element, and its cells by row and column. */
function numbers(app, heads, names) {
  const cells = names.map(() => heads.map(() => tag("td")));
  const rows = names.map(([name, words], i) => tag("tr", {}, namedHead(words, ...unitOf(app, name)), ...cells[i]));
  return [scrolled(table(heads, rows)), cells];
}
function write(cell, text, kind = "") {
  if (cell.textContent !== text) cell.textContent = text;
  if (cell.className !== kind) cell.className = kind;
}

function makeResults(app) {
  const { versions, tables } = app.state;
  app.names = [...new Map(versions.flatMap((each) => each.outputs.map(([name, letters]) => [name, shownName(app, name, letters)])))];
  app.right = versions.findLastIndex((each) => !each.flawed && versions.some((other) => other.flawed));
  const [shown, cells] = numbers(app, versions.map((each) => each.name), app.names);
  app.cells = cells;
  byId("results").replaceChildren(shown, ...(app.right < 0 ? []
    : [quiet(`In vermillion: differs from ${versions[app.right].name}. All at one state; 0 is what is below rounding.`)]));
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
  const unit = (name) => (app.units.has(name) ? ` [${app.units.get(name)}]` : "");
  const [inside, cells] = wide ? numbers(app, names.map(([name, words]) => words + unit(name)), each.header.map((head) => ["", head]))
    : numbers(app, each.header, names);
  each.cells = wide ? names.map((_, i) => cells.map((row) => row[i])) : cells;
  byId("statetables").append(tag("div", {}, tag("h2", {}, each.caption), inside));
}

/** Results of all versions at the one state, and what differs from the version that is right. */
function showResults(app) {
  const found = app.state.versions.map((each, i) => {
    const own = i === app.index ? app.values : app.state.evaluate(each), noise = noiseIn(app, each, own);
    return new Map(each.outputs.map(([name, , node]) => [name, [own[node], noise[node]]]));
  });
  app.names.forEach(([name], row) => found.forEach((each, column) => {
    if (!each.has(name)) return;
    const [value, noise] = each.get(name), [truth, blur] = found[app.right]?.get(name) ?? [value, 0];
    const off = Math.abs(value - truth) > noise + blur + OFF * Math.max(Math.abs(value), Math.abs(truth));
    write(app.cells[row][column], brief(value, noise), off ? "off" : "");
  }));
  for (const each of app.state.tables) {
    const values = app.state.evaluate(each), noise = noiseIn(app, each, values);
    each.rows.forEach(([, outputs], row) => outputs.forEach((out, column) => {
      const node = each.outputs[out][2];
      write(each.cells[row][column], brief(values[node], noise[node]));
    }));
  }
}

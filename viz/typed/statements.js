// The lines of a text: coordinates, parameters, definitions, energies, damping, forces, the start and the time.

const COORDINATE_WORDS = ["q", "coordinates", "coordinate"], FORCE_WORDS = ["tau", "force"];
const LINE_WORDS = "A line is a name, = and a formula, such as m = 1.0";

/** Statements {kind: list | of | start | define, name, dots, items, at, end}; items: formulas, or names of a list q. */
function statementsOf(text) {
  const reader = new Reader(tokensOf(text)), statements = [];
  const last = reader.tokens.length - 1;
  while (reader.next < last) {
    if (reader.token.kind === "end") { reader.take(); continue; }
    statements.push(readStatement(reader));
    if (reader.is(",") && reader.peek(1).kind === "name") reader.take(); // m = 1, g = 9.81
    else if (reader.is(")")) throw new TextError("This parenthesis was not opened.", reader.token.at);
    else if (reader.token.kind !== "end") throw wrongAt(reader.token, "The line should end here");
  }
  return statements;
}
function readStatement(reader) {
  const { kind, text: name, dots, at, end } = reader.token;
  if (kind !== "name") throw wrongAt(reader.token, LINE_WORDS);
  reader.take();
  if (reader.is(":")) return readList(reader, { kind: "list", name, at, end });
  if (reader.is("(")) return readStart(reader, { kind: "start", name, dots, at, end });
  if (reader.token.kind === "name" && (name === "damping" || FORCE_WORDS.includes(name))) {
    const of = reader.take();
    reader.expect("=", `A line ${name} needs = and a formula`);
    return { kind: "of", name: kindOf(name), of, items: [readFormula(reader)], at, end };
  }
  if (dots) throw new TextError(`A rate is not set by a line; for the start write ${name}${"'".repeat(dots)}(0) = a number.`, at, end);
  reader.expect("=", LINE_WORDS);
  return { kind: "define", name: kindOf(name), items: [readFormula(reader)], at, end };
}
const kindOf = (name) => (FORCE_WORDS.includes(name) ? "tau" : name);

function readList(reader, statement) {
  const { name, at, end } = statement, coordinates = COORDINATE_WORDS.includes(name);
  if (!coordinates && kindOf(name) !== "tau" && name !== "damping") {
    throw new TextError(`A colon goes after q, damping or tau; for a value write ${name} = ....`, at, end);
  }
  const items = [];
  do {
    reader.take(); // the colon or a comma
    if (!coordinates) { items.push(readFormula(reader)); continue; }
    const token = reader.take();
    if (token.kind !== "name" || token.dots) throw wrongAt(token, "A list of coordinates has names, without dots");
    items.push(token);
  } while (reader.is(","));
  return { ...statement, name: coordinates ? "q" : kindOf(name), items };
}
function readStart(reader, statement) {
  reader.take();
  const zero = reader.take();
  if (zero.kind !== "number" || zero.value !== 0) throw wrongAt(zero, `The start is set at time 0, as in ${statement.name}(0) = 1`);
  reader.expect(")", "The parenthesis after 0 is not closed");
  reader.expect("=", "The start needs = and a number");
  return { ...statement, items: [readFormula(reader)] };
}

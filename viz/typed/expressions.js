// From text to tokens with their places, and to formulas in postfix order, so that a long one needs no deep recursion.
// Nothing that is typed is ever run.

const MOST_LETTERS = 5000;
const PATTERNS = {
  space: /(?:[^\S\n]|#[^\n]*|\/\/[^\n]*)+/y,
  name: /([\p{L}_][\p{L}\p{Nd}\p{M}_₀-₉]*)(['′’″]*)/uy, // with the dots of θ̇, ẍ and x'
  number: /(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?/y,
  power: /[⁰¹²³⁴-⁹]+/y,
  sign: /\*\*|[-+*/^()=,:;\n·⋅×∗−–÷∕]/y,
};
const SIGNS = new Map([["**", "^"], ["·", "*"], ["⋅", "*"], ["×", "*"], ["∗", "*"], ["−", "-"], ["–", "-"], ["÷", "/"], ["∕", "/"]]);
const CONTINUED = ["+", "-", "*", "/", "^", "("]; // after these a formula goes on in the next line
const digitsAmong = (digits) => (text) => [...text].map((each) => (digits.includes(each) ? digits.indexOf(each) : each)).join("");
const raised = digitsAmong("⁰¹²³⁴⁵⁶⁷⁸⁹"), lowered = digitsAmong("₀₁₂₃₄₅₆₇₈₉");

/** What is wrong with a text: one sentence, and the place, from character `at` to `end`. */
class TextError extends Error {
  constructor(words, at, end = at + 1) {
    super(words);
    Object.assign(this, { at, end });
  }
}
const quoted = (text) => `“${text.length > 40 ? `${text.slice(0, 39)}…` : text}”`;

/** Tokens {kind, text, at, end}: name (with its dots), number and power (with its value), sign, end of a statement. */
function tokensOf(text) {
  if (text.length > MOST_LETTERS) {
    throw new TextError(`The text has ${text.length} characters, and this page reads up to ${MOST_LETTERS}.`, MOST_LETTERS);
  }
  const tokens = [];
  let at = 0;
  while (at < text.length) {
    let kind, found;
    for (kind in PATTERNS) {
      PATTERNS[kind].lastIndex = at;
      found = PATTERNS[kind].exec(text);
      if (found) break;
    }
    if (!found) throw notUnderstood(text, at);
    const open = tokens.length && tokens.at(-1).kind === "sign" && CONTINUED.includes(tokens.at(-1).text);
    if (kind !== "space" && !(found[0] === "\n" && open)) tokens.push({ at, end: at + found[0].length, ...TOKENS[kind](found) });
    at += found[0].length;
  }
  return [...tokens, { kind: "end", text: "", at, end: at }];
}
const TOKENS = {
  name([, letters, primes]) {
    let name = "", dots = 0;
    for (const letter of letters.normalize("NFD")) {
      if (letter === "\u0307") dots += 1;
      else if (letter === "\u0308") dots += 2;
      else name += letter;
    }
    for (const prime of primes) dots += prime === "″" ? 2 : 1;
    return { kind: "name", text: lowered(name.normalize("NFC")), dots };
  },
  number: ([text]) => ({ kind: "number", text, value: Number(text) }),
  power: ([text]) => ({ kind: "power", text, value: Number(raised(text)) }),
  sign: ([text]) => (text === "\n" || text === ";" ? { kind: "end", text } : { kind: "sign", text: SIGNS.get(text) ?? text }),
};
function notUnderstood(text, at) {
  const letter = String.fromCodePoint(text.codePointAt(at));
  const instead = letter === "|" ? "; write abs(...) for a size" : "[]{}".includes(letter) ? "; write parentheses, ( and )" : "";
  return new TextError(`${quoted(letter)} is not understood here${instead}.`, at, at + letter.length);
}

const MOST_NESTED = 100;
const ALIASES = { ln: "log", arcsin: "asin", arccos: "acos", arctan: "atan", arctan2: "atan2", min: "minimum", max: "maximum" };
const HIDDEN = ["add", "sub", "mul", "div", "neg", "zero_safe_mul"];
const isFunction = (name) => Object.hasOwn(ALIASES, name) || (Object.hasOwn(ROWS, name) && !HIDDEN.includes(name));
const functionNames = () => [...Object.keys(ROWS).filter(isFunction), ...Object.keys(ALIASES)];

/** Reads one text's tokens from left to right. */
class Reader {
  constructor(tokens) { Object.assign(this, { tokens, next: 0 }); }
  get token() { return this.tokens[this.next]; }
  peek(offset) { return this.tokens[Math.min(this.next + offset, this.tokens.length - 1)]; }
  is(...texts) { return this.token.kind === "sign" && texts.includes(this.token.text); }
  take() {
    const { token } = this;
    if (this.next < this.tokens.length - 1) this.next++;
    return token;
  }
  /** The sign, or what was needed in its place. */
  expect(text, words) {
    if (!this.is(text)) throw wrongAt(this.token, words);
    return this.take();
  }
}
function wrongAt(token, words) {
  const here = token.kind === "end" ? "the line ends here" : `${quoted(token.text)} is here`;
  return new TextError(`${words}, but ${here}.`, token.at, Math.max(token.end, token.at + 1));
}

/** A formula as steps {kind: number | name | apply, ...} in postfix order. */
function readFormula(reader) {
  const steps = [];
  readSum(reader, steps, 0);
  requireOperator(reader);
  return steps;
}
function readSum(reader, steps, depth) {
  readProduct(reader, steps, depth);
  while (reader.is("+", "-")) binary(reader, steps, depth, reader.token.text === "+" ? "add" : "sub", readProduct);
}
function readProduct(reader, steps, depth) {
  readSigned(reader, steps, depth);
  while (reader.is("*", "/")) binary(reader, steps, depth, reader.token.text === "*" ? "mul" : "div", readSigned);
  requireOperator(reader);
}
function binary(reader, steps, depth, op, read) {
  const { at, end } = reader.take();
  read(reader, steps, depth);
  steps.push({ kind: "apply", op, count: 2, at, end });
}
function readSigned(reader, steps, depth) {
  if (depth > MOST_NESTED) throw new TextError(`More than ${MOST_NESTED} parentheses and signs stand within one another.`, reader.token.at);
  if (reader.is("+")) {
    reader.take();
    readSigned(reader, steps, depth + 1);
  } else if (reader.is("-")) {
    const { at, end } = reader.take();
    readSigned(reader, steps, depth + 1);
    steps.push({ kind: "apply", op: "neg", count: 1, at, end });
  } else readPower(reader, steps, depth);
}
function readPower(reader, steps, depth) {
  readOperand(reader, steps, depth);
  if (reader.token.kind === "power") {
    const { at, end, value } = reader.take();
    steps.push({ kind: "number", value, at, end }, { kind: "apply", op: "pow", count: 2, at, end });
  } else if (reader.is("^")) {
    const { at, end } = reader.take();
    readSigned(reader, steps, depth + 1);
    steps.push({ kind: "apply", op: "pow", count: 2, at, end });
  }
}
function readOperand(reader, steps, depth) {
  const token = reader.take();
  const { text, at, end } = token;
  if (token.kind === "number") {
    if (!Number.isFinite(token.value)) throw new TextError(`${quoted(text)} is too large a number.`, at, end);
    steps.push({ kind: "number", value: token.value, at, end });
  } else if (token.kind === "name" && reader.is("(")) readCall(reader, steps, depth, token);
  else if (token.kind === "name") {
    if (isFunction(text) && !token.dots) {
      throw new TextError(`${quoted(text)} is a function: write what it is of in parentheses, ${text}(...).`, at, end);
    }
    steps.push({ kind: "name", name: text, dots: token.dots, at, end });
  } else if (token.kind === "sign" && text === "(") {
    readSum(reader, steps, depth + 1);
    closed(reader, token);
  } else throw wrongAt(token, "A number, a name or a parenthesis is needed");
}
function readCall(reader, steps, depth, { text, dots, at, end }) {
  if (!isFunction(text) || dots) {
    const near = nearest(text, functionNames());
    const hint = near ? ` did you mean ${near}, or is` : " is";
    throw new TextError(`There is no function ${quoted(text)}:${hint} a * missing before the parenthesis?`, at, end);
  }
  const open = reader.take(), op = ALIASES[text] ?? text;
  let count = 0;
  do {
    if (count) reader.take();
    readSum(reader, steps, depth + 1);
    count++;
  } while (reader.is(","));
  closed(reader, open);
  const { arity } = ROWS[op];
  if (count !== arity) throw new TextError(`${text} takes ${arity} argument${arity > 1 ? "s" : ""}, not ${count}.`, at, end);
  steps.push({ kind: "apply", op, count, at, end });
}
function closed(reader, open) {
  if (reader.is(")")) reader.take();
  else if (reader.token.kind === "end") throw new TextError("This parenthesis is not closed.", open.at, open.end);
  else throw wrongAt(reader.token, "A closing parenthesis or an operator such as + or * is needed");
}
/** What may follow an operand: anything but another one. */
function requireOperator(reader) {
  const { token } = reader, before = reader.peek(-1);
  const operand = token.kind === "number" || token.kind === "name" || reader.is("(");
  if (operand) {
    throw new TextError(`Between ${quoted(before.text)} and ${quoted(token.text)} an operator is missing: write * for a product.`, token.at, token.end);
  }
  if (token.kind === "power") throw new TextError("A power needs parentheses here, such as (x²)².", token.at, token.end);
}

/** The known name that is spelled most like one, or nothing where none is near. */
function nearest(name, known) {
  const scored = known.map((other) => [distance(name.toLowerCase(), other.toLowerCase()), other]).sort((a, b) => a[0] - b[0]);
  return scored.length && scored[0][0] <= Math.max(1, name.length / 3) && scored[0][0] < name.length ? scored[0][1] : "";
}
/** How many letters differ, are missing or too many. */
function distance(a, b) {
  if (Math.abs(a.length - b.length) > 3) return Infinity;
  let row = Array.from({ length: b.length + 1 }, (_, j) => j);
  for (let i = 1; i <= a.length; i++) {
    const next = [i];
    for (let j = 1; j <= b.length; j++) next.push(Math.min(row[j] + 1, next[j - 1] + 1, row[j - 1] + (a[i - 1] === b[j - 1] ? 0 : 1)));
    row = next;
  }
  return row[b.length];
}

// From text to tokens with their places; nothing that is typed is ever run.

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
    this.at = at;
    this.end = end;
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

// The box that a Lagrangian is typed into: what it says goes to the inspector, what is wrong under the box.

const TYPED_PART = "text"; // of the page's address
const TYPED_WAIT = 400; // ms after the last key

/** The text in the page's address, or nothing. */
const linkedText = () => { const part = linkPart(TYPED_PART); return part === undefined ? null : unescaped(part); };
/** The record of a text, or what is wrong with it: one sentence. */
function typedRecord(text, forward = false) {
  try {
    const system = TYPED.parse(text), motion = TYPED.motionOf(system);
    return { system, motion, record: TYPED.recordOf(system, motion, forward) };
  } catch (error) {
    if (!(error instanceof TYPED.TextError)) throw error;
    return { wrong: TYPED.explained(text, error) };
  }
}
/** The box at work. text: what it holds at first, where the address has none.  shown: whether the page shows that. */
function startTyped(inspector, text, shownFirst) {
  const before = inspector.record(), box = byId("text"), opener = openingButton();
  let waiting = 0;
  const shown = () => {
    clearTimeout(waiting);
    const found = typedRecord(box.value, byId("which").value !== "");
    box.setAttribute("aria-invalid", Boolean(found.wrong));
    showWrong(found.wrong);
    if (found.wrong) return;
    inspector.showRecord(found.record);
    showDerived(found);
    keepLink(box.value);
    byId("back-to").hidden = shownFirst;
  };
  byId("examples").replaceChildren(tag("option", { value: "" }, "an example"), ...[...TYPED.EXAMPLES.keys()].map((name) => tag("option", { value: name }, name)));
  byId("examples").onchange = () => {
    if (!byId("examples").value) return;
    box.value = TYPED.EXAMPLES.get(byId("examples").value);
    shown();
  };
  box.oninput = () => {
    byId("examples").value = "";
    clearTimeout(waiting);
    waiting = setTimeout(shown, TYPED_WAIT);
  };
  box.onkeydown = (event) => {
    if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) shown();
    event.stopPropagation(); // the page's keys are letters here
  };
  byId("which").onchange = shown;
  byId("link").onclick = () => { keepLink(box.value); copyByButton(byId("link")); };
  byId("back-to").onclick = () => {
    inspector.showRecord(before);
    byId("back-to").hidden = true;
    keepLink(null);
  };
  addEventListener("hashchange", () => {
    const linked = linkedText();
    if (linked === null || linked === box.value) return;
    box.value = linked;
    opener(true);
    shown();
  });
  const linked = linkedText();
  box.value = linked ?? text;
  if (shownFirst || linked !== null) shown();
  opener(shownFirst || linked !== null);
}
/** The button in the page's head that opens and closes the box. */
function openingButton() {
  const button = tag("button", { type: "button", id: "opentyped", "aria-controls": "typed", title: "type your own Lagrangian" }, "type L");
  const open = (on) => {
    byId("typed").hidden = !on;
    filled(button, { "aria-expanded": on, "aria-pressed": on });
    dispatchEvent(new Event("resize")); // the picture has other room
  };
  button.onclick = () => { open(byId("typed").hidden); if (!byId("typed").hidden) byId("text").focus(); };
  byId("title").after(button);
  return open;
}

/** The sentence, and the line that it is about with the place marked. */
function showWrong(wrong) {
  if (!wrong) { byId("wrong").replaceChildren(); return; }
  const { sentence, source, column, length } = wrong;
  byId("wrong").replaceChildren(tag("p", {}, sentence),
    tag("pre", {}, source.slice(0, column), tag("mark", {}, source.slice(column, column + length) || " "), source.slice(column + length)),
    tag("small", {}, "Picture and results are still those of the text before."));
}
/** Counts, lint in words, and how exact the motion is. */
function showDerived({ system, motion, record }) {
  const rows = record.versions.map((version) => {
    const { name, nodes, flawed } = version, edges = argsOf(version).flat().length;
    return tag("tr", {}, rowHead(name), ...[nodes.length, edges, ...spuriousIn(version)].map((count, k) => tag("td", { class: k > 1 && flawed ? "off" : "" }, String(count))));
  });
  const lint = TYPED.FORMULATIONS.map((name) => {
    const found = TYPED.verdict(system, name), words = found.differs ? "wrong" : "right";
    return tag("details", {}, tag("summary", {}, `${name.replace("_", " ")}: ${words}`), tag("pre", {}, TYPED.lint(system, found).join("\n")));
  });
  byId("derived").replaceChildren(...typedFormulas(system), scrolled(table(["", "nodes", "edges", ...SPURIOUS_HEADS], rows)), ...lint, ...(motion.error ? [] : motionWords(system, motion)));
}
const LONGEST_FORMULA = 120; // symbols of a formula that is shown

/** The Lagrangian, and the torques by the chain rule, as formulas; of a long one, that it is long. */
function typedFormulas(system) {
  const tau = [...TYPED.inverseDynamics(system, "chain_rule").outputs.values()];
  const lefts = [math("mi", "L"), ...system.coordinates.map((name) => math("msub", math("mi", "τ"), indexed(name)))];
  const rows = [system.lagrangian, ...tau].map((node, k) => {
    const view = viewOf(node, system), last = view.ops.length - 1, sizes = [];
    view.args.forEach((args, i) => { sizes[i] = args.reduce((sum, arg) => sum + sizes[arg], 1); });
    const right = sizes[last] > LONGEST_FORMULA ? math("mtext", `a formula of ${sizes[last]} symbols`) : formula(view, last, Infinity, true)[0];
    return scrolled(mathWith("math", { display: "block" }, math("mrow", lefts[k], math("mo", "="), right)));
  });
  return [tag("h3", {}, "L and τ as their graphs have them"), ...rows];
}
/** A node as panels.js writes formulas of a version, with coordinates in their letters. */
function viewOf(node, system) {
  const nodes = TYPED.topological([node]), number = new Map(nodes.map((each, i) => [each, i]));
  return {
    ops: nodes.map(({ op }) => op), args: nodes.map(({ args }) => args.map((arg) => number.get(arg))), names: [],
    constants: new Map(nodes.flatMap(({ value }, i) => (value === null ? [] : [[i, value]]))),
    symbol: (i) => lettered(nodes[i].name, system.coordinates),
  };
}
/** A name in letters: qd0 is the first coordinate's with a dot. */
function lettered(name, coordinates) {
  const [, rate, place] = /^q(d*)(\d+)$/.exec(name) ?? [];
  const text = TYPED.pretty(coordinates[place] ?? name), dots = { d: "\u02d9", dd: "\u00a8" }[rate];
  const letter = place === undefined || isLetter(text) ? math("mi", text) : math("mi", "q");
  const dotted = dots ? math("mover", letter, math("mo", dots)) : letter;
  return place === undefined || isLetter(text) ? dotted : math("msub", dotted, math("mi", text));
}
const isLetter = (text) => [...text.replace(/[₀-₉]/g, "")].length === 1;
const indexed = (name) => math("mi", TYPED.pretty(name));

function motionWords(system, motion) {
  const [first, last] = [motion.energy[0], motion.energy.at(-1)], exact = Number.isFinite(motion.change) ? `; halving the step changes it by a relative ${brief(motion.change)}` : "";
  return [tag("h3", {}, "Motion"), curves(system, motion),
    tag("p", {}, `${motion.steps} Runge-Kutta steps${exact}. Energy ${brief(first)} at the start, ${brief(last)} at the end.`)];
}
/** Coordinates over time. */
function curves({ coordinates }, { t, q }) {
  const places = namesIn(coordinates, 315), high = NAMED.line * places.at(-1)[1];
  const svg = drawn("svg", { id: "curves", viewBox: `0 ${-high} 320 ${130 + high}`, role: "img", "aria-label": `${coordinates.join(", ")} over time` });
  const all = q.flat(), low = Math.min(...all), size = Math.max(...all) - low || 1;
  const place = (k, i) => `${(310 * t[k] / (t.at(-1) || 1) + 5).toFixed(1)} ${(122 - 94 * (q[k][i] - low) / size).toFixed(1)}`;
  coordinates.forEach((name, i) => {
    element("path", { class: `curve${i}`, d: `M${t.map((_, k) => place(k, i)).join("L")}` }, svg);
    element("path", { class: `curve${i}`, d: `M${5 + places[i][0]} ${11 + NAMED.line * places[i][1] - high}h14` }, svg);
    element("text", { x: 23 + places[i][0], y: 15 + NAMED.line * places[i][1] - high }, svg, name);
  });
  return svg;
}

const keepLink = (text) => keepPart(TYPED_PART, text === null ? null : encodeURIComponent(text));

// What there is to play with on the screens: sliders, and what the graphs make of them.

/** The function from {input: value} to {output: value} of a graph's module. */
const named = ({ inputs, outputs, evaluate }) => (at) => {
  const found = evaluate(inputs.map((name) => at[name]));
  return Object.fromEntries(outputs.map((name, k) => [name, found[k]]));
};

/** Pivots of a symmetric matrix, the last first: the matrix before every pivot, and after the last. */
function stages(matrix) {
  const all = [matrix];
  for (let k = matrix.length - 1; k > 0; k--) {
    const left = all.at(-1);
    all.push(left.map((row, i) => row.map((x, j) => (Math.max(i, j) < k ? x - (left[i][k] * left[k][j]) / left[k][k] : x))));
  }
  return all;
}

/** A motion by a method: inputs of the rate at every step, until its state is not finite. */
function motion({ inputs, outputs, steps }, start, dt, count, method) {
  const x = Float64Array.from(inputs, (name) => start[name]), rows = [];
  for (let k = 0; k <= count && x.subarray(0, outputs.length).every(Number.isFinite); k++) {
    rows.push([...x]);
    steps[method](x, dt, 1);
  }
  return rows;
}

/** Four digits, with a minus that is one. */
const digits = (x) => (Number.isFinite(x) ? String(+x.toPrecision(4)) : "—").replaceAll("-", "−");

/** A slider with its name and value. */
function slider(board, shown, low, high, step, value, change, text = digits) {
  const input = tag("input", { type: "range", min: low, max: high, step, "aria-label": shown });
  const output = tag("output", {}, text(value));
  input.value = value;
  input.addEventListener("input", () => { output.textContent = text(+input.value); change(+input.value); });
  board.append(tag("label", {}, shown, input, output));
}
function sliders(board, play, at, draw) {
  for (const each of play.sliders)
    slider(board, each.shown, each.low, each.high, 0.01, each.value, (x) => { at[each.name] = x; draw(); });
}
function button(board, text, press) {
  const made = board.appendChild(tag("button", { type: "button" }, text));
  made.addEventListener("click", press);
  return made;
}
/** A table whose cells can be written anew: {write(rows), cells}. */
function grid(board, header) {
  const made = table(header, []);
  board.append(scrolled(made));
  return (rows, classes = () => "") => made.tBodies[0].replaceChildren(
    ...rows.map((row, i) => tag("tr", {}, ...row.map((text, j) => tag("td", { class: classes(i, j) }, text)))),
  );
}
/** The width of what holds a picture, so that its letters are as large as they say. */
const width = (svg) => svg.parentElement.clientWidth - 16 || 620;
/** Bars beside one another, in groups: {name: [values]}. */
function bars(svg, groups, colors) {
  const entries = Object.entries(groups), height = 34;
  const largest = Math.max(Number.MIN_VALUE, ...entries.flatMap(([, values]) => values.map(Math.abs).filter(Number.isFinite)));
  const wide = width(svg), names = Math.min(90, wide / 4), middle = names + (wide - names) / 2, scale = (wide - middle) / largest;
  svg.setAttribute("viewBox", `0 0 ${wide} ${entries.length * height + 4}`);
  svg.replaceChildren(
    drawn("line", { x1: middle, x2: middle, y1: 0, y2: entries.length * height, class: "axis" }),
    ...entries.flatMap(([name, values], i) => [
      drawn("text", { x: 0, y: i * height + 20 }, name),
      ...values.flatMap((value, k) => {
        const long = Number.isFinite(value) ? Math.abs(value) * scale : 0, thick = (height - 8) / values.length;
        return [drawn("rect", { x: value < 0 ? middle - long : middle, y: i * height + 4 + k * thick, width: long,
          height: thick - 1, fill: colors[k % colors.length] })];
      }),
    ]),
  );
}

/** Make what there is to play with: a play fills the board, and returns what draws it at the values of the inputs. */
function startPlay(board, play) {
  const draw = PLAYS[play.kind](board, play, { ...play.values }, () => draw());
  draw();
}

const PLAYS = {
  rows(board, play, at, redraw) {
    const run = named(play.graph);
    at.dt = 0.1; // long enough to be seen
    slider(board, "dt [s]", 0, 1, 0.01, at.dt, (x) => { at.dt = x; redraw(); });
    sliders(board, play, at, redraw);
    const write = grid(board, play.header);
    return () => {
      const found = run(at);
      write(play.rows.map(([shown, ...names]) => [shown, ...names.map((name) => digits(found[name]))]));
    };
  },
  step(board, play, at, redraw) {
    const right = named(play.right), wrong = named(play.wrong), terms = play.terms && named(play.terms);
    const names = play.right.outputs.slice(0, play.joints.length), old = Object.keys(at).filter((name) => name.endsWith("_old"));
    const rate = {}; // of what is old, by a second, where velocities are no rates of coordinates
    for (const name of old) rate[name] = (play.values[name.slice(0, -4)] - play.values[name]) / play.values.dt;
    if (play.sliders.length)
      for (const name of old) rate[name] = null; // the rate is a velocity or an acceleration that is at hand
    let still = false;
    slider(board, "dt [s]", -6, 0, 0.1, -3, (x) => { at.dt = 10 ** x; redraw(); }, (x) => digits(10 ** x));
    sliders(board, play, at, redraw);
    const rest = button(board, "Let it rest", () => { still = !still; rest.setAttribute("aria-pressed", still); redraw(); });
    rest.setAttribute("aria-pressed", "false");
    const write = grid(board, [play.joint, "chain rule", "by definition", "difference", "∂L/∂q"]);
    const svg = board.appendChild(drawn("svg", { role: "img", "aria-label": "By the chain rule and by definition" }));
    return () => {
      const now = { ...at };
      if (still) for (const name in now) if (/^qd+\d+$/.test(name)) now[name] = 0;
      for (const name of old) {
        const own = name.slice(0, -4);
        now[name] = now[own] - (still ? 0 : rate[name] ?? now[own.replace("q", "qd")]) * at.dt;
      }
      const good = right(now), bad = wrong(now), much = terms ? terms(now) : {};
      const size = 1e-9 * Math.max(...names.flatMap((name) => [good[name], bad[name]]).map(Math.abs).filter(Number.isFinite));
      const shown = (x) => digits(Math.abs(x) <= size ? 0 : x);
      write(names.map((name, i) =>
        [play.joints[i], ...[good[name], bad[name], bad[name] - good[name], much[name] ?? 0].map(shown)]));
      bars(svg, Object.fromEntries(names.map((name, i) => [play.joints[i], [good[name], bad[name]]])), play.colors);
    };
  },
  sweeps(board, play, at, redraw) {
    const rows = play.rows, count = rows.length, last = play.slopes ? 2 * count : count;
    let step = 0;
    const buttons = board.appendChild(tag("div", { class: "buttons" }));
    button(buttons, "Next", () => { step = Math.min(step + 1, last); redraw(); });
    button(buttons, play.rates ? "All" : "All values", () => { step = Math.max(step, count); redraw(); });
    if (play.slopes) button(buttons, "All slopes", () => { step = last; redraw(); });
    button(buttons, "Again", () => { step = 0; redraw(); });
    const write = grid(board, ["node", "value", ...(play.rates ? ["rate"] : []), ...(play.slopes ? ["slope of L", "it is"] : []), "is"]);
    return () => {
      const now = step > count ? 2 * count - step : step - 1; // the row whose value or slope is new
      const cells = rows.map((row, i) => [row.node, i < step ? digits(row.value) : "·",
        ...(play.rates ? [i < step ? digits(row.rate) : "·"] : []),
        ...(play.slopes ? (2 * count - i <= step ? [digits(row.slope), row.what] : ["·", ""]) : []), row.text]);
      write(cells.reverse(), (i, j) => (count - 1 - i === now && (j === (step > count ? 2 : 1) || (play.rates && j === 2)) ? "lit" : "")); // as in the picture
      rows.forEach((row, i) => document.getElementById(row.box)?.classList.toggle("lit", i === now));
    };
  },
  parts(board, play, at, redraw) {
    const torque = named(play.graph);
    const names = play.graph.outputs.slice(0, play.joints.length);
    const zero = (kind) => Object.fromEntries(Object.keys(at).filter((name) => new RegExp(`^${kind}\\d+$`).test(name)).map((name) => [name, 0]));
    sliders(board, play, at, redraw);
    const write = grid(board, [play.joint, ...play.parts, "τ"]);
    const svg = board.appendChild(drawn("svg", { role: "img", "aria-label": "Parts of τ" }));
    return () => {
      const held = torque({ ...at, ...zero("qd"), ...zero("qdd") });
      const steady = torque({ ...at, ...zero("qdd") }), still = torque({ ...at, ...zero("qd") });
      const parts = names.map((name) => [still[name] - held[name], steady[name] - held[name], held[name]]);
      write(parts.map((row, i) => [play.joints[i], ...row.map(digits), digits(row[0] + row[1] + row[2])]));
      bars(svg, Object.fromEntries(parts.map((row, i) => [play.joints[i], row])), ["#56B4E9", "#E69F00", "#009E73"]);
    };
  },
  elimination(board, play, at, redraw) {
    const mass = named(play.graph), n = play.n;
    let step = 0;
    sliders(board, play, at, () => { step = 0; redraw(); });
    const buttons = board.appendChild(tag("div", { class: "buttons" }));
    button(buttons, "Take out the next", () => { step = Math.min(step + 1, n - 1); redraw(); });
    button(buttons, "Again", () => { step = 0; redraw(); });
    const write = grid(board, ["row", ...play.joints]);
    return () => {
      const found = mass(at), matrix = play.joints.map((_, i) => play.joints.map((_, j) => found[`M_${i}_${j}`]));
      const shown = stages(matrix)[step], pivot = n - 1 - step;
      write(shown.map((row, i) => [play.joints[i], ...row.map((x, j) => (Math.max(i, j) > pivot && i !== j ? "" : digits(x)))]),
        (i, j) => (j === 0 ? "" : i === j - 1 && i === pivot ? "lit" : Math.max(i, j - 1) > pivot ? "gone" : ""));
    };
  },
  loop(board, play, at, redraw) {
    const free = named(play.free), held = named(play.held);
    sliders(board, play, at, redraw);
    const write = grid(board, ["at rest", "free", "held"]);
    return () => {
      const a = free(at), b = held(at), found = play.joints.flatMap((_, i) => [a[`qdd${i}`], b[`qdd${i}`]]);
      const rounding = play.rounding * Math.max(0, ...found.map(Math.abs).filter(Number.isFinite));
      const shown = (x) => digits(Math.abs(x) <= rounding ? 0 : x);
      write([...play.joints.map((name, i) => [name, shown(a[`qdd${i}`]), shown(b[`qdd${i}`])]),
        ...Object.entries(play.multipliers).map(([name, row]) =>
          [`λ, ${row}`, "", digits(Math.abs(b[name]) <= play.rounding * play.force ? 0 : b[name])])]);
    };
  },
  energy(board, play, start, redraw) {
    const { rate, energy } = play, total = named(energy);
    const energies = (method, steps) => motion(rate, start, play.t_end / steps, steps, method)
      .map((row) => total({ ...start, ...Object.fromEntries(rate.inputs.map((name, i) => [name, row[i]])) }).E);
    const fine = play.fine, exact = energies("rk4", fine);
    let steps = 100;
    slider(board, "steps", 1, 3, 0.05, 2, (x) => { steps = Math.round(10 ** x); redraw(); }, (x) => String(Math.round(10 ** x)));
    const svg = board.appendChild(drawn("svg", { role: "img", "aria-label": "Energy over time" }));
    const words = board.appendChild(tag("p", { role: "status" }));
    return () => {
      const curves = ["euler", "rk4"].map((method) => energies(method, steps));
      const right = (i) => exact[Math.round((i * fine) / steps)] ?? NaN;
      const off = curves.map((curve) => Math.max(...curve.map((e, i) => Math.abs(e - right(i))).filter(Number.isFinite)));
      const known = exact.filter(Number.isFinite), low = Math.min(...known), high = Math.max(...known);
      const reach = Math.max((high - low) / 2, Math.min(off[0], 2 * Math.max(Math.abs(low), Math.abs(high))), Number.MIN_VALUE);
      const wide = width(svg), middle = (low + high) / 2;
      const x = (share) => 74 + (wide - 80) * share;
      const y = (e) => 120 - 100 * Math.max(-1.1, Math.min(1.1, (e - middle) / reach));
      const line = (curve, count, look) => drawn("polyline", { fill: "none", "stroke-width": 2, ...look,
        points: curve.flatMap((e, i) => (Number.isFinite(e) ? [`${x(i / count).toFixed(1)},${y(e).toFixed(1)}`] : [])).join(" ") });
      svg.setAttribute("viewBox", `0 0 ${wide} 256`);
      svg.replaceChildren(
        drawn("line", { x1: x(0), x2: x(0), y1: 10, y2: 230, class: "axis" }),
        ...[-1, 0, 1].flatMap((share) => [
          drawn("line", { x1: x(0) - 5, x2: x(0), y1: 120 - 100 * share, y2: 120 - 100 * share, class: "axis" }),
          drawn("text", { x: x(0) - 8, y: 125 - 100 * share, "text-anchor": "end" }, digits(+(middle + share * reach).toPrecision(3))),
        ]),
        drawn("text", { x: 0, y: 14 }, `E${play.unit && ` [${play.unit.trim()}]`}`),
        drawn("text", { x: x(0), y: 252, "text-anchor": "middle" }, "0"),
        drawn("text", { x: wide - 6, y: 252, "text-anchor": "end" }, `t = ${digits(play.t_end)} s`),
        ...curves.map((curve, k) => line(curve, steps, { stroke: play.colors[k] })),
        line(exact.filter((_, i) => i % 10 === 0), fine / 10, { class: "axis", "stroke-dasharray": "5 4", "stroke-width": 1 }),
      );
      words.textContent = `Step ${digits(play.t_end / steps)} s. Largest error of the energy: Euler ${digits(off[0])}${play.unit}, ` +
        `rk4 ${digits(off[1])}${play.unit}.`;
    };
  },
};

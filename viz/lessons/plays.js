// What there is to play with on the screens: sliders, and what the graphs make of them.

function element(name, attributes = {}, ...inside) {
  const made = document.createElement(name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  made.append(...inside);
  return made;
}
function drawn(name, attributes, ...inside) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  made.append(...inside);
  return made;
}

/** A slider with its name and value. */
function slider(board, shown, low, high, step, value, change, text = digits) {
  const input = element("input", { type: "range", min: low, max: high, step, "aria-label": shown });
  const output = element("output", {}, text(value));
  input.value = value;
  input.addEventListener("input", () => { output.textContent = text(+input.value); change(+input.value); });
  board.append(element("label", {}, shown, input, output));
}
function sliders(board, play, at, draw) {
  for (const each of play.sliders)
    slider(board, each.shown, each.low, each.high, 0.01, each.value, (x) => { at[each.name] = x; draw(); });
}
function button(board, text, press) {
  const made = element("button", { type: "button" }, text);
  made.addEventListener("click", press);
  board.append(made);
  return made;
}
/** A table whose cells can be written anew: {write(rows), cells}. */
function grid(board, header) {
  const body = element("tbody");
  const head = element("thead", {}, element("tr", {}, ...header.map((name) => element("th", {}, name))));
  board.append(element("div", { class: "scroll" }, element("table", {}, head, body)));
  return (rows, classes = () => "") => body.replaceChildren(
    ...rows.map((row, i) => element("tr", {}, ...row.map((text, j) => {
      const cell = element("td", {}, text);
      const kind = classes(i, j);
      if (kind) cell.className = kind;
      return cell;
    }))),
  );
}
/** Bars beside one another, in groups: {name: [values]}. */
function bars(svg, groups, colors) {
  const entries = Object.entries(groups), height = 34;
  const largest = Math.max(1e-300, ...entries.flatMap(([, values]) => values.map(Math.abs).filter(Number.isFinite)));
  const wide = 620, middle = 340, scale = 240 / largest;
  svg.setAttribute("viewBox", `0 0 ${wide} ${entries.length * height + 4}`);
  svg.replaceChildren(
    drawn("line", { x1: middle, x2: middle, y1: 0, y2: entries.length * height, class: "axis" }),
    ...entries.flatMap(([name, values], i) => [
      drawn("text", { x: 0, y: i * height + 20 }, name),
      ...values.flatMap((value, k) => {
        const width = Number.isFinite(value) ? Math.abs(value) * scale : 0, thick = (height - 8) / values.length;
        return [drawn("rect", { x: value < 0 ? middle - width : middle, y: i * height + 4 + k * thick, width, height: thick - 1,
          fill: colors[k % colors.length] })];
      }),
    ]),
  );
}

const PLAYS = {
  step(board, play) {
    const right = evaluator(play.right), wrong = evaluator(play.wrong), at = { ...play.values };
    const names = numbered("tau", play.joints.length), old = Object.keys(at).filter((name) => name.endsWith("_old"));
    const rate = {}; // of what is old, by a second
    for (const name of old) rate[name] = (play.values[name.slice(0, -4)] - play.values[name]) / play.values.dt;
    let still = false;
    slider(board, "dt [s]", -6, 0, 0.1, -3, (x) => { at.dt = 10 ** x; draw(); }, (x) => digits(10 ** x));
    sliders(board, play, at, () => draw());
    const rest = button(board, "Let it rest", () => { still = !still; rest.setAttribute("aria-pressed", still); draw(); });
    const write = grid(board, ["joint", "torque", "by definition", "error"]);
    const svg = board.appendChild(drawn("svg", { role: "img", "aria-label": "Torques, right and by definition" }));
    const draw = () => {
      const now = { ...at };
      if (still) for (const name in now) if (/^qd+\d+$/.test(name)) now[name] = 0;
      for (const name of old) now[name] = now[name.slice(0, -4)] - (still ? 0 : rate[name]) * at.dt;
      const good = right(now), bad = wrong(now);
      write(names.map((name, i) => [play.joints[i], ...[good[name], bad[name], bad[name] - good[name]].map(digits)]));
      bars(svg, Object.fromEntries(names.map((name, i) => [play.joints[i], [good[name], bad[name]]])), play.colors);
    };
    draw();
  },
  sweeps(board, play) {
    const rows = play.rows, count = rows.length;
    let step = 0;
    const buttons = board.appendChild(element("div", { class: "buttons" }));
    button(buttons, "Next", () => { step = Math.min(step + 1, 2 * count); draw(); });
    button(buttons, "All values", () => { step = Math.max(step, count); draw(); });
    button(buttons, "All slopes", () => { step = 2 * count; draw(); });
    button(buttons, "Again", () => { step = 0; draw(); });
    const write = grid(board, ["node", "is", "value", "slope of L", ""]);
    const draw = () => write(
      rows.map((row, i) => [row.node, row.text, i < step ? digits(row.value) : "·",
        2 * count - i <= step ? digits(row.slope) : "·", 2 * count - i <= step ? row.what : ""]),
      (i, j) => (j === 2 && i === step - 1) || (j === 3 && 2 * count - i === step) ? "lit" : "",
    );
    draw();
  },
  parts(board, play) {
    const torque = evaluator(play.graph), at = { ...play.values };
    const names = numbered("tau", play.joints.length);
    const zero = (kind) => Object.fromEntries(Object.keys(at).filter((name) => new RegExp(`^${kind}\\d+$`).test(name)).map((name) => [name, 0]));
    sliders(board, play, at, () => draw());
    const write = grid(board, ["joint", ...play.parts, "torque"]);
    const svg = board.appendChild(drawn("svg", { role: "img", "aria-label": "Parts of the torques" }));
    const draw = () => {
      const held = torque({ ...at, ...zero("qd"), ...zero("qdd") });
      const steady = torque({ ...at, ...zero("qdd") }), still = torque({ ...at, ...zero("qd") });
      const parts = names.map((name) => [still[name] - held[name], steady[name] - held[name], held[name]]);
      write(parts.map((row, i) => [play.joints[i], ...row.map(digits), digits(row[0] + row[1] + row[2])]));
      bars(svg, Object.fromEntries(parts.map((row, i) => [play.joints[i], row])), ["#56B4E9", "#E69F00", "#009E73"]);
    };
    draw();
  },
  elimination(board, play) {
    const mass = evaluator(play.graph), at = { ...play.values }, n = play.n;
    let step = 0;
    sliders(board, play, at, () => { step = 0; draw(); });
    const buttons = board.appendChild(element("div", { class: "buttons" }));
    button(buttons, "Take out the next joint", () => { step = Math.min(step + 1, n - 1); draw(); });
    button(buttons, "Again", () => { step = 0; draw(); });
    const write = grid(board, ["", ...play.joints]);
    const draw = () => {
      const found = mass(at), name = (i, j) => found[`M_${i}_${j}`];
      const matrix = play.joints.map((_, i) => play.joints.map((_, j) => name(i, j)));
      const shown = stages(matrix)[step], pivot = n - 1 - step;
      write(shown.map((row, i) => [play.joints[i], ...row.map((x, j) => (Math.max(i, j) > pivot && i !== j ? "" : digits(x)))]),
        (i, j) => (j === 0 ? "" : i === j - 1 && i === pivot ? "lit" : Math.max(i, j - 1) > pivot ? "gone" : ""));
    };
    draw();
  },
  loop(board, play) {
    const free = evaluator(play.free), held = evaluator(play.held), at = { ...play.values };
    sliders(board, play, at, () => draw());
    const write = grid(board, ["", "free", "held"]);
    const draw = () => {
      const a = free(at), b = held(at);
      write([...play.joints.map((name, i) => [name, digits(a[`qdd${i}`]), digits(b[`qdd${i}`])]),
        ...Object.entries(play.multipliers).map(([name, shown]) => [`λ, ${shown}`, "", digits(b[name])])]);
    };
    draw();
  },
  energy(board, play) {
    const rate = evaluator(play.rate), total = evaluator(play.energy);
    const names = [...numbered("q", play.nq), ...numbered("qd", play.n)];
    let dt = 0.03;
    slider(board, "dt [s]", -3, -0.7, 0.05, Math.log10(dt), (x) => { dt = 10 ** x; draw(); }, (x) => digits(10 ** x));
    const svg = board.appendChild(drawn("svg", { role: "img", "aria-label": "Energy over time", viewBox: "0 0 620 260" }));
    const words = board.appendChild(element("p", { role: "status" }));
    const draw = () => {
      const steps = Math.ceil(play.t_end / dt);
      const curves = ["euler", "rk4"].map((method) => motion(rate, play.values, names, dt, steps, method).map((state) => {
        const at = { ...play.values };
        names.forEach((name, i) => { at[name] = state[i]; });
        return total(at).E;
      }));
      const start = curves[1][0], off = curves.map((curve) => curve.map((e) => Math.abs(e - start)));
      const reach = Math.max(1e-12 * Math.max(1, Math.abs(start)), Math.min(Math.max(...off[0]), 4 * Math.abs(start) + 1e-3));
      const x = (k) => 50 + (560 * k) / steps, y = (e) => 130 - 110 * Math.max(-1.1, Math.min(1.1, (e - start) / reach));
      svg.replaceChildren(
        drawn("line", { x1: 50, x2: 610, y1: 130, y2: 130, class: "axis", "stroke-dasharray": "4 4" }),
        drawn("text", { x: 0, y: 126 }, "E"), drawn("text", { x: 540, y: 255 }, `t = ${digits(play.t_end)} s`),
        ...curves.map((curve, k) => drawn("polyline", { fill: "none", stroke: play.colors[k], "stroke-width": 2,
          points: curve.map((e, i) => `${x(i).toFixed(1)},${y(e).toFixed(1)}`).join(" ") })),
      );
      words.textContent = `Energy at the start ${digits(start)} J; largest change by Euler ${digits(Math.max(...off[0]))} J, ` +
        `by rk4 ${digits(Math.max(...off[1]))} J.`;
    };
    draw();
  },
};

// Coordinates over time, of a model without points: in place of the mechanism in motion.

const COURSE = { width: 420, height: 200, left: 52, right: 10, bottom: 22, most: 5 };
const NAMED = { line: 18, letter: 7, sign: 30 }; // names of curves: a line, a letter, and the sign beside one

/** Places of names of curves beside their signs, in lines as wide as that: [[x, line]]. */
function namesIn(names, wide) {
  let x = 0, line = 0;
  return names.map((name) => {
    const own = NAMED.sign + NAMED.letter * [...name].length;
    if (x && x + own > wide) { x = 0; line += 1; }
    x += own;
    return [x - own, line];
  });
}

/** A view as `armView` has it, or null where nothing moves. */
function courseView(svg, { record, state }) {
  const { t } = record.motion, { width, height, left, right, bottom } = COURSE;
  const moves = (name, values) => name !== "t" && ["q", undefined].includes(KINDS.exec(name)?.[1]) && values.some((value) => value !== values[0]);
  const lines = record.inputs.map((name, i) => ({ name, values: record.rows.map((row) => row[i]) })).filter(({ name, values }) => moves(name, values)).slice(0, COURSE.most);
  if (!lines.length) return null;
  const names = lines.map(({ name }) => state.called.get(name) ?? name), places = namesIn(names, width - left - right), top = 6 + NAMED.line * (places.at(-1)[1] + 1);
  const all = lines.flatMap(({ values }) => values), low = Math.min(...all), high = Math.max(...all);
  const x = (time) => left + (width - left - right) * (time - t[0]) / (t.at(-1) - t[0] || 1), y = (value) => height - bottom - (height - bottom - top) * (value - low) / (high - low);
  filled(svg, { viewBox: `0 0 ${width} ${height}`, "aria-label": `${names.join(", ")} over time` });
  const word = (words, x, y, anchor) => element("text", { x, y, class: `tick ${anchor}` }, svg, words);
  svg.replaceChildren(drawn("path", { class: "grid", d: `M${left} ${top}V${height - bottom}H${width - right}${low < 0 && high > 0 ? `M${left} ${y(0)}H${width - right}` : ""}` }));
  [low, high].forEach((value) => word(brief(value), left - 5, y(value) + 4, "end"));
  [t[0], t.at(-1)].forEach((time, k) => word(`${brief(time)} s`, x(time), height - 6, k ? "end" : "start"));
  lines.forEach(({ values }, k) => {
    element("path", { class: `turn part${k}`, "stroke-width": 2, d: `M${values.map((value, i) => `${x(t[i]).toFixed(1)} ${y(value).toFixed(1)}`).join("L")}` }, svg);
    element("path", { class: `turn part${k}`, "stroke-width": 3, d: `M${left + places[k][0]} ${12 + NAMED.line * places[k][1]}h14` }, svg);
    word(names[k], left + places[k][0] + 18, 16 + NAMED.line * places[k][1], "start");
  });
  const now = element("path", { class: "ground" }, svg), dots = lines.map((_, k) => element("circle", { class: `joint part${k}`, r: 4 }, svg));
  const show = (frame) => {
    now.setAttribute("d", `M${x(t[frame])} ${top}V${height - bottom}`);
    dots.forEach((dot, k) => { dot.setAttribute("cx", x(t[frame])); dot.setAttribute("cy", y(state.get(lines[k].name))); });
  };
  const nothing = () => {}, first = lines.length === COURSE.most ? `The first ${COURSE.most} that move, over time.` : "";
  const how = lines.some(({ name }) => KINDS.exec(name)?.[1] === "q") ? "The model has no bodies to draw. “type L” draws points that a text names x1, y1, x2, y2; from Python, viz.page draws those of its motion." : "";
  const words = [first, how].filter(Boolean).join(" ");
  return { show, mark: nothing, paint: nothing, color: nothing, words };
}

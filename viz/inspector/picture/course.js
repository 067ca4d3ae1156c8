// Coordinates over time, of a model without points: in place of the mechanism in motion.

const COURSE = { width: 420, height: 200, left: 52, right: 10, top: 24, bottom: 22, most: 5 };

/** A view as `armView` has it, or null where nothing moves. */
function courseView(svg, { record, state }) {
  const { t } = record.motion, { width, height, left, right, top, bottom } = COURSE;
  const moves = (name, values) => name !== "t" && ["q", undefined].includes(KINDS.exec(name)?.[1]) && values.some((value) => value !== values[0]);
  const lines = record.inputs.map((name, i) => ({ name, values: record.rows.map((row) => row[i]) })).filter(({ name, values }) => moves(name, values)).slice(0, COURSE.most);
  if (!lines.length) return null;
  const all = lines.flatMap(({ values }) => values), low = Math.min(...all), high = Math.max(...all);
  const x = (time) => left + (width - left - right) * (time - t[0]) / (t.at(-1) - t[0] || 1), y = (value) => height - bottom - (height - bottom - top) * (value - low) / (high - low);
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.setAttribute("aria-label", `${lines.map(({ name }) => state.called.get(name) ?? name).join(", ")} over time`);
  const word = (words, at, foot, anchor) => { element("text", { x: at, y: foot, class: `tick ${anchor}` }, svg).textContent = words; };
  svg.replaceChildren(drawn("path", { class: "grid", d: `M${left} ${top}V${height - bottom}H${width - right}${low < 0 && high > 0 ? `M${left} ${y(0)}H${width - right}` : ""}` }));
  [low, high].forEach((value) => word(brief(value), left - 5, y(value) + 4, "end"));
  [t[0], t.at(-1)].forEach((time, k) => word(`${brief(time)} s`, x(time), height - 6, k ? "end" : "start"));
  lines.forEach(({ name, values }, k) => {
    element("path", { class: `turn part${k}`, "stroke-width": 2, d: `M${values.map((value, i) => `${x(t[i]).toFixed(1)} ${y(value).toFixed(1)}`).join("L")}` }, svg);
    element("path", { class: `turn part${k}`, "stroke-width": 3, d: `M${left + 74 * k} 12h14` }, svg);
    word(fitted(state.called.get(name) ?? name, 8), left + 74 * k + 18, 16, "start");
  });
  const now = element("path", { class: "ground" }, svg), dots = lines.map((_, k) => element("circle", { class: `joint part${k}`, r: 4 }, svg));
  const show = (frame) => {
    now.setAttribute("d", `M${x(t[frame])} ${top}V${height - bottom}`);
    dots.forEach((dot, k) => { dot.setAttribute("cx", x(t[frame])); dot.setAttribute("cy", y(state.get(lines[k].name))); });
  };
  const nothing = () => {};
  return { show, mark: nothing, paint: nothing, color: nothing, words: lines.length === COURSE.most ? `The first ${COURSE.most} that move, over time.` : "" };
}

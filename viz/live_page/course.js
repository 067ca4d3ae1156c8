// The picture of a system without places: its coordinates over time, from where it was set, and where it is now.

const COURSES = 6; // coordinates in the picture
const WIDE = 400, HIGH = 300, EDGE = { left: 58, right: 12, top: 10, bottom: 26 }; // of the picture, and left free for its numbers

/** Round numbers in a range, some four or five of them. */
function courseTicks(low, high) {
  const power = 10 ** Math.floor(Math.log10((high - low) / 2)), step = [5, 2, 1].map((each) => each * power).find((each) => (high - low) / each >= 2.9) ?? power;
  const first = Math.ceil(low / step - 1e-9), many = Math.min(12, Math.floor(high / step + 1e-9) - first + 1);
  return Array.from({ length: Math.max(0, many) }, (_, k) => (first + k) * step);
}

/** Draws the coordinates over the time to come, by the steps and thin by much shorter ones. */
function liveCourse(svg, words, machine, data, state) {
  const among = data.inputs.slice(0, data.states);
  const positions = among.filter(({ group }) => group === "positions").length || data.states;
  const indices = among.slice(0, Math.min(positions, COURSES)).map((_, i) => i);
  const shape = (name, attributes) => element(name, attributes, svg);
  const zero = shape("path", { class: "live-rule" }), now = shape("path", { class: "live-rule live-now" });
  const thin = indices.map(() => shape("path", { class: "live-reference live-line" }));
  const thick = indices.map((i) => shape("path", { class: `live-course live-course-${i} live-line` }));
  const dots = indices.map((i) => shape("circle", { class: `live-joint live-course-${i}`, r: 4 }));
  const axes = shape("g", { class: "live-axes" });
  svg.prepend(axes);
  svg.classList.add("live-plot");
  filled(svg, { viewBox: `0 0 ${WIDE} ${HIGH}`, "aria-label": "coordinates over time, and thin in green the same with much shorter steps" });
  words.classList.add("live-legend");
  const rest = positions - indices.length;
  words.replaceChildren(
    ...indices.map((i) => tag("span", { class: `live-course-${i}` }, data.inputs[i].called)),
    `${rest ? `and ${rest} more ` : ""}over time. Thick: with steps dt. Thin and green: with much shorter steps.`,
  );
  let end = 0, from = 0, across, up;

  /** What comes from here on, and its scale. */
  function look() {
    const rows = machine.course(state.method, state.dt);
    from = state.time;
    end = rows.run.at(-1).time;
    const values = rows.fine.flatMap((row) => indices.map((i) => row.state[i])).filter(Number.isFinite);
    let low = Math.min(...values), high = Math.max(...values);
    if (!(high > low)) [low, high] = [(low || 0) - 1, (high || 0) + 1];
    const right = WIDE - EDGE.right, foot = HIGH - EDGE.bottom;
    across = (time) => EDGE.left + ((right - EDGE.left) * time) / end;
    up = (value) => foot - ((foot - EDGE.top) * (value - low)) / (high - low);
    const line = (i, of) => rows[of].map(({ time, state: at }) => [across(time), up(at[i])])
      .filter(([, y]) => Math.abs(y) < 1e4).map(([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`);
    const path = (points) => (points.length > 1 ? `M${points.join("L")}` : "");
    indices.forEach((i) => { thick[i].setAttribute("d", path(line(i, "run"))); thin[i].setAttribute("d", path(line(i, "fine"))); });
    zero.setAttribute("d", low < 0 && high > 0 ? `M${EDGE.left} ${up(0).toFixed(2)}H${right}` : "");
    axes.replaceChildren(
      drawn("path", { class: "live-rule", d: `M${EDGE.left} ${EDGE.top}V${foot}H${right}` }),
      ...courseTicks(low, high).flatMap((value) => mark(value, `M${EDGE.left - 4} ${up(value)}h4`, EDGE.left - 7, up(value) + 4, "end", "")),
      ...courseTicks(from, from + end).flatMap((time) => mark(time, `M${across(time - from)} ${foot}v4`, across(time - from), HIGH - 7, "middle", " s")),
    );
  }
  /** A tick of an axis and its number. */
  function mark(value, d, x, y, anchor, unit) {
    const text = drawn("text", { class: "live-number", "text-anchor": anchor, x, y }, `${liveNumber(value)}${unit}`);
    return [drawn("path", { class: "live-rule", d }), text];
  }
  /** The picture now; `anew` after something was set. */
  function draw(anew) {
    if (anew || !end || state.time < from || state.time > from + end) look();
    const x = across(state.time - from).toFixed(2);
    now.setAttribute("d", `M${x} ${EDGE.top}V${HIGH - EDGE.bottom}`);
    dots.forEach((dot, i) => {
      const y = up(machine.run[i]), seen = Math.abs(y) < 1e4;
      filled(dot, seen ? { visibility: "visible", cx: x, cy: y.toFixed(2) } : { visibility: "hidden" });
    });
  }
  return draw;
}

// The panel of a live motion: sliders, fields, meters and the moving picture.

const DECADES = [-5, 0]; // of dt on its slider
const KEPT = 240; // instants in the strip of energies
const TRACE = 120; // places of the tip

/** A number with four digits. */
const liveNumber = (value) => (Number.isFinite(value) ? numeral(value, 4) : "—");

function startLive() {
  const data = JSON.parse(byId("live-data").textContent);
  const $ = (id) => byId(`live-${id}`);
  const machine = liveMachine(data, LIVE);
  const motion = liveRun(machine, data);
  const { state } = motion;
  let playing = false, last = 0;
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches ? 500 : 0; // ms between pictures, for who is disturbed by motion
  const strip = [];
  const controls = [];

  // Controls

  function control(i, { called, unit, low, high }) {
    const step = (high - low) / 400;
    const slider = tag("input", { type: "range", min: low, max: high, step, "aria-label": `${called}, slider` });
    const field = tag("input", { type: "number", step: "any", "aria-label": called });
    const take = (text) => { if (text !== "" && motion.set(i, Number(text))) changed(); };
    slider.oninput = () => take(slider.value);
    field.oninput = () => take(field.value);
    controls.push(() => {
      const value = machine.run[i], known = Number.isFinite(value); // a field takes no other, and complains
      if (document.activeElement !== slider) slider.value = known ? value : 0;
      if (document.activeElement !== field) field.value = known ? +value.toPrecision(5) : "";
    });
    return tag("label", { class: "live-control" }, tag("span", {}, called, ...(unit ? [tag("small", {}, ` [${unit}]`)] : [])), slider, field);
  }
  /** Rows [[group, row]] in their groups, which are open where they are short. */
  function grouped(id, all, inside = (rows) => rows) {
    const groups = new Map();
    for (const [group, row] of all) groups.set(group, [...(groups.get(group) ?? []), row]);
    for (const [group, rows] of groups) {
      $(id).append(tag("details", rows.length <= 8 ? { open: "" } : {}, tag("summary", {}, group), ...inside(rows, group)));
    }
  }
  grouped("controls", data.inputs.flatMap((input, i) => (i === data.time ? [] : [[input.group, control(i, input)]])));
  $("method").append(...data.methods.map((name) => tag("option", { value: name }, name)));
  $("method").onchange = () => { state.method = $("method").value; changed(); };
  const setStep = (dt) => { if (dt > 0 && Number.isFinite(dt)) { state.dt = dt; state.owed = 0; changed(); } };
  Object.assign($("dt"), { min: DECADES[0], max: DECADES[1], step: 0.01 });
  $("dt").oninput = () => setStep(+(10 ** $("dt").value).toPrecision(2));
  $("dt-field").oninput = () => setStep(Number($("dt-field").value));
  $("play").onclick = () => play(!playing);
  $("step").onclick = () => { play(false); motion.steps(1); show(); keep(); };
  $("reset").onclick = () => { play(false); motion.reset(); strip.length = 0; changed(); };
  $("link").onclick = () => {
    keep();
    copyLink((copied) => { $("said").textContent = copied ? "Copied." : "The link is in the address bar."; });
  };

  // The link

  let known; // what the address says of it
  const keep = () => { known = motion.link(); keepPart("live", known); };
  function read() {
    const part = linkPart("live");
    if (part === undefined || part === known) return;
    known = part;
    $("said").textContent = motion.open(part) ? "" : "The link has no state that could be read.";
    strip.length = 0;
    anew = true;
    show();
  }
  addEventListener("hashchange", read);
  let waiting = 0;
  function changed() {
    $("said").textContent = "";
    anew = true;
    show();
    clearTimeout(waiting); // browsers allow the address to change a hundred times in half a minute
    waiting = setTimeout(keep, 400);
  }

  // Pictures

  const svg = $("picture"), points = data.parents.length;
  const first = data.meters.length;
  const place = (values, k) => [values[first + 2 * k], -values[first + 2 * k + 1]];
  const count = (data.shownCount - first) / 2 - points, touching = count ? surfaceView(svg, data.radii, count) : null;
  const reference = data.parents.map(() => element("path", { class: "live-reference" }, svg));
  const trace = element("path", { class: "live-trace" }, svg);
  const sticks = data.parents.map(() => element("path", { class: "live-stick" }, svg));
  const joints = data.parents.map(() => element("circle", { class: "live-joint" }, svg));
  let reach = 0;
  const past = [];
  const drawCourse = points ? null : liveCourse(svg, $("words"), machine, data, state);
  let anew = true; // something was set since the picture of a system without places
  function draw({ values, reference: right }) {
    if (drawCourse) { drawCourse(anew); anew = false; return; }
    for (let k = 0; k < points; k++) for (const each of place(values, k)) if (Number.isFinite(each)) reach = Math.max(reach, Math.abs(each));
    const surfaces = Array.from({ length: count }, (_, k) => [values[first + 2 * (points + k)], values[first + 2 * (points + k) + 1]]);
    data.radii.forEach((radius, k) => { for (const each of surfaces[2 * k]) if (Number.isFinite(each)) reach = Math.max(reach, Math.abs(each) + radius); });
    const half = 1.1 * (reach || 1), r = half / 40;
    touching?.(surfaces, 0, 0, half, nice(0.8 * half));
    svg.setAttribute("viewBox", `${-half} ${-half} ${2 * half} ${2 * half}`);
    [[sticks, values, 1.6 * r], [reference, right, 0.7 * r]].forEach(([paths, at, width]) => paths.forEach((path, k) => {
      const [x, y] = place(at, k), parent = data.parents[k];
      const [px, py] = parent < 0 ? [x, y] : place(at, parent);
      filled(path, { d: [x, y, px, py].every(Number.isFinite) ? `M${px} ${py}L${x} ${y}` : "", "stroke-width": width });
    }));
    joints.forEach((circle, k) => {
      const [x, y] = place(values, k);
      filled(circle, Number.isFinite(x) ? { cx: x, cy: y, r, "stroke-width": r / 3 } : { r: 0 });
    });
    if (playing) past.push(place(values, points - 1));
    if (past.length > TRACE) past.shift();
    if (!state.time) past.length = 0;
    const drawn = past.filter((each) => each.every(Number.isFinite));
    filled(trace, { d: drawn.length > 1 ? `M${drawn.map(([x, y]) => `${x} ${y}`).join("L")}` : "", "stroke-width": r / 3 });
  }
  const curves = ["kinetic", "potential", "energy"].map((name) => element("path", { class: `live-${name}` }, $("strip")));
  function drawStrip(values) {
    if (playing || !strip.length) strip.push(values.slice(0, 3));
    if (strip.length > KEPT) strip.shift();
    const all = strip.flatMap((each) => [...each]).filter(Number.isFinite);
    const low = Math.min(0, ...all), high = Math.max(0, ...all), size = high - low || 1;
    curves.forEach((curve, k) => {
      const line = strip.filter((each) => Number.isFinite(each[k])).map((each, i) => `${((300 * i) / KEPT).toFixed(1)} ${(76 - (72 * (each[k] - low)) / size).toFixed(2)}`);
      curve.setAttribute("d", line.length > 1 ? `M${line.join("L")}` : "");
    });
  }

  // Meters

  const cells = data.meters.map(({ called }) => tag("td", { "data-meter": called }));
  grouped("meters", data.meters.map(({ called, unit, group }, k) => (
    [group, tag("tr", {}, tag("th", { scope: "row" }, called), cells[k], tag("td", {}, unit))]
  )), (rows, group) => [...(data.notes[group] ? [tag("p", { class: "live-quiet" }, data.notes[group])] : []), tag("table", {}, tag("tbody", {}, ...rows))]);
  for (const id of ["strip", "energies", "drift-row"]) $(id).toggleAttribute("hidden", data.energy < 0);
  function error(id, { index, most, share }) {
    $(`${id}-bar`).value = share > 0 ? Math.min(1, Math.max(0, (Math.log10(share) + 12) / 12)) : share === 0 ? 0 : 1;
    const { called, unit } = data.inputs[index];
    $(id).textContent = most === most ? `${liveNumber(most)} ${unit} in ${called}` : "no number any more";
    $(id).dataset.large = String(!(share < 0.01));
  }
  function show() {
    const now = motion.now();
    cells.forEach((cell, k) => { cell.textContent = liveNumber(now.meters[k]); });
    error("ahead", now.ahead);
    error("since", now.since);
    $("horizon").textContent = `${liveNumber(now.ahead.seconds)} s ahead`;
    $("drift").textContent = `${liveNumber(now.energyOff)} J`;
    $("clock").textContent = `${state.time.toFixed(2)} s`;
    $("slow").textContent = state.slow ? "Slower than real time: the steps are many." : "";
    controls.forEach((each) => each());
    $("method").value = state.method;
    if (document.activeElement !== $("dt")) $("dt").value = Math.log10(state.dt);
    if (document.activeElement !== $("dt-field")) $("dt-field").value = state.dt;
    draw(now);
    if (data.energy >= 0) drawStrip(now.values);
    if (!now.finite && playing) {
      play(false);
      $("said").textContent = `The motion has left the numbers: dt = ${liveNumber(state.dt)} s is too long for it, or a mass is 0. Reset it.`;
    }
    return now;
  }

  // Time

  function frame(time) {
    if (!playing) return;
    if (time - last >= still) {
      if (motion.advance(Math.min(Math.max(0.1, still / 1000), (time - last) / 1000))) show();
      last = time;
    }
    requestAnimationFrame(frame);
  }
  function play(on) {
    if (on === playing) return;
    playing = on;
    $("play").textContent = playing ? "❚❚ stop" : "▶ run";
    $("play").setAttribute("aria-pressed", String(playing));
    if (playing) { last = performance.now(); requestAnimationFrame(frame); } else keep();
  }
  $("panel").addEventListener("keydown", (event) => event.stopPropagation()); // keys of the page around it
  read();
  show();
  $("panel").dataset.ready = "true";
  globalThis.live = { machine, motion, show, play };
}

// The motion: its instants, played or chosen, and the mechanism in them as sticks.

const FOLLOW = 5; // how much larger than the mechanism its way is where the frame goes with it

const TURN = 1.5 * Math.PI; // what the largest torque is drawn as

/** A view of the motion: functions that draw a frame, mark a joint and paint torques, and words for what is seen. */
function armView(svg, motion) {
  const range = (values) => [values.reduce((a, b) => Math.min(a, b), Infinity), values.reduce((a, b) => Math.max(a, b), -Infinity)];
  const center = (points) => [0, 1].map((k) => { const [a, b] = range(points.map((each) => each[k])); return (a + b) / 2; });
  const middles = motion.points.map(center), { radii = [], surfaces } = motion;
  const round = (i) => radii.flatMap((r, k) => [-r, r].map((off) => surfaces[i][2 * k].map((each) => each + off)));
  const seen = motion.points.map((points, i) => [...points, ...round(i)]); // with the corners of spheres
  const reach = seen.reduce((most, points, i) => points.reduce((far, [x, y]) => (
    Math.max(far, Math.abs(x - middles[i][0]), Math.abs(y - middles[i][1]))), most), 0);
  const [left, right] = range([0, ...seen.flat().map(([x]) => x)]);
  const [low, high] = range([0, ...seen.flat().map(([, y]) => y)]);
  const way = Math.max(right - left, high - low), size = way || 1;
  const follows = way > FOLLOW * 2 * reach;
  const half = follows ? Math.max(1.5 * reach, size / 100) : 0.58 * size;
  svg.replaceChildren();
  svg.setAttribute("aria-label", "the mechanism in motion");
  const r = half / 26, step = nice(0.8 * half);
  const grid = element("path", { class: "grid", "stroke-width": r / 4 }, svg);
  const touching = surfaces ? surfaceView(svg, radii, surfaces[0].length) : () => false;
  if (!surfaces) element("path", { class: "ground", d: `M${-4 * r} 0H${4 * r}`, "stroke-width": r / 2 }, svg);
  const trace = element("path", { class: "trace", "stroke-width": r / 3 }, svg);
  const sticks = motion.parents.map(() => element("path", { class: "stick", "stroke-width": 1.3 * r }, svg));
  const joints = motion.parents.map(() => element("circle", { class: "joint", r, "stroke-width": r / 3 }, svg));
  const turns = element("g", { class: "turns" }, svg);
  const last = motion.parents.length - 1;
  let points = motion.points[0];
  const show = (frame, at = [...motion.points[frame], ...(surfaces?.[frame] ?? [])]) => {
    points = at.slice(0, last + 1);
    const [cx, cy] = follows ? center(points) : [(left + right) / 2, (low + high) / 2];
    svg.setAttribute("viewBox", `${cx - half} ${-cy - half} ${2 * half} ${2 * half}`);
    const floor = touching(at.slice(last + 1), cx, cy, half, step);
    if (follows) grid.setAttribute("d", floor ? "" : lines(cx, cy, 2 * half, step));
    points.forEach(([x, y], i) => {
      const [px, py] = motion.parents[i] < 0 ? [x, y] : points[motion.parents[i]];
      sticks[i].setAttribute("d", `M${px} ${-py}L${x} ${-y}`);
      filled(joints[i], { cx: x, cy: -y });
    });
    const past = motion.points.slice(Math.max(0, frame - 40), frame + 1).map((each) => `${each[last][0]} ${-each[last][1]}`);
    trace.setAttribute("d", `M${past.join("L")}`);
  };
  const mark = (joint) => joints.forEach((each, i) => each.setAttribute("class", i === joint ? "joint marked" : "joint"));
  /** Torques as arcs about their joints, counterclockwise where positive: [[point, [share of the largest, of each part]]]. */
  const paint = (torques) => {
    turns.replaceChildren();
    for (const [point, shares] of torques) shares.forEach((share, k) => {
      const [x, y] = points[point], radius = r * (1.9 + 1.3 * k), turn = share * TURN;
      if (Math.abs(turn) < 0.03) return;
      const at = (angle, far = radius) => `${x + far * Math.sin(-angle)} ${-y - far * Math.cos(-angle)}`;
      const back = turn - Math.sign(turn) * Math.min(0.35, Math.abs(turn));
      element("path", { class: `turn part${k % 7}`, "stroke-width": 0.75 * r,
        d: `M${at(0)}A${radius} ${radius} 0 ${Math.abs(turn) > Math.PI ? 1 : 0} ${turn > 0 ? 0 : 1} ${at(turn)}M${at(back, radius + 0.8 * r)}L${at(turn)}L${at(back, radius - 0.8 * r)}` }, turns);
    });
  };
  const color = (parts) => sticks.forEach((each, i) => each.setAttribute("class", parts && motion.parents[i] >= 0 ? `stick part${motion.parents[i] % 7}` : "stick"));
  return { show, mark, paint, color, words: follows ? `The frame goes with it; the lines stand still, ${+step.toPrecision(1)} m apart.` : "" };
}

/** Lines of the world around a place, a step apart; twice as wide as high, for a wide picture. */
function lines(cx, cy, half, step) {
  const at = (middle) => Array.from({ length: 2 * Math.ceil(half / step) + 1 }, (_, i) => (Math.round(middle / step) + i - Math.ceil(half / step)) * step);
  return [...at(cx).map((x) => `M${x} ${-cy - half}V${-cy + half}`), ...at(cy).map((y) => `M${cx - half} ${-y}H${cx + half}`)].join("");
}

const FPS = globalThis.matchMedia?.("(prefers-reduced-motion: reduce)").matches ? 2 : 30; // few still pictures for who is disturbed by motion
const PARTS = 5; // columns of a table whose numbers are painted at the joints

function makeMotion(app) {
  const { motion } = app.record;
  byId("moving").hidden = !motion;
  app.arm = null;
  if (!motion) return;
  app.arm = motion.points ? armView(byId("arm"), motion) : courseView(byId("arm"), app);
  app.places = motion.places && prepare(motion.places);
  app.largestTorque = 0;
  byId("arm").toggleAttribute("hidden", !app.arm);
  byId("frame").textContent = app.arm?.words ?? "";
  byId("frame").hidden = !app.arm?.words;
  byId("time").max = motion.t.length - 1;
}

function showTime(app) {
  const { motion } = app.record;
  if (!motion) return;
  if (app.arm) {
    app.arm.show(app.state.frame, app.state.edited && app.places ? pointsAt(app) : undefined);
    paintTorques(app);
  }
  byId("time").value = app.state.frame;
  byId("clock").textContent = `${motion.t[app.state.frame].toFixed(2)} s`;
}

/** The points at the state, which a person has changed, and then those of surfaces. */
function pointsAt(app) {
  const values = app.state.evaluate(app.places), found = app.places.outputs.map(([, , node]) => values[node]);
  return Array.from({ length: found.length / 2 }, (_, i) => [found[2 * i], found[2 * i + 1]]);
}

/** Torques of the first table that has a row for every joint, at the joints that turn what is seen: by parts where these
 * are few. */
function paintTorques(app) {
  const { joints = [], turns = [] } = app.record.motion;
  const found = app.state.tables.find((each) => turns.some(Boolean) && each.rows.length === turns.length);
  const parts = found && found.header.length <= PARTS ? found.header.slice(0, -1) : null;
  app.arm.color(parts);
  byId("parts").replaceChildren(...(parts ?? []).map((name, k) => tag("span", { class: `part${k % 7}` }, name)));
  byId("parts").hidden = !parts;
  if (!found) { app.arm.paint([]); return; }
  const values = app.state.evaluate(found);
  const torques = found.rows.map(([, outputs]) => (parts ? outputs.slice(0, -1) : outputs.slice(-1)).map((out) => values[found.outputs[out][2]]));
  app.largestTorque = Math.max(app.largestTorque, largestOf(torques.filter((_, i) => turns[i]).flat()));
  app.arm.paint(torques.map((own, i) => [joints[i], own.map((each) => turns[i] * each / (app.largestTorque || 1))]));
}

function play(app, on) {
  if (app.playing === on || !app.record.motion) return;
  const { motion } = app.record;
  app.playing = on;
  byId("play").textContent = on ? "❚❚ stop" : "▶ play";
  if (!on) { app.refresh(); return; }
  const { t } = motion, last = t.length - 1;
  const began = performance.now() - 1000 * (t[app.state.frame === last ? 0 : app.state.frame] - t[0]);
  let shown = -Infinity;
  const tick = (now) => {
    if (!app.playing) return;
    if (now - shown > 1000 / FPS) {
      shown = now;
      const at = t[0] + (now - began) / 1000;
      let frame = t.findIndex((each) => each >= at);
      if (frame < 0) frame = last;
      app.state.show(frame);
      if (frame === last) { play(app, false); return; }
    }
    requestAnimationFrame(tick);
  };
  requestAnimationFrame(tick);
}

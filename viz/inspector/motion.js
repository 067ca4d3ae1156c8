// The motion: its instants, played or chosen, and the mechanism in them.

const FPS = 30;
const PARTS = 5; // columns of a table whose numbers are painted at the joints

function makeMotion(app) {
  const { motion } = app.record;
  byId("moving").hidden = !motion;
  app.arm = null;
  if (!motion) return;
  byId("arm").toggleAttribute("hidden", !motion.points);
  byId("frame").hidden = !motion.points;
  if (motion.points) {
    app.arm = armView(byId("arm"), motion);
    app.places = motion.places && prepare(motion.places);
    app.largestTorque = 0;
    byId("frame").textContent = app.arm.words;
  }
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

/** The points at the state, which a person has changed. */
function pointsAt(app) {
  const values = app.state.evaluate(app.places), found = app.places.outputs.map(([, , node]) => values[node]);
  return app.record.motion.parents.map((_, i) => [found[2 * i], found[2 * i + 1]]);
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

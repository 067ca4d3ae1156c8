// The motion: its instants, played or chosen, and the mechanism in them.

const FPS = 30;

function makeMotion(app) {
  const { motion } = app.record;
  byId("moving").hidden = !motion;
  app.showArm = () => {};
  if (!motion) return;
  byId("arm").toggleAttribute("hidden", !motion.points);
  byId("frame").hidden = !motion.points;
  if (motion.points) {
    const view = armView(byId("arm"), motion);
    app.showArm = view.show;
    byId("frame").textContent = view.words;
  }
  byId("time").max = motion.t.length - 1;
}

function showTime(app) {
  const { motion } = app.record;
  if (!motion) return;
  app.showArm(app.state.frame);
  byId("time").value = app.state.frame;
  byId("clock").textContent = `${motion.t[app.state.frame].toFixed(2)} s`;
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

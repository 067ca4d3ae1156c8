// Going through a version step by step: what is computed in a step lights up, in the picture and at its joint.

function makeLesson(app) {
  const { steps } = app.version;
  byId("lesson").hidden = !steps.length;
  byId("lessonstep").max = steps.length;
  teach(app, -1);
}

/** Show a step, -1 for none. */
function teach(app, step) {
  const { steps } = app.version;
  app.lesson = Math.max(-1, Math.min(steps.length - 1, step));
  byId("lessonstep").value = app.lesson + 1;
  paintLesson(app);
  app.arm?.mark(app.lesson < 0 ? -1 : app.record.motion.joints[steps[app.lesson].joint] ?? -1);
  tellLesson(app);
}

function tellLesson(app) {
  const { steps } = app.version;
  if (app.lesson < 0) {
    byId("lessonwords").replaceChildren(quiet(`${counted(steps.length, "step")}: first from the tip to the base, then back out.`));
    return;
  }
  const { words, nodes, value } = steps[app.lesson];
  byId("lessonwords").replaceChildren(tag("b", {}, `${app.lesson + 1} of ${steps.length}. `), words, tag("br"),
    quiet(`${told(app, value)} = ${brief(app.values[value], app.noise()[value])}; ${counted(nodes.length, "new node")}.`));
}

function paintLesson(app) {
  clear(app, "lit", "past", "result");
  app.svg.classList.toggle("teaching", app.lesson >= 0);
  if (app.lesson < 0) return;
  const { steps } = app.version, { drawn } = app;
  const mark = (nodes, name) => nodes.forEach((node) => drawn.items.get(drawn.shownBy[node])?.group.classList.add(name));
  steps.slice(0, app.lesson).forEach((step) => mark(step.nodes, "past"));
  mark(steps[app.lesson].nodes, "lit");
  shapesOf(app, steps[app.lesson].value).forEach((item) => item.group.classList.add("result"));
}

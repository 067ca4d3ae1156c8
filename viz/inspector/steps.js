// Going step by step: values come up node by node, then adjoints come down; or what a version explains, in the picture and at its joint.

/** Write values or adjoints at the items, as far as the sweep has come; returns the adjoints, if there are any yet. */
function showValues(app) {
  const { values, sweep, drawn, version } = app, n = values.length;
  const bars = sweep > n ? adjoints(version, app.partials(), app.output(), sweep - n) : null;
  const noise = app.noise();
  drawn.items.forEach((item) => {
    const [node] = item.nodes;
    if (item.group.dataset.node === undefined) {
      const done = sweep < 0 ? 0 : item.nodes.filter((each) => passed(app, each)).length;
      item.value.textContent = sweep < 0 ? item.second : `${done} of ${item.nodes.length}`;
    } else if (sweep >= 0 && sweep <= n) item.value.textContent = node < sweep ? brief(values[node], noise[node]) : "";
    else item.value.textContent = bars ? `∂ ${brief(bars[node])}` : brief(values[node], noise[node]);
  });
  return bars;
}

function stepTo(app, step) {
  const n = app.version.ops.length;
  app.sweep = Math.max(-1, Math.min(2 * n, step));
  byId("sweep").value = Math.max(0, app.sweep);
  const bars = showValues(app), node = nodeAtStep(app);
  if (app.sweep < 0) byId("step").replaceChildren(quiet("Move the slider: first values are computed upward, then adjoints downward."));
  else if (app.sweep === 0) byId("step").textContent = "Before the first node.";
  else if (app.sweep <= n) byId("step").textContent = `forward, ${app.sweep} of ${n}: ${told(app, node)} = ${brief(app.values[node], app.noise()[node])}`;
  else byId("step").textContent = `reverse, ${app.sweep - n} of ${n}: ${told(app, node)} has adjoint ${brief(bars[node])}`;
  paintSweep(app);
}

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
  const { steps } = app.version;
  const mark = (nodes, name) => nodes.forEach((node) => shownAs(app, node)?.group.classList.add(name));
  steps.slice(0, app.lesson).forEach((step) => mark(step.nodes, "past"));
  mark(steps[app.lesson].nodes, "lit");
  shapesOf(app, steps[app.lesson].value).forEach((item) => item.group.classList.add("result"));
}

// Stepping through the sweeps: values come up node by node, then adjoints come down from an output.

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
  if (app.sweep < 0) byId("step").replaceChildren(quiet("Move the slider: values go up, then adjoints come down."));
  else if (app.sweep === 0) byId("step").textContent = "Before the first node.";
  else if (app.sweep <= n) byId("step").textContent = `forward, ${app.sweep} of ${n}: ${told(app, node)} = ${brief(app.values[node], app.noise()[node])}`;
  else byId("step").textContent = `reverse, ${app.sweep - n} of ${n}: ${told(app, node)} has adjoint ${brief(bars[node])}`;
  paintSweep(app);
}

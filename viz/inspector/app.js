// What the page does: switching, folding, hovering, asking why, stepping, moving.

const READABLE = 100; // nodes that are drawn one by one at first; of a larger graph all clusters are folded
const DRAWABLE = 2500; // more than these are never drawn one by one at once
const RESULTS = 60; // outputs in the table beside the picture
const PATHS = 5, DEPTH = 4, FPS = 30;

/** An element around texts and other elements: texts stay texts, whatever is in them. */
function tag(name, attributes = {}, ...inside) {
  const made = document.createElement(name);
  for (const key in attributes) made.setAttribute(key, attributes[key]);
  made.append(...inside);
  return made;
}
const quiet = (words) => tag("p", { class: "quiet" }, words);
const rowHead = (words) => tag("th", { scope: "row" }, words);
const table = (names, rows) => tag("table", {},
  tag("thead", {}, tag("tr", {}, tag("th"), ...names.map((name) => tag("th", { scope: "col" }, name)))), tag("tbody", {}, ...rows));

function start() {
  const data = JSON.parse(document.getElementById("data").textContent);
  data.called = new Map(data.called);
  data.units = new Map(data.units);
  const versions = data.versions.map(prepare);
  const $ = (id) => document.getElementById(id);
  const svg = $("picture");
  const largest = Math.max(...versions.map((version) => version.ops.length));
  const all = () => new Set(data.clusters.map((_, c) => c));
  const atFirst = () => (largest <= READABLE ? new Set() : all());
  const { width, height } = svg.getBoundingClientRect();
  if (width && height) data.aspect = Math.min(2, Math.max(0.5, width / height));
  arrange(data, atFirst()); // settles how columns are broken into bands, for every state of folding
  const state = {
    version: 0, frame: 0, rows: data.versions.map((version) => [...version.rows[0]]), folded: atFirst(),
    picked: -1, before: -1, sweep: -1, output: "", playing: false, path: null, view: null,
  };
  let drawn, values, slopes, show = null;
  const version = () => versions[state.version];
  const outputs = () => version().outputs;
  const shownName = (name, letters) => data.called.get(name) ?? letters ?? name;
  const unitOf = (name) => (data.units.has(name) ? [" ", tag("span", { class: "unit" }, `[${data.units.get(name)}]`)] : []);
  const nameOf = (node) => {
    const [name, letters] = version().names[node] ?? outputs().find(([, , out]) => out === node) ?? [`v${node}`];
    return shownName(name, letters);
  };
  const told = (node) => `${nameOf(node)}${version().args[node].length ? ` (${caption(data, version(), node)})` : ""}`;

  // Values

  function compute() {
    values = evaluate(version(), state.rows[state.version]);
    slopes = null;
  }
  const partials = () => (slopes ??= slopesAt(version(), data.slopes, values));
  const fromNode = () => (outputs().find(([name]) => name === state.output) ?? outputs()[0])[2];

  function showValues() {
    const n = values.length, step = state.sweep;
    const bars = step > n ? adjoints(version(), partials(), fromNode(), step - n) : null;
    drawn.items.forEach((item, id) => {
      const [node] = item.nodes;
      if (item.nodes.length > 1 || id[0] === "c") {
        const done = step < 0 ? 0 : item.nodes.filter((each) => passed(each)).length;
        item.value.textContent = step < 0 ? item.second : `${done} of ${item.nodes.length}`;
      } else if (step >= 0 && step <= n) item.value.textContent = node < step ? brief(values[node]) : "";
      else item.value.textContent = bars ? `∂ ${brief(bars[node])}` : brief(values[node]);
    });
    return bars;
  }
  const passed = (node) => (state.sweep <= values.length ? node < state.sweep : node >= 2 * values.length - state.sweep);

  // Drawing

  function redraw(fit) {
    drawn = draw(svg, data, version(), state.folded);
    if (fit || !state.view) fitView(); else setView(state.view);
    compute();
    refresh();
  }
  function refresh() {
    const bars = showValues();
    paintSweep();
    paintPath();
    mark();
    tell(bars);
    results();
  }
  function setView(view) {
    state.view = view;
    drawn.scene.setAttribute("transform", `translate(${view.x} ${view.y}) scale(${view.k})`);
  }
  function fitView() {
    const { width, height } = svg.getBoundingClientRect();
    const left = -150, wide = drawn.layout.width - left + 20;
    const k = Math.min(1.6, (width || 900) / wide, (height || 600) / (drawn.layout.height + 16));
    setView({ k, x: -left * k + ((width || 900) - wide * k) / 2, y: ((height || 600) - drawn.layout.height * k) / 2 });
  }
  function zoom(factor, x, y) {
    const { k, x: tx, y: ty } = state.view;
    const to = Math.max(0.04, Math.min(6, k * factor));
    setView({ k: to, x: x - (x - tx) * to / k, y: y - (y - ty) * to / k });
  }
  function toggle(c) {
    const before = drawn.layout.boxes[c];
    if (state.folded.has(c)) state.folded.delete(c); else state.folded.add(c);
    redraw(false);
    const { k, x, y } = state.view, after = drawn.layout.boxes[c]; // what was clicked stays where it is
    setView({ k, x: x + (before.x - after.x) * k, y: y + (before.y - after.y) * k });
    announce();
  }
  function foldAll(folded) {
    state.folded = folded ? all() : new Set();
    redraw(true);
    announce();
  }
  function announce() {
    const one = [...drawn.items.values()].filter((item) => item.group.dataset.node !== undefined && !item.output).length;
    const constants = version().constants.size;
    $("trail").textContent = `${one} of ${version().counts[0] - constants} nodes unfolded`
      + `${constants ? `; ${constants} constant${constants > 1 ? "s" : ""}` : ""}`;
  }

  // Marks

  const clear = (...names) => names.forEach((name) => svg.querySelectorAll(`.${name}`).forEach((each) => each.classList.remove(name)));

  /** Give an element its part in the trace, "ancestor", "descendant", "on" or ""; only what changes is touched. */
  function part(element, name) {
    const old = element.dataset.part ?? "";
    if (old !== name) element.dataset.part = name;
  }
  function trace(id) {
    const item = drawn.items.get(id);
    svg.classList.toggle("tracing", Boolean(item) || Boolean(state.path));
    if (!item) {
      drawn.items.forEach((each) => part(each.group, ""));
      for (const { path } of drawn.arrows) part(path, "");
      return;
    }
    const up = new Uint8Array(values.length), down = new Uint8Array(values.length);
    if (item.output) reach(version().args, item.nodes[0]).forEach((yes, i) => { up[i] |= yes; });
    else for (const node of item.nodes) {
      if (!up[node] || item.nodes.length === 1) reach(version().args, node).forEach((yes, i) => { up[i] |= yes; });
      if (!down[node] || item.nodes.length === 1) reach(version().users, node).forEach((yes, i) => { down[i] |= yes; });
    }
    drawn.items.forEach((each, other) => {
      if (other === id) { part(each.group, "on"); return; }
      const above = each.nodes.some((node) => down[node]) && !(item.output && each.output);
      const below = !each.output && each.nodes.some((node) => up[node]);
      part(each.group, below ? "ancestor" : above ? "descendant" : "");
    });
    for (const { path, to, pairs } of drawn.arrows) {
      const out = to[0] === "o";
      const below = !(out && to !== id) && pairs.some(([, t]) => up[t]) && (!out || item.output);
      const above = !item.output && pairs.some(([s]) => down[s]);
      part(path, below ? "ancestor" : above ? "descendant" : "");
    }
  }
  function mark() {
    clear("picked");
    for (const node of [state.picked, state.before]) shapesOf(node).forEach((item) => item.group.classList.add("picked"));
  }
  /** What shows a node: itself or the box that it is in, and the outputs that it is. */
  function shapesOf(node) {
    const named = outputs().filter(([, , out]) => out === node).map(([name]) => `o${name}`);
    return [drawn.shownBy[node], ...named].map((id) => drawn.items.get(id)).filter(Boolean);
  }
  function paintSweep() {
    clear("current", "done");
    svg.classList.toggle("stepping", state.sweep >= 0);
    if (state.sweep < 0) return;
    drawn.items.forEach((item) => { if (item.nodes.some(passed)) item.group.classList.add("done"); });
    const node = currentNode();
    if (node >= 0) drawn.items.get(drawn.shownBy[node])?.group.classList.add("current");
  }
  const currentNode = () => (state.sweep <= values.length ? state.sweep - 1 : 2 * values.length - state.sweep);

  function paintPath() {
    clear("onpath");
    svg.classList.toggle("tracing", Boolean(state.path));
    if (!state.path) return;
    const last = state.path.at(-1);
    state.path.slice(0, -1).forEach((node) => drawn.items.get(drawn.shownBy[node])?.group.classList.add("onpath"));
    shapesOf(last).forEach((item) => item.group.classList.add("onpath"));
    const steps = new Set([...state.path.slice(1).map((node, i) => `${state.path[i]} ${node}`), `${last} ${last}`]); // to an output
    for (const { path, pairs } of drawn.arrows) {
      if (pairs.some(([s, t]) => steps.has(`${s} ${t}`))) path.classList.add("onpath");
    }
  }

  // Words beside the picture

  function tell(bars) {
    const node = state.picked;
    if (node < 0) $("node").replaceChildren(quiet("Click a node to see its equation and value. Click a box to unfold it."));
    else {
      const [tags, role] = version().labels[version().label[node]];
      const wrong = version().marked.has(node);
      const bar = bars ?? adjoints(version(), partials(), fromNode());
      const words = [`n${node}, ${version().ops[node]}, ${wrong ? `spurious, ${role}` : role}`,
        ...(tags.length ? [tag("br"), `tags: ${tags.join(", ")}`] : []), tag("br"),
        `value ${brief(values[node])}, ∂${nameOf(fromNode())} by it ${brief(bar[node])}`];
      $("node").replaceChildren(tag("div", { class: "scroll" }, equation(version(), node, DEPTH)), tag("p", {}, ...words));
    }
    why();
  }
  function why() {
    let [a, b] = [state.before, state.picked];
    if (a < 0 || b < 0) {
      $("why").replaceChildren(quiet("Click two nodes, such as an input and an output: how many paths lead from one to the other, and which weigh most?"));
      return;
    }
    if (a > b) [a, b] = [b, a];
    const count = pathCount(version(), a, b);
    const head = tag("p", {}, tag("b", {}, nameOf(a)), " → ", tag("b", {}, nameOf(b)), `: ${digits(count)} path${count === 1n ? "" : "s"}`);
    $("why").replaceChildren(head);
    if (!count) { head.append("; the one does not depend on the other."); return; }
    const bars = adjoints(version(), partials(), b);
    const found = heaviest(version(), partials(), a, b, PATHS);
    head.append(`. The derivative here is ${brief(bars[a])}, the sum of their products of partials.`,
      ` ${found.length ? "The heaviest:" : "Here a partial on each is zero."}`);
    found.forEach(({ nodes, product }) => {
      const button = document.createElement("button");
      const crossed = nodes.filter((node) => version().marked.has(node)).length;
      button.type = "button";
      button.className = `path${state.path && state.path.join() === nodes.join() ? " on" : ""}`;
      button.textContent = `${brief(product)}: ${shortened(nodes).join(" → ")}${crossed ? `  (${crossed} spurious)` : ""}`;
      button.onclick = () => { state.path = state.path?.join() === nodes.join() ? null : nodes; paintPath(); why(); };
      $("why").append(button);
    });
  }
  function shortened(nodes) {
    const words = nodes.map(told);
    return words.length <= 8 ? words : [...words.slice(0, 4), "…", ...words.slice(-3)];
  }
  function results() {
    const names = [...new Set(versions.flatMap((each) => each.outputs.map(([name]) => name)))];
    const more = names.splice(RESULTS).length;
    const found = versions.map((each, i) => {
      const own = i === state.version ? values : evaluate(each, state.rows[i]);
      return new Map(each.outputs.map(([name, , node]) => [name, own[node]]));
    });
    const pretty = new Map(versions.flatMap((each) => each.outputs.map(([name, letters]) => [name, shownName(name, letters)])));
    const right = versions.findLastIndex((each) => !each.marked.size && versions.some((other) => other.marked.size));
    const rows = names.map((name) => tag("tr", {}, tag("th", { scope: "row" }, pretty.get(name), ...unitOf(name)), ...found.map((each, i) => {
      const value = each.get(name), truth = right < 0 ? value : found[right].get(name);
      const off = value !== undefined && truth !== undefined && Math.abs(value - truth) > 0.01 * Math.max(0.1, Math.abs(truth));
      return tag("td", { class: off ? "off" : "" }, value === undefined ? "" : (value && Math.abs(value) < 5e-4 ? "≈0" : brief(value)));
    })));
    $("results").replaceChildren(tag("div", { class: "scroll" }, table(versions.map((each) => each.name), rows)),
      ...(more ? [quiet(`${more} more outputs are in the picture.`)] : []),
      ...(right < 0 ? [] : [quiet(`In vermillion: differs from ${versions[right].name}.`)]));
  }
  function counts() {
    const rows = versions.map((each) => tag("tr", {}, rowHead(each.name),
      ...[...each.counts, each.marked.size].map((count) => tag("td", {}, String(count)))));
    const ops = new Map();
    version().ops.forEach((op) => { ops.set(op, (ops.get(op) ?? 0) + 1); });
    const kinds = [...ops].sort((a, b) => b[1] - a[1]).map(([op, many]) => `${op} ${many}`);
    $("counts").replaceChildren(table(["nodes", "edges", "spurious"], rows),
      quiet(`Constants (${version().constants.size}) are written where they are used. ${kinds.join(", ")}.`));
  }
  function inputs() {
    const rows = version().inputs.map(([name], i) => {
      const field = tag("input", { type: "number", step: "any", "aria-label": shownName(name) });
      field.value = +state.rows[state.version][i].toPrecision(5);
      field.onchange = () => {
        if (!Number.isFinite(field.valueAsNumber)) return;
        play(false);
        state.rows[state.version][i] = field.valueAsNumber;
        compute();
        refresh();
      };
      return tag("tr", {}, tag("td", {}, shownName(name), ...unitOf(name)), tag("td", {}, field));
    });
    $("inputs").replaceChildren(tag("div", { class: "scroll" }, tag("table", {}, tag("tbody", {}, ...rows))));
  }
  function legend() {
    const kinds = [["input", "input"], ["primal", "as written"], ["adjoint", "adjoint: reverse"], ["tangent", "tangent: forward"], ["several", "several roles"], ["wrong", "spurious"]];
    const present = new Set(version().labels.map(([, role]) => role));
    if (version().marked.size) present.add("wrong");
    $("legend").replaceChildren(...kinds.filter(([kind]) => present.has(kind)).map(([kind, words]) => tag("span", { class: kind }, words)));
  }

  // Choices

  function pick(node) {
    if (node === state.picked) return;
    state.before = state.picked;
    state.picked = node;
    state.path = null;
    refresh();
    if (state.before >= 0) {
      const [a, b] = [Math.min(state.before, node), Math.max(state.before, node)];
      state.path = heaviest(version(), partials(), a, b, 1)[0]?.nodes ?? null;
      paintPath();
      why();
    }
  }
  function choose(i) {
    if (!versions[i]) return;
    const keep = (node) => (node < 0 ? -1 : versions[i].place.indexOf(version().place[node]));
    const [picked, before] = [keep(state.picked), keep(state.before)];
    Object.assign(state, { version: i, picked, before, path: null, sweep: -1 });
    [...$("versions").children].forEach((button, k) => {
      button.setAttribute("aria-checked", k === i);
      button.tabIndex = k === i ? 0 : -1;
    });
    $("about").textContent = version().about;
    $("about").hidden = !$("about").textContent;
    $("about").classList.toggle("flawed", version().marked.size > 0);
    $("sweep").max = 2 * version().ops.length;
    $("from").replaceChildren(...outputs().map(([name, letters]) => tag("option", { value: name }, shownName(name, letters))));
    if (outputs().some(([name]) => name === state.output)) $("from").value = state.output;
    redraw(!state.view);
    legend();
    counts();
    inputs();
    stepTo(-1);
    announce();
  }
  function stepTo(step) {
    const n = version().ops.length;
    state.sweep = Math.max(-1, Math.min(2 * n, step));
    $("sweep").value = Math.max(0, state.sweep);
    const node = currentNode();
    if (state.sweep < 0) $("step").replaceChildren(tag("span", { class: "quiet" }, "Move the slider: values go up, then adjoints come down."));
    else if (state.sweep === 0) $("step").textContent = "Before the first node.";
    else {
      const forward = state.sweep <= n;
      $("step").textContent = `${forward ? "forward" : "reverse"}, ${forward ? state.sweep : state.sweep - n} of ${n}: ${told(node)} `
        + `${forward ? `= ${brief(values[node])}` : `has adjoint ${brief(adjoints(version(), partials(), fromNode(), state.sweep - n)[node])}`}`;
    }
    showValues();
    paintSweep();
  }
  function find(text) {
    clear("found");
    const wanted = text.trim().toLowerCase();
    if (!wanted) { announce(); return null; }
    const hits = [];
    version().ops.forEach((op, node) => {
      if (version().constants.has(node)) return;
      const [tags, role] = version().labels[version().label[node]];
      const names = version().names[node] ?? [];
      const words = [...names, ...names.map((name) => shownName(name)), ...tags];
      const hit = words.some((word) => word.toLowerCase().includes(wanted)) || [`n${node}`, op, role].includes(wanted)
        || (wanted === "spurious" && version().marked.has(node));
      if (hit) hits.push(node);
    });
    outputs().forEach(([name, shown, node]) => {
      if ([name, shown, shownName(name)].some((each) => each.toLowerCase().includes(wanted))) {
        drawn.items.get(`o${name}`).group.classList.add("found");
        hits.push(node);
      }
    });
    new Set(hits.map((node) => drawn.shownBy[node])).forEach((id) => drawn.items.get(id)?.group.classList.add("found"));
    $("trail").textContent = `${hits.length} node${hits.length === 1 ? "" : "s"} found`;
    return hits[0] ?? null;
  }
  function center(node) {
    const at = drawn.items.get(drawn.shownBy[node])?.at;
    if (!at) return;
    const { width, height } = svg.getBoundingClientRect();
    const x = state.view.x + (at.x + at.w / 2) * state.view.k, y = state.view.y + (at.y + at.h / 2) * state.view.k;
    if (x < 40 || y < 40 || x > width - 40 || y > height - 40) {
      setView({ ...state.view, x: state.view.x + width / 2 - x, y: state.view.y + height / 2 - y });
    }
  }
  function go(key) {
    const node = state.picked >= 0 ? state.picked : outputs()[0][2];
    if (state.picked < 0) { pick(node); center(node); return; }
    const here = drawn.items.get(drawn.shownBy[node]);
    const next = {
      ArrowUp: () => version().users[node][0],
      ArrowDown: () => version().args[node].find((arg) => !version().constants.has(arg)),
      ArrowLeft: () => beside(here, -1), ArrowRight: () => beside(here, 1),
    }[key]();
    if (next === undefined) return;
    state.picked = -1; // so that walking does not ask why
    state.before = -1;
    pick(next);
    center(next);
    trace(drawn.shownBy[next]);
  }
  function beside(here, way) {
    let best, least = Infinity;
    drawn.items.forEach((item) => {
      const dx = (item.at.x + item.at.w / 2 - here.at.x - here.at.w / 2) * way;
      const dy = Math.abs(item.at.y + item.at.h / 2 - here.at.y - here.at.h / 2);
      if (item !== here && !item.output && dx > 1 && dx + 6 * dy < least) { least = dx + 6 * dy; [best] = item.nodes; }
    });
    return best;
  }

  // Motion

  function showFrame(frame) {
    state.frame = frame;
    show(frame);
    $("time").value = frame;
    $("clock").textContent = `${data.motion.t[frame].toFixed(2)} s`;
    versions.forEach((each, i) => { state.rows[i] = [...each.rows[frame]]; });
    compute();
    const bars = showValues();
    results();
    if (!state.playing) { inputs(); tell(bars); }
  }
  function play(on) {
    if (!data.motion || state.playing === on) return;
    state.playing = on;
    $("play").textContent = on ? "❚❚ stop" : "▶ play";
    if (!on) { showFrame(state.frame); return; }
    const { t } = data.motion, last = t.length - 1;
    const began = performance.now() - 1000 * (t[state.frame === last ? 0 : state.frame] - t[0]);
    let shown = -Infinity;
    const tick = (now) => {
      if (!state.playing) return;
      if (now - shown > 1000 / FPS) {
        shown = now;
        const at = t[0] + (now - began) / 1000;
        let frame = t.findIndex((each) => each >= at);
        if (frame < 0) frame = last;
        showFrame(frame);
        if (frame === last) { play(false); return; }
      }
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }

  // Events

  versions.forEach((each, i) => {
    const button = document.createElement("button");
    Object.assign(button, { type: "button", textContent: each.name, onclick: () => choose(i) });
    button.setAttribute("role", "radio");
    if (each.marked.size) button.className = "flawed";
    $("versions").append(button);
  });
  $("versions").hidden = versions.length < 2;
  let hold = null;
  const itemAt = (event) => event.target.closest?.(".item");
  svg.addEventListener("pointerover", (event) => { if (!hold) trace(itemAt(event)?.id); });
  svg.addEventListener("pointerleave", () => trace(null));
  svg.addEventListener("pointerdown", (event) => { hold = { x: event.clientX, y: event.clientY, view: state.view, moved: false }; });
  svg.addEventListener("pointermove", (event) => {
    if (!hold) return;
    const [dx, dy] = [event.clientX - hold.x, event.clientY - hold.y];
    if (!hold.moved && Math.hypot(dx, dy) < 5) return;
    if (!hold.moved) svg.setPointerCapture(event.pointerId); // before, a click would go to the whole picture
    hold.moved = true;
    setView({ ...hold.view, x: hold.view.x + dx, y: hold.view.y + dy });
  });
  svg.addEventListener("pointercancel", () => { hold = null; });
  svg.addEventListener("pointerup", () => { setTimeout(() => { hold = null; }); });
  svg.addEventListener("click", (event) => {
    if (hold?.moved) return;
    const over = event.target.closest("[data-cluster], [data-node]");
    if (over?.dataset.cluster !== undefined) toggle(+over.dataset.cluster);
    else if (over) pick(+over.dataset.node);
  });
  svg.addEventListener("wheel", (event) => {
    event.preventDefault();
    const at = svg.getBoundingClientRect();
    zoom(Math.exp(-event.deltaY * 0.0015), event.clientX - at.left, event.clientY - at.top);
  }, { passive: false });
  $("fold").onclick = () => foldAll(true);
  $("unfold").onclick = () => foldAll(false);
  $("unfold").disabled = largest > DRAWABLE;
  if (largest > DRAWABLE) $("unfold").title = `more than ${DRAWABLE} nodes: unfold clusters one by one`;
  if (!data.clusters.length) $("fold").disabled = $("unfold").disabled = true;
  $("fit").onclick = fitView;
  $("theme").onclick = () => {
    const root = document.documentElement;
    const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
  };
  $("search").oninput = () => find($("search").value);
  $("search").onkeydown = (event) => {
    if (event.key !== "Enter") return;
    const node = find($("search").value);
    if (node === null) return;
    const [c] = data.places[version().place[node]];
    if (c >= 0 && state.folded.has(c)) toggle(c);
    pick(node);
    center(node);
    find($("search").value);
  };
  $("sweep").oninput = () => stepTo(+$("sweep").value);
  $("back").onclick = () => stepTo(state.sweep - 1);
  $("on").onclick = () => stepTo(state.sweep + 1);
  $("nosweep").onclick = () => stepTo(-1);
  $("from").onchange = () => { state.output = $("from").value; refresh(); stepTo(state.sweep); };
  $("play").onclick = () => play(!state.playing);
  $("time").oninput = () => { play(false); showFrame(+$("time").value); };
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") {
      document.activeElement?.blur?.();
      $("search").value = "";
      clear("found");
      Object.assign(state, { picked: -1, before: -1, path: null });
      stepTo(-1);
      trace(null);
      refresh();
      return;
    }
    if (event.target.closest("input, select, textarea") || event.ctrlKey || event.metaKey || event.altKey) return;
    const { key } = event;
    if (event.target.closest("button, summary") && (key === " " || key === "Enter")) return;
    const actions = {
      "/": () => $("search").focus(), " ": () => play(!state.playing), f: () => foldAll(true),
      u: () => { if (!$("unfold").disabled) foldAll(false); }, 0: fitView, "[": () => stepTo(state.sweep - 1), "]": () => stepTo(state.sweep + 1),
      "+": () => zoom(1.25, svg.clientWidth / 2, svg.clientHeight / 2), "-": () => zoom(0.8, svg.clientWidth / 2, svg.clientHeight / 2),
      Enter: () => { if (state.picked >= 0) { const [c] = data.places[version().place[state.picked]]; if (c >= 0) toggle(c); } },
    };
    if (key.startsWith("Arrow")) go(key);
    else if (key >= "1" && key <= "9") choose(+key - 1);
    else if (actions[key]) actions[key]();
    else return;
    event.preventDefault();
  });
  addEventListener("resize", fitView);

  $("introduction").textContent = data.introduction;
  $("introduction").hidden = !data.introduction;
  $("tables").hidden = !$("tables").querySelector("table");
  if (data.motion) {
    $("moving").hidden = false;
    if (data.motion.points) {
      const view = armView($("arm"), data.motion);
      show = view.show;
      $("frame").textContent = view.words;
    } else { $("arm").remove(); show = () => {}; }
    const frame = Math.floor(data.motion.t.length / 4); // where it is on its way: at rest many products are 0
    $("time").max = data.motion.t.length - 1;
    choose(0);
    showFrame(frame);
  } else choose(0);
}

// Figure 10, live: modules dragged onto an arm and off it, and the torques that hold it, by one kernel at every row.

/** The arm of the element's data. */
function hangModules({ kinds, world, first }) {
  const picture = byId("assembly"), bodies = byId("bodies"), ghost = byId("ghost"), rows = [], NEAR = 60; // of the picture: 0.2 m
  let taken = null; // what is dragged: the row that it is, or its kind
  const shown = ([x, y, z]) => [300 * (x + 0.4 * y), -300 * (z + 0.25 * y)];
  const end = ({ place, tip }) => shown([0, 1, 2].map((i) => place[9 + i] + tip.reduce((sum, each, j) => sum + each * place[3 * j + i], 0)));
  const under = ({ clientX, clientY }) => new DOMPoint(clientX, clientY).matrixTransform(picture.getScreenCTM().inverse());

  /** A kernel at a row: from blocks of it, and of what carries it, to blocks of both. */
  function run({ evaluate, reads, writes, adds }, row) {
    const y = evaluate(reads.flatMap(([carrier, block]) => [...(carrier ? row.on : row)[block]]));
    let at = 0;
    for (const [block, count] of writes) row[block] = y.slice(at, at += count);
    for (const block of adds) row.on[block] = row.on[block].map((each) => each + y[at++]);
  }
  function show(fit = true) {
    for (const row of rows) for (const kernel of KERNELS.out) run(kernel, row);
    for (const row of [...rows].reverse()) run(KERNELS.in, row);
    const most = Math.max(1e-9, ...rows.map(({ tau }) => Math.abs(tau[0])));
    for (const row of rows) {
      const [[x1, y1], [x2, y2]] = [shown(row.place.slice(9, 12)), end(row)], [torque] = row.tau;
      filled(row.stick, { x1, y1, x2, y2 });
      filled(row.joint, { cx: x1, cy: y1 });
      filled(row.bar, { x1, y1, x2: x1, y2: y1 - (80 * Math.abs(torque)) / most });
      Object.assign(row.told, { value: torque, textContent: `${numeral(torque, 4)} N m` });
    }
    const { x, y, width, height } = bodies.getBBox(), w = Math.max(560, width + 160), h = Math.max(330, height + 120);
    if (fit) picture.setAttribute("viewBox", `${x + (width - w) / 2} ${y + (height - h) / 2} ${w} ${h}`);
    byId("counted").textContent = `${rows.length} row${rows.length === 1 ? "" : "s"}, one kernel: nothing was derived or compiled for this arm.`;
  }
  /** One row more: its numbers are those of a module on what carries it. */
  function attach(kind, on = rows.at(-1) ?? world, angle = 0) {
    const row = { kind, on, tip: kinds.bend[kind].slice(9, 12), numbers: kinds[kind][on.kind], q: [angle], u: [0], a: [0], tau: [0], told: tag("data"), group: element("g", {}, bodies) };
    const slider = tag("input", { type: "range", min: -3.14, max: 3.14, step: 0.01, value: angle, "aria-label": `angle of ${kind}` });
    const off = tag("button", { type: "button", "aria-label": `take off ${kind}` }, "off");
    slider.oninput = () => { row.q = [slider.valueAsNumber]; show(false); };
    slider.onchange = () => show();
    off.onclick = () => { detach(row); show(); };
    row.group.onpointerdown = (event) => { taken = { row, from: under(event) }; };
    row.line = tag("tr", {}, tag("th", { scope: "row" }, kind), ...[slider, row.told, off].map((each) => tag("td", {}, each)));
    row.stick = element("line", { class: `link${Object.keys(kinds).indexOf(kind)}` }, row.group);
    [row.bar, row.joint] = [element("line", { class: "torque" }, row.group), element("circle", { r: 7 }, row.group)];
    byId("rows").append(row.line);
    rows.push(row);
    show();
  }
  /** Without a row, and all that it carries. */
  function detach(row) {
    rows.filter(({ on }) => on === row).forEach(detach);
    rows.splice(rows.indexOf(row), 1);
    row.line.remove();
    row.group.remove();
  }

  for (const kind in kinds) {
    const button = byId("shelf").appendChild(tag("button", { type: "button" }, `${kind}, ${kinds[kind][world.kind][13]} kg`));
    button.onpointerdown = () => { taken = { kind }; };
    button.onclick = () => attach(kind);
  }
  addEventListener("pointermove", (event) => {
    if (!taken) return;
    const here = under(event), { row, from } = taken;
    if (row && Math.hypot(here.x - from.x, here.y - from.y) > NEAR) {
      taken = { kind: row.kind };
      detach(row);
      show();
    }
    const far = (each) => Math.hypot(here.x - end(each)[0], here.y - end(each)[1]);
    [taken.on] = [...rows, world].filter((each) => far(each) < NEAR).sort((a, b) => far(a) - far(b));
    const [x1, y1] = taken.on ? end(taken.on) : [here.x - 40, here.y];
    filled(ghost, { x1, y1, x2: here.x, y2: here.y, visibility: taken.row ? "hidden" : "visible" });
  });
  const drop = ({ type }) => {
    if (taken?.on && taken.kind && type === "pointerup") attach(taken.kind, taken.on);
    taken = null;
    ghost.setAttribute("visibility", "hidden");
  };
  for (const event of ["pointerup", "pointercancel"]) addEventListener(event, drop);
  for (const [kind, angle] of first) attach(kind, rows.at(-1), angle);
}

if (byId("modules")) hangModules(JSON.parse(byId("modules").textContent));

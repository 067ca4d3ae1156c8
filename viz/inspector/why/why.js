// Why: what makes an output, or its dependence on something, by cause and body with a bar each; then along which paths.

const PATHS = 5;

/** A bar from the middle, to the right for what is positive, as long as the part is of the longest. */
function causeBar(part, longest) {
  const long = longest ? 50 * Math.abs(part) / longest : 0;
  const bar = tag("span");
  Object.assign(bar.style, { width: `${long}%`, marginLeft: `${part < 0 ? 50 - long : 50}%` });
  return tag("td", { class: "causebar", "aria-hidden": "true" }, bar);
}
const causeRow = (kind, words, part, longest) => tag("tr", { class: kind }, rowHead(words), tag("td", {}, brief(part)), longest === null ? tag("td") : causeBar(part, longest));

const BODIES = 6; // of a cause that are listed

/** A table of causes with bars, and what they add up to. */
function causeTable(what, unit, parts, whole) {
  const groups = groupedCauses(parts), rows = [];
  const longest = Math.max(0, ...groups.flatMap(([, total, bodies]) => [total, ...bodies.map(([, part]) => part)]).map(Math.abs));
  for (const [cause, total, bodies] of groups) {
    const kind = cause === SPURIOUS ? "cause wrong" : "cause", one = bodies.length === 1;
    rows.push(causeRow(kind, one ? `${cause} ${bodies[0][0]}`.trim() : cause, total, longest));
    if (one) continue;
    const rest = bodies.slice(BODIES);
    bodies.slice(0, BODIES).forEach(([body, part]) => rows.push(causeRow("ofbody", body, part, longest)));
    if (rest.length) rows.push(causeRow("ofbody", `of ${rest.length} more`, addedUp(rest), longest));
  }
  const size = sizeOf(parts), told = (value) => brief(value, LEAST * size);
  if (!size) return [tag("p", {}, tag("b", {}, what), " is 0, and so is every part of it here.")];
  rows.push(causeRow("sum", "sum", Math.abs(addedUp(parts)) > LEAST * size ? addedUp(parts) : 0, null));
  const off = Math.abs(addedUp(parts) - whole) > 1e-9 * size ? quiet(`They add up to ${told(addedUp(parts))}, and it is ${told(whole)}.`) : "";
  const [wrong, step] = [SPURIOUS, STEP].map((name) => groups.find(([cause]) => cause === name)?.[1]);
  const right = told(whole - wrong - (step ?? 0));
  const said = wrong === undefined ? "" : tag("p", { class: "off" }, "What is spurious is no physics, but a mistake of the formulation. "
    + `Without it${step === undefined ? "" : `, and without the ${STEP}, which vanishes with dt`}: ${right}${unit}.`);
  return [tag("p", {}, tag("b", {}, what), ` is ${told(whole)}${unit}, the sum of`),
    tag("table", { class: "causes" }, tag("tbody", {}, ...rows)), off, said].filter(Boolean);
}

/** One cause in every output: a row each. */
function oneCause(app, cause, by) {
  const rows = [], { version } = app, slopes = app.partials();
  for (const [name, letters, node] of version.outputs) {
    const whole = by < 0 ? app.values[node] : adjoints(version, slopes, node)[by];
    const parts = causesOf(app, name, by, whole);
    const part = addedUp(parts?.filter(([each]) => each === cause || causeIn(each) === cause) ?? []);
    if (part) rows.push([`${by < 0 ? "" : "∂"}${shownName(app, name, letters)}`, part]);
  }
  const longest = Math.max(0, ...rows.map(([, part]) => Math.abs(part)));
  const head = tag("p", {}, tag("b", {}, cause), by < 0 ? " in every output" : ` in what every output depends on ${nameOf(app, by)} by`);
  return [head, tag("table", { class: "causes" }, tag("tbody", {}, ...rows.map(([name, part]) => causeRow(cause === SPURIOUS ? "cause wrong" : "cause", name, part, longest))))];
}

/** The question in words: what to explain, an output or a cause, and by what it depends on. */
function askWhy(app) {
  const { version, state } = app, option = (value, words) => tag("option", { value }, words);
  const outputs = version.outputs.map(([name, letters, node]) => option(String(node), shownName(app, name, letters)));
  const kinds = state.causes && version.outputs.some(([name]) => state.causes.rows.some(([row]) => row === name))
    ? [...new Set([...state.causes.header.flatMap((name) => [causeIn(name), name]), ...(version.excess ? [SPURIOUS] : [])])] : [];
  const what = tag("select", { "aria-label": "what to explain" }, option("", "…"), ...outputs,
    ...(kinds.length ? [tag("optgroup", { label: "causes" }, ...kinds.map((kind) => option(`=${kind}`, kind)))] : []));
  const named = new Map([...Object.entries(version.names).map(([node, [name]]) => [name, +node]), ...version.inputs]);
  const by = tag("select", { "aria-label": "by what it depends on" }, option("-1", "its value"),
    ...state.names.filter((name) => named.has(name)).map((name) => option(String(named.get(name)), `by ${shownName(app, name)}`)));
  const ask = () => {
    const asked = what.value.startsWith("=") ? what.value.slice(1) : "", node = asked || !what.value ? -1 : +what.value;
    Object.assign(app, { cause: asked, by: +by.value, picked: node, before: node < 0 ? -1 : +by.value, path: null });
    if (app.before >= 0 && node >= 0) app.path = heaviest(version, app.partials(), app.before, node, 1)[0]?.nodes ?? null;
    refresh(app);
  };
  what.onchange = by.onchange = ask;
  app.asking = { version, what, by, answer: tag("div", { "aria-live": "polite" }) };
  byId("why").replaceChildren(tag("div", { class: "row" }, "why", what, by), app.asking.answer);
}

/** The bodies, or other tags, that a path passes, in order; neighbors of the same are one. */
function bodiesOn(version, nodes) {
  const tags = nodes.slice(1).map((node) => version.labels[version.label[node]][0].filter((each) => !ENERGIES.includes(each)).join(", "));
  return tags.filter((each, i) => each && each !== tags[i - 1]);
}

function showWhy(app) {
  if (app.asking?.version !== app.version) { askWhy(app); app.cause = ""; }
  const { version } = app, { what, by, answer } = app.asking;
  if (app.picked >= 0) app.cause = "";
  const [a, b] = app.before < 0 ? [-1, app.picked] : [app.before, app.picked].sort((one, other) => one - other);
  if (!app.cause) { what.value = String(b); by.value = String(a); }
  if (what.selectedIndex < 0) what.value = "";
  if (by.selectedIndex < 0) by.value = "-1";
  if (app.cause) { answer.replaceChildren(...oneCause(app, app.cause, app.by)); return; }
  const output = version.outputs.find(([, , node]) => node === b);
  if (b < 0 || (a < 0 && !output)) {
    answer.replaceChildren(quiet("Choose an output above, or click two nodes, such as an input and an output: what makes the one depend on the other, and along which paths?"));
    return;
  }
  const bars = adjoints(version, app.partials(), b), whole = a < 0 ? app.values[b] : bars[a];
  const parts = output && causesOf(app, output[0], a, whole);
  const units = [output?.[0], version.names[a]?.[0]].map((each) => app.units.get(each));
  const unit = units[0] && (a < 0 || units[1]) ? ` ${units[0]}${a < 0 || units[1] === "1" ? "" : ` per ${units[1]}`}` : "";
  const name = a < 0 ? nameOf(app, b) : `∂${nameOf(app, b)} by ${nameOf(app, a)}`;
  answer.replaceChildren(...(parts ? causeTable(name, unit, parts, whole) : []));
  if (a < 0) {
    answer.append(parts ? quiet("Choose what it depends on, or click it, for the paths.") : quiet(`${name} is ${brief(whole)}. Choose what it depends on, or click it.`));
    return;
  }
  const count = pathCount(version, a, b);
  const head = tag("p", {}, tag("b", {}, nameOf(app, a)), " → ", tag("b", {}, nameOf(app, b)), `: ${digits(count)} path${count === 1n ? "" : "s"}`);
  answer.append(head);
  if (!count) { head.append("; the one does not depend on the other."); return; }
  const found = heaviest(version, app.partials(), a, b, PATHS);
  head.append(`. The derivative here is ${brief(bars[a])}, the sum of their products of partials.`,
    ` ${found.length ? "The heaviest:" : "Here a partial on each is zero."}`);
  const alike = (nodes) => found.filter((each) => each.nodes.join() === nodes.join()).length > 1;
  found.forEach(({ nodes, slots, product }) => {
    const words = nodes.map((node, i) => (i && alike(nodes) ? `argument ${slots[i - 1] + 1} of ` : "") + told(app, node));
    const crossed = nodes.filter((node) => version.marked.has(node)).length, on = app.path?.join() === nodes.join();
    const bodies = bodiesOn(version, nodes), ends = [nameOf(app, nodes[0]), ...bodies, nameOf(app, nodes.at(-1))];
    const button = tag("button", { type: "button", class: `path${on ? " on" : ""}` },
      `${brief(product)}: ${bodies.length ? ends.join(" → ") : words.join(" → ")}${crossed ? `  (${crossed} spurious)` : ""}`,
      ...(bodies.length ? [tag("br"), tag("span", { class: "unit" }, words.join(" → "))] : []));
    button.onclick = () => { app.path = on ? null : nodes; paintPath(app); showWhy(app); };
    answer.append(button);
  });
}

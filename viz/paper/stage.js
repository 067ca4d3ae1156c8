// Figures 1 to 3: which graph is shown, at which step, and what is told of the node that is pointed at.

/** The graphs of the element's data. */
function showGraphs(stage) {
  const boxes = [...document.querySelectorAll(".stage .box")], dt = byId("dt");
  let [view] = Object.keys(stage.views), place = null; // of the node that is told of

  const shown = () => boxes.filter((box) => box.dataset.views.split(" ").includes(view));
  const told = (where) => stage.views[view].nodes[where];

  /** Show the graph that is chosen, with its caption. */
  function choose(name) {
    view = name;
    for (const each of document.querySelectorAll(".stage [data-views]")) {
      const off = !each.dataset.views.split(" ").includes(view);
      each.classList.toggle("off", off);
      each.setAttribute("aria-hidden", off);
    }
    byId("caption").textContent = stage.views[view].caption;
    byId("words").textContent = stage.views[view].words;
    byId("graph").setAttribute("aria-label", stage.views[view].words);
    for (const row of document.querySelectorAll("#compared tbody tr")) row.classList.toggle("chosen", row.dataset.view === view);
    if (!told(place)) place = null;
    fill();
  }

  /** Values at the step of the slider, and what is told. */
  function fill() {
    const k = dt.valueAsNumber;
    dt.nextElementSibling.textContent = `${stage.steps[k]} s`;
    dt.setAttribute("aria-valuetext", `${stage.steps[k]} seconds`);
    for (const [name, values, wrong] of stage.compared) {
      const [, value, excess] = document.querySelector(`#compared [data-view="${name}"]`).children;
      value.textContent = values[k];
      excess.textContent = wrong[k];
      excess.classList.toggle("wrong", wrong[k] !== "0");
    }
    const nodes = shown(), first = nodes.find((box) => box.dataset.place === place) ?? nodes[0];
    for (const box of boxes) {
      box.classList.toggle("pointed", box.dataset.place === place);
      box.removeAttribute("tabindex");
    }
    first.setAttribute("tabindex", "0"); // the graph is one stop of the tabulator
    for (const box of nodes) {
      const [formula, what, values] = told(box.dataset.place);
      filled(box, { role: "img", "aria-label": `${formula}, ${what}, ${values[k]}` });
    }
    if (place === null) return;
    const [formula, what, values] = told(place);
    byId("told").replaceChildren(tag("b", {}, formula), ` = ${values[k]} `, tag("span", {}, what));
  }

  for (const radio of document.querySelectorAll('input[name="view"]')) {
    radio.onchange = () => choose(radio.value);
    if (radio.checked) view = radio.value; // a browser may keep the choice of an earlier visit
  }
  for (const box of boxes) box.onpointerenter = box.onclick = box.onfocus = () => { place = box.dataset.place; fill(); };
  byId("graph").onkeydown = (event) => {
    const by = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key], nodes = shown(), at = nodes.indexOf(document.activeElement);
    if (!by || at < 0) return;
    event.preventDefault();
    const next = nodes[(at + by + nodes.length) % nodes.length];
    next.setAttribute("tabindex", "0");
    next.focus();
  };
  dt.oninput = fill;
  choose(view);
}

if (byId("stage")) showGraphs(JSON.parse(byId("stage").textContent));

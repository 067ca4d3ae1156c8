// Figures 4 and 5, moving: the arm at the time of a slider, which a button lets run.

/** The arm of the element's data. */
function runFall({ dt, ours, theirs }) {
  const time = byId("time"), button = byId("run"), last = ours.length - 1;
  const points = (flat) => flat.map((meters, i) => meters * (i % 2 ? -100 : 100)); // of the picture, downward
  let began = null; // when the motion would have started, ms

  function show() {
    const k = time.valueAsNumber, places = points(ours[k]), dots = theirs.length ? points(theirs[k]) : [];
    byId("arm").replaceChildren(...[0, 1, 2].map((i) => {
      const [x1, y1, x2, y2] = places.slice(2 * i, 2 * i + 4);
      return drawn("line", { x1, y1, x2, y2, class: `link${i}` });
    }));
    byId("dots").replaceChildren(...dots.flatMap((cx, i) => (i % 2 ? [] : [drawn("circle", { cx, cy: dots[i + 1], r: 5 })])));
    const tips = ours.slice(0, k + 1).map((flat) => points(flat.slice(-2)).join(" "));
    byId("trail").setAttribute("d", `M${tips.join("L")}`);
    time.nextElementSibling.textContent = `${(k * dt).toFixed(2)} s`;
    time.setAttribute("aria-valuetext", time.nextElementSibling.textContent);
  }

  function stop(next) {
    began = null;
    button.textContent = next;
  }
  function step(now) {
    if (began === null) return;
    const k = Math.floor((now - began) / (1000 * dt));
    time.value = k;
    show();
    if (k >= last) stop("Let it fall"); else requestAnimationFrame(step);
  }

  button.onclick = () => {
    if (began !== null) { stop("Go on"); return; }
    const from = button.textContent === "Go on" ? time.valueAsNumber : 0;
    began = performance.now() - 1000 * dt * from;
    button.textContent = "Stop";
    requestAnimationFrame(step);
  };
  time.oninput = () => { stop(time.valueAsNumber < last ? "Go on" : "Let it fall"); show(); };
  show();
}

if (byId("motion")) runFall(JSON.parse(byId("motion").textContent));

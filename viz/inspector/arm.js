// The moving points, as sticks.

/** A view of the motion; returns a function that draws a frame. */
function armView(svg, motion) {
  const xs = motion.points.flat().map(([x]) => x), ys = motion.points.flat().map(([, y]) => y);
  const [left, right, low, high] = [Math.min(0, ...xs), Math.max(0, ...xs), Math.min(0, ...ys), Math.max(0, ...ys)];
  const size = Math.max(right - left, high - low, 1e-6), pad = 0.08 * size;
  const cx = (left + right) / 2, cy = (low + high) / 2, half = size / 2 + pad;
  svg.setAttribute("viewBox", `${cx - half} ${-cy - half} ${2 * half} ${2 * half}`);
  svg.replaceChildren();
  const r = size / 55;
  element("path", { class: "ground", d: `M${-4 * r} 0H${4 * r}`, "stroke-width": r / 2 }, svg);
  const trace = element("path", { class: "trace", "stroke-width": r / 3 }, svg);
  const sticks = motion.parents.map(() => element("path", { class: "stick", "stroke-width": 1.3 * r }, svg));
  const joints = motion.parents.map(() => element("circle", { class: "joint", r, "stroke-width": r / 3 }, svg));
  const last = motion.parents.length - 1;
  return (frame) => {
    const points = motion.points[frame];
    points.forEach(([x, y], i) => {
      const [px, py] = motion.parents[i] < 0 ? [x, y] : points[motion.parents[i]];
      sticks[i].setAttribute("d", `M${px} ${-py}L${x} ${-y}`);
      joints[i].setAttribute("cx", x);
      joints[i].setAttribute("cy", -y);
    });
    const past = motion.points.slice(Math.max(0, frame - 40), frame + 1).map((each) => `${each[last][0]} ${-each[last][1]}`);
    trace.setAttribute("d", `M${past.join("L")}`);
  };
}

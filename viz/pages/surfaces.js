// Spheres and planes of contacts in a picture of a motion: circles with a mark, and lines, or grids seen from above.

const EDGE_ON = 0.05; // of a plane's square: how little of it is seen where a line stands for the plane

/** The largest of 1, 2 and 5 times a power of ten up to a length. */
function nice(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return [5, 2, 1].find((each) => each * power <= length) * power;
}

/** What draws surfaces, and says whether a plane is a grid. points: [[x, y]], y up, of the center and mark of each sphere,
 * then of each plane a point and those 1 m along it. half: of the picture, around cx, cy. step: between lines of grids. */
function surfaceView(svg, radii, count) {
  const paths = (name, many, more) => Array.from({ length: many }, () => element("path", { class: name, fill: "none", stroke: "currentColor", "vector-effect": "non-scaling-stroke", ...more }, svg));
  const planes = paths("plane", (count - 2 * radii.length) / 3, {});
  const balls = paths("ball", radii.length, { fill: "currentColor", "fill-opacity": 0.14, "stroke-width": 1.5 });
  return (points, cx, cy, half, step) => {
    let grid = false;
    balls.forEach((ball, i) => {
      const [[x, y], [mx, my]] = points.slice(2 * i), r = radii[i] || half / 80;
      const whole = [x, y, mx, my].every(Number.isFinite);
      ball.setAttribute("d", whole ? `M${x - r} ${-y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0M${x} ${-y}L${mx} ${-my}` : "");
    });
    planes.forEach((plane, i) => {
      const [[x, y], ...ends] = points.slice(2 * radii.length + 3 * i), [u, v] = ends.map(([a, b]) => [a - x, b - y]);
      const area = u[0] * v[1] - u[1] * v[0], seen = Math.abs(area) > EDGE_ON;
      grid ||= seen;
      filled(plane, { "stroke-width": seen ? 1 : 2, "stroke-opacity": seen ? 0.22 : 0.7 });
      const line = (a, b, way, far) => `M${x + a - far * way[0]} ${-(y + b - far * way[1])}L${x + a + far * way[0]} ${-(y + b + far * way[1])}`;
      const dx = cx - x, dy = cy - y;
      if (seen) { // lines around the place of the plane that is behind the middle of the picture
        const many = Math.ceil((3 * half) / step), at = [(dx * v[1] - dy * v[0]) / area, (u[0] * dy - u[1] * dx) / area].map((each) => Math.round(each / step) * step);
        const along = (way, other, from, over) => Array.from({ length: 2 * many + 1 }, (_, k) => {
          const shift = over + (k - many) * step;
          return line(from * way[0] + shift * other[0], from * way[1] + shift * other[1], way, many * step);
        });
        plane.setAttribute("d", [...along(u, v, at[0], at[1]), ...along(v, u, at[1], at[0])].join(""));
      } else {
        const way = Math.hypot(...u) > Math.hypot(...v) ? u : v, size = Math.hypot(...way), to = (dx * way[0] + dy * way[1]) / size ** 2;
        plane.setAttribute("d", size ? line(to * way[0], to * way[1], way, (6 * half) / size) : "");
      }
    });
    return grid;
  };
}

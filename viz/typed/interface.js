// Texts to start from, and what the page takes of the engine.

const EXAMPLES = new Map([
  ["pendulum", `# a bob on a rod, and friction
m = 1, l = 1, g = 9.81
x1 = l*sin(theta), y1 = -l*cos(theta)
L = 1/2*m*l^2*theta'^2 - m*g*y1
damping = 0.1
theta(0) = 2
time = 10`],
  ["double pendulum", `# positions are enough: x1' is a rate
m1 = 1, l1 = 1
m2 = 0.8, l2 = 0.7, g = 9.81
x1 = l1*sin(a), y1 = -l1*cos(a)
x2 = x1 + l2*sin(b), y2 = y1 - l2*cos(b)
T = 1/2*m1*(x1'^2 + y1'^2) +
    1/2*m2*(x2'^2 + y2'^2)
V = m1*g*y1 + m2*g*y2
a(0) = 1, b(0) = 1.5
time = 8`],
  ["cart-pole", `# a pole on a cart, pushed to and fro
q: x, theta
mc = 2, m = 0.5, l = 0.8, g = 9.81
x1 = x, y1 = 0
x2 = x + l*sin(theta), y2 = -l*cos(theta)
T = 1/2*mc*x'^2 + 1/2*m*(x2'^2 + y2'^2)
V = m*g*y2
damping x = 0.3
tau x = 2*sin(3*t)
theta(0) = 0.5
time = 8`],
  ["spring and mass", `# Figure 1 of the paper, on a line
m = 1, k = 4
L = 1/2*m*x'^2 - 1/2*k*x^2
x1 = x, y1 = 0
x(0) = 1
time = 6`],
  ["Kepler", `# a planet, the sun at the origin
m = 1, mu = 1
r = sqrt(x^2 + y^2)
L = 1/2*m*(x'^2 + y'^2) + mu*m/r
x(0) = 1, y'(0) = 1.2
time = 20`],
]);

return {
  parse, explained, TextError, inverseDynamics, forwardDynamics, verdict, lint, motionOf, recordOf, rods, compiled, pretty,
  ROWS, apply, constant, variable, folded, topological, FORMULATIONS, EXAMPLES,
};

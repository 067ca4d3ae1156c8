// What the page takes of the engine.

return {
  parse, explained, TextError, inverseDynamics, forwardDynamics, verdict, lint, motionOf, recordOf, rods, compiled,
  ROWS, apply, constant, variable, folded, topological, FORMULATIONS, EXAMPLES,
};

// What the page takes of the engine.

return {
  parse, explained, TextError, inverseDynamics, forwardDynamics, spuriousNodes, lint, motionOf, recordOf, rods, compiled,
  ROWS, apply, constant, variable, folded, topological, FORMULATIONS: Object.keys(FORMULATIONS), EXAMPLES,
};

// What the page takes of the engine.

return {
  parse, explained, TextError, inverseDynamics, forwardDynamics, spuriousNodes, lint, motionOf, recordOf, rods, compiled,
  FORMULATIONS: Object.keys(FORMULATIONS), EXAMPLES,
};

// What the page takes of the engine.

return { parse, explained, TextError, inverseDynamics, forwardDynamics, spuriousNodes, lint, motionOf, rods, compiled, displayNames, massMatrix };

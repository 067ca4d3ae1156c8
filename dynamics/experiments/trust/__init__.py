"""Trust: random Lagrangians with exact answers, and whether a run is right or says that it is not."""

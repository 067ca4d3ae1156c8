"""Systems: what is simulated and derived from, a Lagrangian or a state equation."""

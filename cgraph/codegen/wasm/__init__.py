"""WebAssembly: a graph as a module that computes it, and steps its motion."""

"""Automatic differentiation: forward and reverse mode, whole derivatives, and solving with a Hessian."""

"""Gradients and sensitivities of motions: derivatives of a method's steps, statement by statement."""

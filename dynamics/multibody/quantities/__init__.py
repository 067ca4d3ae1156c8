"""Quantities of a mechanism: frames, momentum, center of mass, regressor, torques by sweeps."""

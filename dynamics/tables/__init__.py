"""Tables taken from one graph: matrices, torque by link and by motion, linearisation, regressor, certificate."""

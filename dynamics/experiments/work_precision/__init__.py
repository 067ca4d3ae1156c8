"""Work and precision: error beside run time of every integrator, and what long runs do to the energy."""

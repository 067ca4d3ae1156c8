"""Programs: graphs run in order and in loops over one memory of numbers, such as an integrator over its rate."""

"""A Lagrangian that is typed: its equations, counted, checked and moving, in one page."""

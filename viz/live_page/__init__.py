"""The live motion: a panel that computes a system's motion in the page."""

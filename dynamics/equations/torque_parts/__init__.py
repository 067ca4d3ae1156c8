"""Torque parts: inverse dynamics by link, by joint motion and by cause, as graphs and as a table."""

"""Rows: a robot as a table, and equations of motion as loops over it, with one kernel for each kind of joint."""

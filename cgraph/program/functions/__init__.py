"""Compiled graphs: functions of arrays, and their derivatives at run time, as programs."""

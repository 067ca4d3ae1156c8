"""Commands of the command line `cgraph`, a file each: its arguments, and the function that it runs."""

from . import bench, certify, compare, draw, inspect, lesson, lint, paper, report, scenes, why

# In the order of the help.
COMMANDS = (paper, bench, report, scenes, draw, certify, inspect, lint, why, compare, lesson)

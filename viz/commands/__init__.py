"""Commands of the command line `cgraph`, a file each: its arguments, and the function that it runs."""

from . import architecture, bench, certify, compare, draw, inspect, lesson, lint, paper, report, scenes, why

# In the order of the help. To add a command, write its file and name it here and above.
COMMANDS = (paper, bench, report, scenes, draw, certify, inspect, lint, why, compare, lesson, architecture)

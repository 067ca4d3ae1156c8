"""`python -m cgraph` is the command line `cgraph`, found as what is installed under that name."""

import sys
from importlib.metadata import entry_points

if __name__ == "__main__":
    command, *_ = entry_points(group="console_scripts", name="cgraph")
    sys.exit(command.load()())

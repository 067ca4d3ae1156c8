"""`python -m viz` is the command line `cgraph`."""

import sys

from .cli import start

if __name__ == "__main__":
    sys.exit(start())

"""`python -m viz` is the command line `cgraph`."""

import sys

from .cli import main

sys.exit(main())

"""Random motions with exact answers: whether default runs are right, say that they are not, or are silent.

python -m tests.dynamics.trust [COUNT] prints the verdicts; python -m tests.dynamics.trust tightest [COUNT] errors and
times beside heyoka's.
"""

from __future__ import annotations

import sys

from tests.dynamics.trust.cascades import with_cascades
from tests.dynamics.trust.tightest import tightest

words = sys.argv[1:]
figure = tightest if words[:1] == ["tightest"] else with_cascades
for line in figure(*map(int, words[figure is tightest :])):
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()

"""Early ends: the mark of tests whose runs stop before t_end, which is a warning, and warnings are errors."""

import pytest

stops = pytest.mark.filterwarnings("ignore:.*the run stopped at t = :dynamics.SimulationWarning")

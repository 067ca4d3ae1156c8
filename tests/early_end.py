"""Early ends: the mark of tests whose runs stop before t_end, which is a warning, and warnings are errors."""

import pytest

stops = pytest.mark.filterwarnings(
    r"ignore:(the run|.* trajectories) stopped (early. trajectory \d+ )?at t = :dynamics.SimulationWarning"
)

"""Hypothesis profiles: the default run is reproducible; HYPOTHESIS_PROFILE=explore looks for new examples."""

import os
import signal
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

_slow_is_fine = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow, HealthCheck.data_too_large]}
settings.register_profile("reproducible", derandomize=True, database=None, **_slow_is_fine)
settings.register_profile("explore", max_examples=2000, print_blob=True, **_slow_is_fine)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "reproducible"))


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt even where the tests were started with SIGINT ignored, as background jobs are."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)

"""Hypothesis profiles: the default run is reproducible and short; HYPOTHESIS_PROFILE=full or explore tries more."""

import gc
import os
import signal
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

_slow_is_fine = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow, HealthCheck.data_too_large]}
settings.register_profile("reproducible", max_examples=25, derandomize=True, database=None, **_slow_is_fine)
settings.register_profile("full", max_examples=100, derandomize=True, database=None, **_slow_is_fine)
settings.register_profile("explore", max_examples=2000, print_blob=True, **_slow_is_fine)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "reproducible"))


def pytest_collection_finish() -> None:
    """Modules and tests stay to the end: the garbage collector need not walk through them again and again."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def ctrl_c() -> Iterator[None]:
    """Ctrl-C raises KeyboardInterrupt even where the tests were started with SIGINT ignored, as background jobs are."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)

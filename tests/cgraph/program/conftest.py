"""Engines of programs, one after the other."""

import pytest

from tests.cgraph.engines import RUNNERS


@pytest.fixture(params=RUNNERS)
def backend(request: pytest.FixtureRequest) -> str:
    return str(request.param)

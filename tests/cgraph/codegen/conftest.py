"""Engines of generated code, one after the other."""

import pytest

from tests.cgraph.engines import ENGINES


@pytest.fixture(params=ENGINES)
def backend(request: pytest.FixtureRequest) -> str:
    return str(request.param)

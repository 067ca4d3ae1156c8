"""Pages of tests that are not about where Graphviz puts nodes do not ask it."""

import pytest

from viz.graph_drawing.render import RenderError
from viz.inspector import record


@pytest.fixture
def without_graphviz(monkeypatch):
    def none(*drawings):
        raise RenderError("no Graphviz")

    monkeypatch.setattr(record, "positions", none)

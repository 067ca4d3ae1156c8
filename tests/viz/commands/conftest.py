"""What a command prints, with its exit status checked."""

import json
from collections.abc import Callable

import pytest

from viz import cli


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    def run(*arguments: str, status: int = 0) -> str:
        assert cli.main(arguments) == status
        return capsys.readouterr().out

    return run


@pytest.fixture
def figures(said: Callable[..., str]) -> Callable[..., dict]:
    return lambda *arguments, status=0: json.loads(said(*arguments, "--json", status=status))

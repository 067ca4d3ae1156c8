"""Files written whole: permissions. What is left after an error is tested where pictures are written."""

import os
from pathlib import Path

import pytest

from cgraph.extend import atomic_write


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such permissions")
@pytest.mark.parametrize(("mode", "expected"), [(0o666, 0o644), (0o600, 0o600)])
def test_permissions_are_those_asked_for_less_the_umask(tmp_path: Path, mode: int, expected: int) -> None:
    umask = os.umask(0o022)
    try:
        written = atomic_write(tmp_path / "a", "text", mode=mode)
    finally:
        os.umask(umask)
    assert written.stat().st_mode & 0o777 == expected
    assert [path.name for path in tmp_path.iterdir()] == ["a"]

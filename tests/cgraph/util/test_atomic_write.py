"""Files written whole: permissions, and what a write that fails leaves: the old file or none, and a sentence."""

import errno
import os
from pathlib import Path
from typing import Any

import pytest

from cgraph.util.atomic_write import atomic_write, check_writable, write_files


def test_write_makes_the_file_with_text_or_bytes(tmp_path: Path) -> None:
    assert atomic_write(tmp_path / "a.svg", "ω₀\n").read_bytes() == "ω₀\n".encode()
    assert atomic_write(str(tmp_path / "a.png"), b"\x00\xff").read_bytes() == b"\x00\xff"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "a.svg"]


def test_write_replaces_a_file_and_keeps_a_link(tmp_path: Path) -> None:
    atomic_write(tmp_path / "real", "old")
    (tmp_path / "link").symlink_to("real")
    atomic_write(tmp_path / "link", "new")
    assert (tmp_path / "real").read_text() == "new"
    assert (tmp_path / "link").is_symlink()


@pytest.mark.parametrize("step", ["write_bytes", "replace"])
def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(
    step: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    atomic_write(tmp_path / "a", "old")
    original = Path.write_bytes

    def full(self: Path, data: Any) -> int:
        if step == "write_bytes":
            original(self, data[:1])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Path, step, full)
    with pytest.raises(OSError, match=r"cannot write .*a: No space left"):
        atomic_write(tmp_path / "a", "new")
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
    assert (tmp_path / "a").read_text() == "old"


def test_write_names_the_folder_that_is_missing(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"the folder .*nowhere does not exist"):
        atomic_write(tmp_path / "nowhere" / "a", "x")


def test_write_refuses_a_folder(tmp_path: Path) -> None:
    (tmp_path / "b").mkdir()
    with pytest.raises(OSError, match="that is a folder"):
        atomic_write(tmp_path / "b", "x")
    assert [path.name for path in tmp_path.iterdir()] == ["b"]


def test_write_says_that_a_folder_is_read_only(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refused(self: Path, data: bytes) -> int:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))

    monkeypatch.setattr(Path, "write_bytes", refused)  # the superuser may write anywhere, so no real folder refuses
    with pytest.raises(PermissionError, match=r"cannot write .*a: Permission denied"):
        atomic_write(tmp_path / "a", "x")


@pytest.mark.parametrize("bad", ["folder", "missing/c", "full"])
def test_several_files_are_written_all_or_none(bad: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "b").write_text("old")
    original = Path.write_bytes

    def full(self: Path, data: bytes) -> int:
        if data == b"third":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return original(self, data)

    monkeypatch.setattr(Path, "write_bytes", full)
    third = b"third" if bad == "full" else b"3"
    with pytest.raises(OSError, match=f"cannot write .*{bad}"):
        write_files({tmp_path / "a": "first", tmp_path / "b": "new", tmp_path / bad: third})
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["b", "folder"]
    assert (tmp_path / "b").read_text() == "old"


@pytest.mark.parametrize(("place", "said"), [("folder", "that is a folder"), ("missing/c", "does not exist")])
def test_a_place_is_tried_without_a_trace(place: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "b").write_text("old")
    check_writable(tmp_path / "b")
    check_writable(tmp_path / "new")
    with pytest.raises(OSError, match=said):
        check_writable(tmp_path / place)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["b", "folder"]
    assert (tmp_path / "b").read_text() == "old"


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

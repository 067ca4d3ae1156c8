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


FAILS = {  # what a step of writing says, and what is told
    "write_bytes": (errno.ENOSPC, "No space left"),
    "replace": (errno.ENOSPC, "No space left"),
    "write_bytes at once": (errno.EACCES, "Permission denied"),  # the superuser may write anywhere
}


@pytest.mark.parametrize("step", FAILS)
def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(
    step: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    atomic_write(tmp_path / "a", "old")
    original, (number, said) = Path.write_bytes, FAILS[step]

    def fails(self: Path, data: Any) -> int:
        if step == "write_bytes":
            original(self, data[:1])
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(Path, step.partition(" ")[0], fails)
    with pytest.raises(OSError, match=rf"cannot write .*a: {said}") as raised:
        atomic_write(tmp_path / "a", "new")
    assert isinstance(raised.value, PermissionError) == (number == errno.EACCES)
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
    assert (tmp_path / "a").read_text() == "old"


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


@pytest.mark.parametrize(
    ("place", "said"), [("folder", "that is a folder"), ("missing/c", r"the folder .*missing does not exist")]
)
def test_a_place_is_tried_without_a_trace(place: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    (tmp_path / "b").write_text("old")
    with pytest.raises(OSError, match=said):
        atomic_write(tmp_path / place, "x")
    check_writable(tmp_path / "b")
    check_writable(tmp_path / "new")
    with pytest.raises(OSError, match=said):
        check_writable(tmp_path / place)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["b", "folder"]
    assert (tmp_path / "b").read_text() == "old"


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such permissions")
def test_permissions_are_all_less_the_umask(tmp_path: Path) -> None:
    umask = os.umask(0o022)
    try:
        written = atomic_write(tmp_path / "a", "text")
    finally:
        os.umask(umask)
    assert written.stat().st_mode & 0o777 == 0o644
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with names are of POSIX")
def test_a_pipe_is_written_to_and_stays_one(tmp_path: Path) -> None:
    pipe, beside = tmp_path / "pipe", tmp_path / "beside.txt"
    os.mkfifo(pipe)
    check_writable(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_files({pipe: "of the pipe", beside: b"of the file"})
        assert os.read(reader, 100) == b"of the pipe"
    finally:
        os.close(reader)
    assert pipe.is_fifo()
    assert sorted(tmp_path.iterdir()) == [beside, pipe]


@pytest.mark.skipif(not hasattr(os, "mkfifo") or os.geteuid() == 0, reason="of POSIX, where permissions hold")
def test_a_pipe_that_must_not_be_written_to_is_told_before_the_work(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe, 0o400)
    with pytest.raises(PermissionError, match=r"cannot write .*pipe: Permission denied"):
        check_writable(pipe)

"""Store: a folder that keeps a sweep of trajectories while it runs, from which it goes on where it was ended."""

from __future__ import annotations

import errno
import json
import math
import os
import platform
import shutil
from dataclasses import fields
from hashlib import blake2b
from importlib.metadata import distributions
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

import cgraph as cg
from cgraph._shared import Array, Json, atomic_write

from ...integrators import Problem
from .ensemble import COLUMNS, Part
from .task import Chunk, Task

if TYPE_CHECKING:
    import sqlite3

SWEEP, ROWS, LOCK = "sweep.json", "rows.npy", "lock.sqlite"
FORMAT = 2
GIB = 2**30


class Store:
    """The folder of a sweep.

    sweep.json: what the sweep is, and how many trajectories are in a chunk.  rows.npy: the states (N, T, m) of all.
    chunk-000000000.json, ..: how the trajectories from that number on went, and the checksum of their rows.
    """

    def __init__(self, folder: Path, sweep: dict[str, Json], width: int, shape: tuple[int, ...]) -> None:
        """Open the folder, or begin it. Raises ValueError where it keeps something else, OSError where it cannot be."""
        self._folder, self.name = folder, f"store {str(folder)!r}"
        self._lock: sqlite3.Connection | None = None
        folder.mkdir(parents=True, exist_ok=True)
        try:
            known = self._known()
            if not known or not all(self._file(k).exists() for k in range(0, shape[0], known["chunk"])):
                self.lock()  # else the folder is read alone
                known = self._known()
            if not known:
                if any(path.name != LOCK for path in folder.iterdir()):
                    raise ValueError(f"{self.name} is a folder with other files and without a sweep: name an empty one")
                known = {**sweep, "chunk": width}
                atomic_write(folder / SWEEP, json.dumps(known, indent=1))
            for name, value in sweep.items():
                if known.get(name) != value:
                    there = f"there {name} is {known.get(name)!r:.60}, here {value!r:.60}"
                    raise ValueError(f"{self.name} keeps another sweep: {there}")
            self.width, self.rows = known["chunk"], self._table(shape)
        except BaseException:
            self.close()
            raise

    def lock(self) -> None:
        """Take the folder for this call alone, until `close` or the process ends. Raises OSError if it is taken."""
        import sqlite3  # whose lock does that on every system

        if self._lock is not None:
            return
        self._lock = sqlite3.connect(self._folder / LOCK, timeout=0.0, check_same_thread=False)
        try:
            self._lock.execute("PRAGMA journal_mode = MEMORY")  # no file beside
            self._lock.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            self.close()
            if error.sqlite_errorcode != sqlite3.SQLITE_BUSY:
                raise OSError(f"{self.name} cannot be locked: {error}") from None
            other = "another call of simulate_many, here or in another process"
            raise OSError(f"{self.name} is being written by {other}: wait for it, or name another folder") from None
        for path in self._folder.glob(".*.tmp"):  # what a process was writing when it was ended
            path.unlink(missing_ok=True)

    def close(self) -> None:
        """Leave the folder to others."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def part(self, chunk: Chunk) -> Part | None:
        """The results of a chunk, if they are there."""
        part = Part(chunk.first, self.rows[chunk.first : chunk.first + len(chunk.x)])
        try:
            kept = json.loads(self._file(chunk.first).read_text(encoding="utf-8"))
            part.put(slice(None), **{name: kept[name] for name in COLUMNS.keys() - {"warnings"}})
            for k, (said, log) in enumerate(zip(kept["warnings"], kept["happened"], strict=True)):
                part.put(k, warnings=tuple(said), happened=[(number, t, np.array(x)) for number, t, x in log])
            return part if crc32(part.rows.data) == kept["checksum"] else None
        except (OSError, ValueError, KeyError, TypeError):  # not there, or damaged: the chunk is run again
            return None

    def keep(self, part: Part) -> None:
        """Write how the trajectories of a part went; their rows are in the table."""
        self.rows.flush()
        kept = {name: values.tolist() for name, values in part.columns.items()}
        kept["happened"] = [[(number, t, x.tolist()) for number, t, x in log] for log in kept["happened"]]
        checksum = crc32(self.rows[part.first : part.first + len(part.rows)].data)
        atomic_write(self._file(part.first), json.dumps({**kept, "checksum": checksum}))

    def _file(self, first: int) -> Path:
        return self._folder / f"chunk-{first:09d}.json"

    def _known(self) -> dict[str, Any]:
        """What the folder keeps; empty if nothing."""
        path = self._folder / SWEEP
        try:
            known: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
            return {**known, "chunk": int(known["chunk"])} if known else {}
        except (ValueError, KeyError, TypeError):
            raise ValueError(f"{self.name} is damaged: its {SWEEP} is not one that was written here") from None

    def _table(self, shape: tuple[int, ...]) -> np.memmap[Any, np.dtype[np.float64]]:
        """The table, in its file. Raises ValueError for a file that was cut: a memory map would fill it with zeros."""
        path, header, damaged = self._folder / ROWS, BytesIO(), f"{self.name} is damaged: "
        described: dict[str, Any] = {"descr": "<f8", "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(header, described)
        size = header.tell() + 8 * math.prod(shape)
        if not any(self._folder.glob("chunk-*")):
            self._make_rows(header.getvalue(), size)
        elif not path.exists():
            raise ValueError(f"{damaged}it has results of chunks, and no {ROWS}")
        with path.open("rb") as file:
            if path.stat().st_size != size or file.read(header.tell()) != header.getvalue():
                here = f"its {ROWS} of {path.stat().st_size} bytes is no table of NumPy of {shape}, of {size} bytes"
                raise ValueError(f"{damaged}{here}; remove the folder, and the sweep begins anew")
        return np.memmap(path, np.float64, "r+", header.tell(), shape)

    def _make_rows(self, header: bytes, size: int) -> None:
        """Make the file of the table, with all its room: a write through a memory map without would end the process."""
        path, free = self._folder / ROWS, shutil.disk_usage(self._folder).free
        try:
            if size > free:
                raise OSError(errno.ENOSPC, f"{free / GIB:.3g} GiB are free")
            with path.open("wb") as file:
                file.write(header)
                file.truncate(size)
                if hasattr(os, "posix_fallocate"):  # now, as nobody else may then take the room
                    os.posix_fallocate(file.fileno(), 0, size)
        except OSError as error:
            path.unlink(missing_ok=True)
            needs = f"{self.name} needs {size / GIB:.3g} GiB for its {ROWS}, fewer with fewer times (t_eval)"
            raise OSError(error.errno, f"{needs}: {error.strerror}") from None


def sweep_of(problem: Problem, task: Task, x: Array, p: Array) -> dict[str, Json]:
    """What makes a sweep of states x (N, m) with parameters p (N, ..): equations, options, and by which versions."""
    program, options, watched = task.program, task.options, task.events.events if task.events else ()
    parts = [(part, field.name) for part in (task.span, options) for field in fields(part) if field.init]
    model = [problem.evaluation.called, problem.velocities, program.normalization]
    events = [graph for event in watched for graph in (event.values, event.reset)]
    known = {
        "format": FORMAT,
        "cgraph": cg.__version__,
        "llvmlite": [each.version for each in distributions(name="llvmlite")],
        "machine": platform.machine(),
        **{name: getattr(part, name) for part, name in parts if name != "progress"},
        "rtol": options.relative,
        "atol": np.asarray(options.absolute).tolist(),
        "t_eval": _digest(task.times.tobytes()),
        "names": [*program.components, *problem.parameters],
        "events": [f"{event.name} {event.direction} {event.terminal}" for event in watched],
        "model": _digest(*[cg.structure_hash(graph).encode() for graph in [*model, *events] if graph is not None]),
        "steps": _digest(*[cg.structure_hash(graph).encode() for graph in program.steps.graphs()]),
        "trajectories": len(x),
        "starts": _digest(x.tobytes()),
        "parameters": _digest(p.tobytes(), *[each.tobytes() for each in problem.evaluation.shared.values()]),
    }
    sweep: dict[str, Json] = json.loads(json.dumps(known, default=float))
    return sweep


def _digest(*parts: bytes) -> str:
    return blake2b(b"".join(parts), digest_size=16).hexdigest()

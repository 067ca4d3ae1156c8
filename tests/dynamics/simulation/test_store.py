"""Stores: a sweep that was ended goes on from its folder, to the bits that it has in one go, and work is done once."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics.simulation.ensembles import task
from dynamics.simulation.ensembles.store import Store
from tests.dynamics.models import arms, oscillator, same

ROWS = [0.1, 0.2]
UP = dyn.Event("up", lambda q, qd, t: q[0], direction=1)
KINDS: dict[str, dict[str, Any]] = {
    "side by side": {"method": "rk4", "dt": 0.02, "backend": "python"},
    "in lanes": {"method": "dopri5", "backend": "auto"},
    "with events": {"method": "rk4", "dt": 0.02, "events": UP, "estimate_error": False, "backend": "python"},
    "momenta": {"method": "rk4", "dt": 0.02, "form": "momentum", "backend": "python"},
}


def sweep(**options: Any) -> dyn.Ensemble:
    """Forty arms, one of which leaves the numbers."""
    model, q, qd = arms(40)
    qd[3] = 1e200
    return dyn.simulate_many(model, q, qd, 0.2, **({"t_eval": ROWS, "chunk": 8} | options))


def crossings(ensemble: dyn.Ensemble) -> list[Any]:
    return [(each.t.tolist(), each.q.tolist(), each.qd.tolist()) for log in ensemble.events.values() for each in log]


@pytest.mark.filterwarnings("ignore::dynamics.SimulationWarning")
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_missing_is_run_and_nothing_else(kind: str, tmp_path: Path) -> None:
    alone = sweep(**KINDS[kind])
    for workers, left in ((1, range(5)), (3, (1, 3)), (map, (4,)), (1, ())):
        for k in left:
            (tmp_path / f"chunk-{8 * k:09d}.json").unlink(missing_ok=True)
        with patch.object(task.Task, "run", autospec=True, side_effect=task.Task.run) as run:
            result = sweep(**KINDS[kind], store=tmp_path, workers=workers, chunk=8 if workers == 1 else 16)
        assert sorted(call.args[1].first for call in run.call_args_list) == [8 * k for k in left]
        assert same(alone, result)
        assert crossings(alone) == crossings(result)
        assert isinstance(result.q, np.memmap)
        assert not result.q.flags.writeable
    with ThreadPoolExecutor(2) as pool:
        assert same(alone, sweep(**KINDS[kind], workers=pool))


KILLED = """
import os, signal, sys
from tests.dynamics.simulation.test_store import sweep

def twice(function, chunks):
    for k, each in enumerate(chunks):
        if k == 2:
            os.kill(os.getpid(), signal.SIGKILL)
        yield function(each)

sweep(method="rk4", dt=0.02, backend="python", store=sys.argv[1], workers=twice)
"""


@pytest.mark.filterwarnings("ignore::dynamics.SimulationWarning")
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no such signal on this system")
def test_a_sweep_that_was_killed_goes_on(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    ended = subprocess.run([sys.executable, "-c", KILLED, tmp_path], check=False, env=environment)
    assert ended.returncode == -signal.SIGKILL
    with patch.object(task.Task, "run", autospec=True, side_effect=task.Task.run) as run:
        assert same(sweep(**KINDS["side by side"]), sweep(**KINDS["side by side"], store=tmp_path))
    assert [call.args[1].first for call in run.call_args_list][-3:] == [16, 24, 32]
    assert run.call_count == 5 + 3


@pytest.mark.filterwarnings("ignore::dynamics.SimulationWarning")
def test_one_call_at_a_time_writes_and_any_number_read(tmp_path: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    refused = "is being written by another call of simulate_many, here or in another process: wait for it"

    def meanwhile(function: Callable[..., Any], chunks: Iterable[Any]) -> Iterator[Any]:
        with pytest.raises(OSError, match=refused):
            sweep(**options, store=tmp_path)
        command = [sys.executable, "-c", KILLED, tmp_path]
        ended = subprocess.run(command, check=False, env=environment, capture_output=True, text=True)
        assert refused in ended.stderr
        yield from map(function, chunks)

    options = KINDS["side by side"]
    first = sweep(**options, store=tmp_path, workers=meanwhile)
    known = json.loads((tmp_path / "sweep.json").read_text())
    with closing(Store(tmp_path, known, 8, (40, 2, 4))) as writing:
        writing.lock()
        assert same(first, sweep(**options, store=tmp_path))


@pytest.mark.filterwarnings("ignore::dynamics.SimulationWarning")
def test_ctrl_c_keeps_the_chunks_that_are_done(tmp_path: Path) -> None:
    def interrupted(function: Callable[..., Any], chunks: Iterable[Any]) -> Iterator[Any]:
        yield function(next(iter(chunks)))
        raise KeyboardInterrupt

    options = KINDS["side by side"]
    with pytest.raises(KeyboardInterrupt):
        sweep(**options, store=tmp_path, workers=interrupted)
    assert [path.name for path in tmp_path.glob("chunk-*")] == ["chunk-000000000.json"]
    assert same(sweep(**options), sweep(**options, store=tmp_path))


def springs(store: Path, k: list[float], system: Any = None, q: float = 1.0, **options: Any) -> dyn.Ensemble:
    """Motions of an oscillator with these stiffnesses."""
    given = {"t_eval": ROWS, "backend": "python"} | options
    return dyn.simulate_many(system or oscillator(), [q], [0.0], 0.2, parameters={"k": k}, store=store, **given)


OTHERS: list[tuple[str, dict[str, Any]]] = [
    ("rtol is 1e-09, here 1e-08", {"rtol": 1e-8}),
    ("atol", {"atol": [1e-10, 1e-9]}),
    ("method is 'dop853', here 'dopri5'", {"method": "dopri5"}),
    ("t_eval", {"t_eval": [0.1, 0.15]}),
    ("max_step", {"max_step": 0.1}),
    ("parameters", {"k": [1.0, 3.0]}),
    ("trajectories is 2, here 3", {"k": [1.0, 2.0, 3.0]}),
    ("starts", {"q": 2.0}),
    ("events", {"events": UP}),
    ("model", {"tau": lambda q, qd, t: [-0.1 * qd[0]]}),
]


def test_another_sweep_is_refused_by_what_differs(tmp_path: Path) -> None:
    springs(tmp_path, [1.0, 2.0])
    for words, other in OTHERS:
        with pytest.raises(ValueError, match=rf"^store '.*' keeps another sweep: there {words}"):
            springs(tmp_path, **({"k": [1.0, 2.0]} | other))
    with patch.object(cg, "__version__", "9.9"), pytest.raises(ValueError, match=r"cgraph is '.*', here '9\.9'"):
        springs(tmp_path, [1.0, 2.0])


def test_a_folder_of_something_else_or_damaged_is_a_sentence(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("work of years")
    with pytest.raises(ValueError, match="is a folder with other files and without a sweep: name an empty one"):
        springs(tmp_path, [1.0, 2.0])
    store = tmp_path / "new" / "sweep"
    whole = springs(store, [1.0, 2.0])
    (store / "chunk-000000000.json").write_text("{")  # a chunk that cannot be read is run again
    assert same(whole, springs(store, [1.0, 2.0]))
    rows, unfinished = store / "rows.npy", store / ".rows.npy.1.tmp"
    bits = rows.read_bytes()
    unfinished.touch()
    rows.write_bytes(bits[:-8] + bytes(8))  # so are rows that are not those that were written
    assert same(whole, springs(store, [1.0, 2.0]))
    assert not unfinished.exists()  # what a process that was killed was writing
    for cut in (len(bits) - 8, 130, 0):
        os.truncate(rows, cut)
        with pytest.raises(ValueError, match=rf"sweep' is damaged: its rows\.npy of {cut} bytes is .*of {len(bits)} b"):
            springs(store, [1.0, 2.0])
    rows.write_bytes(bytes(len(bits)))
    with pytest.raises(ValueError, match=r"is damaged: its rows\.npy of \d+ bytes is no table of NumPy"):
        springs(store, [1.0, 2.0])
    rows.unlink()
    with pytest.raises(ValueError, match=r"is damaged: it has results of chunks, and no rows\.npy"):
        springs(store, [1.0, 2.0])
    (store / "sweep.json").write_text(json.dumps([1]))
    with pytest.raises(ValueError, match=r"is damaged: its sweep\.json is not one that was written here"):
        springs(store, [1.0, 2.0])


def test_a_store_that_has_no_room_is_a_sentence(tmp_path: Path) -> None:
    full = patch("shutil.disk_usage", return_value=SimpleNamespace(free=0))
    with full, pytest.raises(OSError, match=r"needs .* GiB for its rows\.npy, .*: 0 GiB are free"):
        springs(tmp_path, [1.0, 2.0])
    large = patch("os.posix_fallocate", create=True, side_effect=OSError(27, "File too large"))
    with large, pytest.raises(OSError, match=rf"store '{tmp_path}' needs .* GiB for its rows\.npy, .*: File too large"):
        springs(tmp_path, [1.0, 2.0])

"""`cgraph simulate`: the motion of a scene, in a summary and as CSV."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import dynamics as dyn
from cgraph import _shared

from . import library
from .arguments import MOMENTUM_FORM, answer, place, positive, started, takes_a_scene, takes_a_start, unless_json
from .command import Command, flag

METHOD = "dop853"
SHOWN = 12  # states that the summary names
SPANS = 4  # of slides on a surface that it tells
MOST_ROWS = 1_000_000
UNLIMITED = (-math.inf, math.inf)


def add(parser: Command) -> None:
    """The command's arguments."""
    takes_a_scene(parser)
    takes_a_start(parser)
    parser.names["methods"] = lambda: dyn.METHODS
    parser.add_argument("--t-end", type=positive, metavar="S", help="how long, in place of the scene's time")
    parser.add_argument("--method", default=METHOD, metavar="NAME", help=f"{{methods}} (default: {METHOD})")
    flag(parser, "--momentum", f"step {MOMENTUM_FORM}")
    parser.add_argument("--dt", type=positive, metavar="S", help="the largest of equal steps (default: 0.001)")
    parser.add_argument("--rtol", type=positive, metavar="R", help="relative error of a chosen step (default: 1e-9)")
    parser.add_argument("--every", type=positive, metavar="S", help="a row so often (default: every step is one)")
    parser.add_argument("--csv", type=place, metavar="FILE", help="write t, q, qd and energy, a line for each row")
    flag(parser, "--json", "print as JSON")


def run(options: argparse.Namespace) -> int:
    """Print how the run went; 1 where it ends before its time."""
    if options.csv is not None:
        _shared.check_writable(options.csv)
    elif options.every is not None:
        raise ValueError("--every goes with --csv: it says how often the table has a row")
    if options.dt is not None and library.Steps(options.method).adaptive:
        said = f"{options.method} chooses its steps, to the error --rtol"
        raise ValueError(f"--dt goes with methods of equal steps, such as --method rk4; {said}")
    scene, _ = started(options)
    end = scene.t_end if options.t_end is None else options.t_end
    form = "momentum" if options.momentum else "velocity"
    at = None if options.every is None else _every(options.every, end)
    run = dyn.simulate(
        scene,
        scene.q,
        None if scene.ode else scene.qd,
        end,
        options.method,
        rtol=options.rtol,
        dt=options.dt,
        t_eval=at,
        dense_output=at is None and any(_limited(scene).values()),  # of few rows of a long run, steps may be too many
        form=form,
    )
    data = {"scene": scene.name, "rows": len(run.t), "form": form} | _summary(run) | _beyond(scene, run)
    files: dict[Path, str | bytes] = {} if options.csv is None else {options.csv: run.to_csv()}
    answer(unless_json(options, data, f"{scene.name}: {_text(run, data)}"), files)
    return 0 if run.stats.success else 1


def _summary(run: dyn.Trajectory) -> dict[str, Any]:
    """Facts of a run, as data."""
    import numpy as np

    stats = run.stats
    names = [f"q.{name}" for name in run.coordinates] if run.velocities else list(run.coordinates)
    names += [f"qd.{name}" for name in run.velocities]
    energy: dict[str, float] = {}
    if np.isfinite(run.energy).all():  # of a system of first order it is NaN
        energy = {
            "energy": float(run.energy[0]),
            "energy_at_end": float(run.energy[-1]),
            "energy_drift": float(np.abs(run.energy - run.energy[0]).max()),
        }
    return {
        "success": stats.success,
        "status": stats.status,
        "message": stats.message,
        "method": stats.method,
        "t_end": float(run.t[-1]),
        "steps": stats.steps,
        "rejected": stats.rejected,
        "evaluations": stats.nfev,
        "seconds": stats.seconds,
        **energy,
        **({"surfaces": found} if (found := _surfaces(run)) else {}),
        "end": dict(zip(names, [*run.q[-1].tolist(), *run.qd[-1].tolist()], strict=True)),
    }


def _surfaces(run: dyn.Trajectory) -> dict[str, dict[str, Any]]:
    """Of surfaces on which the rate jumps or kinks that the run met: how often, and the spans [s] in which it slid."""
    import numpy as np

    found, (surfaces, t, sides, slides) = dict[str, dict[str, Any]](), run.modes
    for k, name in enumerate(surfaces):
        met = int(((sides[1:, k] != sides[:-1, k]) > slides[:-1, k]).sum())
        edges = np.flatnonzero(np.diff(slides[:, k].astype(int), prepend=0, append=0))
        if met or len(edges):
            found[name] = {"met": met, "slides": np.append(t, run.t[-1])[edges].reshape(-1, 2).tolist()}
    return found


def _limited(scene: dyn.Scene) -> dict[str, dict[str, tuple[float, float]]]:
    """{"position" or "velocity": {coordinate: the ends of its limit}} of those that are limited."""
    return {
        kind: {name: ends for name, each in scene.limits.items() if (ends := getattr(each, kind)) != UNLIMITED}
        for kind in ("position", "velocity")
    }


def _beyond(scene: dyn.Scene, run: dyn.Trajectory) -> dict[str, Any]:
    """Sentences on the limits of joints that the run has left, and where it was looked at; nothing without limits."""
    if scene.mechanism is None or not any((limits := _limited(scene)).values()):
        return {}
    units = library.display_units(scene.mechanism.moving)
    unit_of = {name: units[f"q{k}"] for k, name in enumerate(run.coordinates)}
    read = "rows" if run.dense is None else "steps"
    return {"beyond_limits": library.limits_left(run, limits, unit_of), "limits_looked_at_in": read}


def _text(run: dyn.Trajectory, data: dict[str, Any]) -> str:
    """The summary in words."""
    at_end = ", ".join([f"{name} = {value:.6g}" for name, value in [*data["end"].items()][:SHOWN]])
    more = len(data["end"]) - SHOWN
    of = ", of coordinates and momenta" if data["form"] == "momentum" else ""
    steps, evaluations = _shared.counted(data["steps"], "step"), _shared.counted(data["evaluations"], "evaluation")
    work = f"{steps}{of}, {data['rejected']} rejected, {evaluations}"
    lines = [
        f"{data['message']}, {data['t_end']:g} s" if run.success else f"{data['message']}",
        f"  method  {data['method']}: {work}, {data['seconds']:.3g} s",
        f"  end     {at_end}{f', and {more} more' if more > 0 else ''}",
    ]
    if "energy" in data:
        lines.append(
            f"  energy  {data['energy']:.6g} J at the start, {data['energy_at_end']:.6g} J at the end, "
            f"changed by {data['energy_drift']:.2g} J at most"
        )
    for name, each in data.get("surfaces", {}).items():
        spans = [f"t = {start:.6g} .. {end:.6g} s" for start, end in each["slides"][:SPANS]]
        spans += [f"{more} times more"] if (more := len(each["slides"]) - SPANS) > 0 else []
        slid = f", stays there {', '.join(spans)}" if spans else ""
        lines.append(f"  surface {name}: met {_shared.counted(each['met'], 'time')}{slid}")
    if "beyond_limits" in data:
        looked = "" if data["limits_looked_at_in"] == "steps" else ", by the rows alone"
        lines += [f"  limits  {each}{looked}" for each in data["beyond_limits"] or ["kept throughout"]]
    return "\n".join(lines)


def _every(step: float, end: float) -> _shared.Array:
    """Times so far apart up to the end, which is one of them. Raises ValueError for more than can be kept."""
    import numpy as np

    count = end / step
    if count > MOST_ROWS:
        raise ValueError(f"--every {step:g} makes {count:.3g} rows of {end:g} s, and {MOST_ROWS} are the most")
    return np.append(step * np.arange(int(np.ceil(count * (1.0 - 1e-12)))), end)

"""Figures 4 and 5: the three-link arm in free fall, by our graph and by MuJoCo."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cgraph.extend import Array, Json
from dynamics import Trajectory, scenes, simulate
from dynamics.io.mujoco_twin import MujocoTwin
from dynamics.multibody.trees.mechanism import require_mechanism

from .. import theme
from ..pages.document import Block, Paragraph, Table
from ..plots import plot
from .part import Part, plotted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SNAPSHOTS = 6


def figures4_and_5() -> Part:
    """Figures 4 and 5: the three-link arm in free fall, by our graph and by MuJoCo."""
    scene = scenes.load("triple_pendulum")
    run = simulate(scene, scene.q, scene.qd, scene.t_end, "rk4", dt=1e-3)
    if not run.stats.success:
        raise RuntimeError(f"the fall of {scene.name} is not whole: it {run.stats.message}")
    positions = require_mechanism(scene, "a fall").joint_positions(run.q)
    instants = np.linspace(0.0, scene.t_end, SNAPSHOTS)
    ours = plot.snapshots(run.t, positions, instants.tolist())
    start = ", ".join(f"{angle:.4g}" for angle in scene.q)
    caption4 = (
        "Figure 4. The three-link arm in free fall (Section 3), by the Runge-Kutta method of order 4 on the equations of motion "
        f"from its own graph, with the path of each joint. Start at rest at θ = ({start}) rad, dt = 0.001 s."
    )
    tip = positions[[int(np.abs(run.t - t).argmin()) for t in instants], -1]
    path = "; ".join(
        [f"({letter}) {x:.2f}, {y + 0.0:.2f} m".replace("-", "−") for letter, (x, y) in zip("abcdef", tip, strict=True)]
    )
    seen = f"Six poses of an arm of three links, (a) at t = 0 to (f) at t = {scene.t_end:g} s"
    blocks: list[Block] = [plotted("fig4", ours, caption4, f"{seen}. The tip is at {path}.")]
    heading = "Figures 4 and 5: the three-link arm falls"
    data: dict[str, Json] = {"q_end": run.q[-1].tolist()}
    try:
        twin = MujocoTwin(scene.model, scene.t_end / (len(run.t) - 1))
    except ImportError as error:
        blocks.append(Paragraph(f"Figure 5 is missing on this machine. {error}", warning=True))
        return Part("fall", heading, blocks, {"fall": data | {"mujoco": None}})

    version = str(twin.mujoco.__version__)
    q, _ = twin.trajectory(np.array(scene.q), np.array(scene.qd), len(run.t) - 1)
    theirs = plot.snapshots(run.t, positions, instants.tolist(), dots=twin.arm_positions(q))
    caption5 = (
        f"Figure 5. The same arm in MuJoCo {version} (Section 4.1; the same method and step), as dots, over ours, as lines: joints "
        "at the same instants, and their paths."
    )
    differences = _largest_differences(run, q)
    most = differences[-1][1]
    residual = (
        f"Figure 5, the residual: what our angles differ from MuJoCo's, joint by joint. The largest difference is {most:.1e} rad. "
        "It is rounding, which the motion makes grow; where a point is missing the angles are equal to the last bit."
    )
    header = ("up to t [s]", "largest |difference in θ| [rad]")
    rows = [(f"{t:.2f}", f"{difference:.2e}") for t, difference in differences]
    grows = f"Differences of three joint angles over time, from {differences[0][1]:.0e} rad up to {differences[0][0]:g} s to {most:.0e} rad."
    blocks += [
        plotted("fig5", theirs, caption5, f"{seen}, with a dot of MuJoCo's on every joint and on its path."),
        plotted("fig5-residual", _residual(run, q), residual, grows),
        Table("Our trajectory and MuJoCo's", header, rows, folded=True, file="fig5"),
        Paragraph(
            "Both integrate by the classical Runge-Kutta method with the same step, so what differs is the equations of motion: "
            "ours from a Lagrangian by automatic differentiation, MuJoCo's from its composite-rigid-body algorithm."
        ),
    ]
    data |= {"mujoco": version, "largest_difference": most}
    return Part("fall", heading, blocks, {"fall": data})


def _residual(run: Trajectory, q: Array) -> Figure:
    """|difference| of each joint's angle over time."""
    difference = np.abs(run.q - q)
    return plot.over_time(run.t, np.where(difference > 0.0, difference, np.nan), "|Δθ| [rad]", theme.LINKS)


def _largest_differences(run: Trajectory, q: Array, windows: int = 6) -> list[tuple[float, float]]:
    """(t, largest |difference in q| up to t [rad]) at the ends of equal stretches of time."""
    difference = np.abs(run.q - q).max(axis=1)
    ends = np.linspace(0, len(difference) - 1, windows + 1).astype(int)[1:]
    return [(float(run.t[k]), float(difference[: k + 1].max())) for k in ends]

"""Figures 4 and 5: the three-link arm in free fall, by our graph and by MuJoCo."""

from __future__ import annotations

import numpy as np

from cgraph.extend import Json
from dynamics import scenes
from dynamics.experiments.paper_numbers import free_fall, largest_differences, mujoco_free_fall

from ..pages.document import Block, Paragraph, Table
from ..plots import plot
from .part import Part, plotted

SNAPSHOTS = 6


def figures4_and_5() -> Part:
    """Figures 4 and 5: the three-link arm in free fall, by our graph and by MuJoCo."""
    scene = scenes.load("triple_pendulum")
    run = free_fall(scene)
    instants = np.linspace(0.0, scene.t_end, SNAPSHOTS)
    ours = plot.snapshots(run.trajectory.t, run.positions, instants.tolist())
    start = ", ".join(f"{angle:.4g}" for angle in scene.q)
    caption4 = (
        "Figure 4. The three-link arm in free fall by RK4 on the equations of motion from its own graph, with the way of "
        f"each joint. Start at rest at q = ({start}) rad, dt = 1e-3 s."
    )
    blocks: list[Block] = [plotted("fig4", ours, caption4)]
    data: dict[str, Json] = {"q_end": run.trajectory.q[-1].tolist()}
    try:
        other = mujoco_free_fall(run)
    except ImportError as error:
        blocks.append(Paragraph(f"Figure 5 is missing on this machine. {error}", warning=True))
        return Part("fall", "Figures 4 and 5: the fall", blocks, data | {"mujoco": None})

    theirs = plot.snapshots(run.trajectory.t, run.positions, instants.tolist(), dots=other.positions)
    caption5 = (
        f"Figure 5. The same arm in MuJoCo {other.version} (RK4, same step), as dots, over ours, as lines: joints at the "
        "same instants, and their ways."
    )
    differences = largest_differences(run, other)
    header = ("up to t [s]", "largest |difference in q| [rad]")
    rows = [(f"{t:.2f}", f"{difference:.2e}") for t, difference in differences]
    blocks += [
        plotted("fig5", theirs, caption5),
        Table("Our trajectory and MuJoCo's", header, rows, file="fig5"),
        Paragraph(
            "Both integrate by the classical Runge-Kutta method with the same step, so what differs is the equations of motion: "
            "ours from a Lagrangian by automatic differentiation, MuJoCo's from its composite-rigid-body algorithm."
        ),
    ]
    data |= {"mujoco": other.version, "largest_difference": differences[-1][1]}
    return Part("fall", "Figures 4 and 5: the fall", blocks, data)

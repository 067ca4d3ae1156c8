"""`cgraph lesson`: a lesson of ten minutes on Figures 1 to 3, with every number measured when the page is made."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cgraph import Graph
from cgraph.extend import check_writable
from dynamics import inverse_dynamics, momentum_rate, scenes, spurious_nodes
from dynamics.experiments.paper_numbers.equation3 import equation3

from ..pages.lesson import Lesson, page
from .arguments import Commands, answer

STEPS = (1.0, 0.1, 0.01, 1e-3, 1e-6)  # s
ARM_DT = 1e-6  # s
ARM_Q, ARM_QD = (0.3, -0.5, 0.8), (1.0, -2.0, 1.5)  # rad, rad/s: a moving arm that is bent at every joint


def add(commands: Commands[argparse.ArgumentParser]) -> None:
    """The command's arguments."""
    parser = commands.add_parser("lesson", help="a page for a class of ten minutes: predict, reveal, explain")
    parser.add_argument("--out", type=Path, required=True, help="file to write: .html")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> None:
    """Write the page."""
    if options.out.suffix != ".html":
        raise ValueError(f"--out must end in .html, got {options.out}")
    check_writable(options.out)
    answer(f"{options.out}: five questions on Figures 1 to 3", {options.out: page(lesson())})


def lesson() -> Lesson:
    """The graphs of the wheel on a spring, and what they come to."""
    wheel = scenes.load("spring_mass")
    flawed, kinetic, right = (
        momentum_rate(wheel, formulation, keep_momentum=True)
        for formulation in ("euler_embedded", "kinetic_only", "chain_rule")
    )
    state = {"qdd0": 0.0, "qd0_old": 1.0, "I": 1.0, "k": 1.0}
    # The state after the step is the same for every dt: q = 1, qd = 1.
    steps = [(dt, float(flawed.evaluate({**state, "q0_old": 1.0 - dt, "dt": dt})["p0_dot"])) for dt in STEPS]
    torque, error = _arm()
    return Lesson(
        flawed, kinetic, right, spurious_nodes(flawed), str(equation3("euler_embedded")), steps, error, torque, ARM_DT
    )


def _arm() -> tuple[float, float]:
    """Largest torque of the three-link arm, and largest error of kinetic only, at a state without acceleration."""
    arm = scenes.load("triple_pendulum")
    q, qd = np.array(ARM_Q), np.array(ARM_QD)
    at = {f"qdd{i}": 0.0 for i in range(3)} | {f"qd{i}": qd[i] for i in range(3)} | {f"q{i}": q[i] for i in range(3)}
    before = {f"q{i}_old": q[i] - qd[i] * ARM_DT for i in range(3)} | {f"qd{i}_old": qd[i] for i in range(3)}
    right = _torques(inverse_dynamics(arm), at)
    wrong = _torques(inverse_dynamics(arm, "kinetic_only"), at | before | {"dt": ARM_DT})
    return float(np.abs(right).max()), float(np.abs(wrong - right).max())


def _torques(graph: Graph, values: Mapping[str, float]) -> NDArray[np.float64]:
    torques = graph.evaluate({name: values[name] for name in graph.input_names})
    return np.array([torques[name] for name in graph.outputs])

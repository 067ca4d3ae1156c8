"""Subject of a lesson: a model in a moving state, its names, units and words, and its graphs for scripts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array
from dynamics import System, Verdict, display_names, formulation_verdict
from dynamics.equations.states.consistent_state import nearest_state
from dynamics.integrators import TABLEAUS
from dynamics.multibody.bodies.joint_coordinates import display_units
from dynamics.scenes.scenes import Scene, of_model, two_link
from dynamics.scenes.start import moving_start
from dynamics.systems.model import Model

from .. import theme
from ..graph_drawing.render import render_svg
from ..pages.operations import expression

if TYPE_CHECKING:
    from graphviz import Digraph

DT = 1e-3  # s, of the embedded formulations
LARGEST_GRAPH = 4000  # nodes that the page computes many times a second
SHOWN = 6  # joints with a slider or a row of their own; of more, the first
REACH = 3.2  # of a slider to both sides of 0
_RADIANS = {
    f"{kind}{i}": unit
    for i in range(2)
    for kind, unit in {"q": "rad", "q_old": "rad", "qd": "rad/s", "qdd": "rad/s²", "tau": "N m", "p": "N m s"}.items()
}  # of the two-link arm, whose Lagrangian is written out
_FORCES = {"N m": "torque", "N": "force"}
_SPEEDS, _ACCELERATIONS, _BENDS = (1.0, -0.8, 0.6), (0.5, 1.0, -0.7), (0.0, -0.8, 0.9)  # in turn, for the joints


@dataclass(frozen=True)
class Subject:
    """A system at a state.  q: (nq,).  qd, qdd: (n,).  names: {name in graphs: what a person reads}."""

    scene: Scene
    q: Array
    qd: Array
    qdd: Array
    names: Mapping[str, str] = field(default_factory=dict)
    _drawn: dict[str, str] = field(default_factory=dict, init=False)  # SVG of DOT

    @property
    def system(self) -> System:
        """The Lagrangian system."""
        return self.scene.system

    @property
    def joints(self) -> list[str]:
        """Names of the velocities."""
        return list(self.system.velocities)

    @cached_property
    def units(self) -> dict[str, str]:
        """{name in graphs: unit}, empty where the model does not say."""
        if self.scene.mechanism is not None:
            return display_units(self.scene.mechanism.moving)
        return _RADIANS if self.scene.about == two_link().about else {}

    @property
    def joint(self) -> str:
        """What one of the places that move is called."""
        return "joint" if self.units else "coordinate"

    @property
    def force(self) -> str:
        """What tau is called: a torque, a force, or what stands for both."""
        kinds = {self.units.get(f"tau{i}") for i in range(self.system.n)}
        return _FORCES.get(next(iter(kinds)) or "", "generalized force") if len(kinds) == 1 else "generalized force"

    def unit(self, name: str) -> str:
        """A space and the unit of an input or output; nothing where the model has none."""
        unit = self.units.get(name, "")
        return f" {unit}" if unit not in ("", "1") else ""

    def with_unit(self, name: str) -> str:
        """Display name of an input or output, with its unit: q.elbow [rad]."""
        unit = self.unit(name).strip()
        return f"{self.shown(name)} [{unit}]" if unit else self.shown(name)

    @cached_property
    def verdict(self) -> Verdict:
        """The verdict on the formulation by definition."""
        return formulation_verdict(self.scene, "by_definition")

    @property
    def verdict_text(self) -> str:
        """The verdict in a sentence, in the letters of the lesson, as HTML."""
        return in_letters(self.verdict.summary).replace("the torque is", f"the {self.force} is", 1)

    @cached_property
    def slopes(self) -> Array:
        """dL/dq of every velocity at the state, (n,): what by definition has too much; what is only rounding as 0."""
        found = self.verdict.excess_at(self.values)
        return np.array([found.get(f"tau{i}", 0.0) for i in range(self.system.n)])

    @property
    def watched(self) -> int:
        """The velocity that questions are about: the first with the largest slope."""
        return int(np.abs(self.slopes).argmax())

    @cached_property
    def rates(self) -> dict[str, float]:
        """Rates of coordinates, velocities and the time at the state."""
        moved = Graph([*self.system.q, *self.system.qd], {f"q{i}": rate for i, rate in enumerate(self.system.q_dot)})
        found = moved.evaluate(dict(zip(moved.input_names, (*self.q.tolist(), *self.qd.tolist()), strict=True)))
        known = {name: float(rate) for name, rate in found.items()}
        return known | {f"qd{i}": float(rate) for i, rate in enumerate(self.qdd)} | {"t": 1.0}

    @cached_property
    def values(self) -> dict[str, float]:
        """All inputs of the graphs at the state, without applied torques, at t = 0."""
        known: dict[str, float] = {"t": 0.0, "dt": DT, **self.system.parameters}
        for name, array in (("q", self.q), ("qd", self.qd), ("qdd", self.qdd), ("tau", 0.0 * self.qd)):
            known |= {f"{name}{i}": float(value) for i, value in enumerate(array)}
        known |= {f"q{i}_old": known[f"q{i}"] - DT * self.rates[f"q{i}"] for i in range(len(self.q))}
        return known | {f"qd{i}_old": known[f"qd{i}"] - DT * known[f"qdd{i}"] for i in range(len(self.qd))}

    def evaluate(self, graph: Graph, **other: float) -> Array:
        """Outputs of a graph at the state, some of its inputs others."""
        values = self.values | other
        found = graph.evaluate({name: values[name] for name in graph.input_names})
        return np.array([float(value) for value in found.values()])

    def sliders(self, kinds: Sequence[str] = ("q",), most: int = SHOWN) -> list[dict[str, object]]:
        """Sliders for the inputs of these kinds of the first joints; none where velocities are no rates of coordinates."""
        free = self.system.kinematics.quasi is None
        names = [f"{kind}{i}" for kind in kinds for i in range(min(self.system.n, most)) if free]
        return [
            {"name": name, "shown": self.with_unit(name), "low": -REACH, "high": REACH, "value": self.values[name]}
            for name in names
        ]

    def svg(self, drawing: Digraph) -> str:
        """A drawing as SVG, made once where it is used more than once."""
        source = drawing.source
        if source not in self._drawn:
            self._drawn[source] = render_svg(source)
        return self._drawn[source]

    def play(self, kind: str, graphs: Mapping[str, Graph], **other: object) -> dict[str, object] | None:
        """What the page's script draws by these graphs at its state; None where they are too large for it.

        Under "modules" is a text for the script, {name: module}, of a graph called "rate" with steps.
        """
        if sum([len(graph.nodes) for graph in graphs.values()]) > LARGEST_GRAPH:
            return None
        modules = [
            f"{name}: {expression(cg.to_js(graph, TABLEAUS if name == 'rate' else None))}"
            for name, graph in graphs.items()
        ]
        return {"kind": kind, "modules": f"{{ {', '.join(modules)} }}"} | other

    def shown(self, name: str) -> str:
        """Display name of an input, output or node."""
        return self.names.get(name, theme.pretty(name))

    def told(self, name: str) -> str:
        """Display name of an input, output or node, as HTML."""
        return escape(self.shown(name))


def subject_of(model: Model) -> Subject:
    """A model in a state that moves at every joint. Raises TypeError for what has no Lagrangian."""
    scene = of_model(model)
    system = scene.system  # a first-order one has none
    scene = moving_start(scene)
    q, qd, qdd = np.array(scene.q), np.array(scene.qd), np.resize(_ACCELERATIONS, system.n)
    qd = np.where(qd == 0.0, np.resize(_SPEEDS, system.n), qd)
    qdd[qdd == qd] *= 2.0  # a value and its rate are two numbers
    if system.n > 1 and system.kinematics.quasi is None:
        q = q + np.resize(_BENDS, system.n)  # a straight arm is a special place, and so is 0
        q[q == 0.0] = 0.4
    if len(system.constraints):
        q, qd = nearest_state(scene, q, qd)
    return Subject(scene, q, qd, qdd, display_names(scene))


def lagrangian_graph(system: System) -> Graph:
    """The Lagrangian, simplified."""
    return cg.simplify(system.graph({"L": system.lagrangian}, system.q, system.qd))


def in_letters(text: str) -> str:
    """A sentence of a verdict in the letters of the lesson, as HTML."""
    letters = {"tau.": "τ.", "dL/dq": "∂L/∂q", "dK/dq": "∂K/∂q", "qd ": "q̇ ", "qd.": "q̇."}
    for plain, pretty in letters.items():
        text = text.replace(plain, pretty)
    return escape(text)


def number(value: float) -> str:
    """Four digits, with a minus that is one."""
    return f"{value:.4g}".replace("-", "−") if value else "0"

"""Causes of a torque, or of how it depends on something: a number, a unit and a bar each, which add up to it."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import cgraph as cg
from cgraph import Graph, GraphError
from cgraph._shared import Json, or_nearest
from cgraph.extend import Names, cotangents
from dynamics import Scene, display_names, torque_by_cause
from dynamics.multibody.bodies.joint_coordinates import display_units
from dynamics.multibody.quantities.torque_causes import SPURIOUS
from dynamics.systems.kinematics import ONE, changes

BAR, BODIES, ZEROS = 24, 6, 6  # characters of the longest bar; bodies listed of a cause; names listed of what is 0
ROUNDING = 1e-14  # of the sum of all sizes: what is smaller is told as 0
MEANT = {"centrifugal": "coriolis", "weight": "gravity"}  # {what a person may ask for: the cause that has it}
POTENTIAL = ("gravity", "spring", "springs")  # which a Lagrangian that is no body's does not tell apart


@dataclass(frozen=True)
class Causes:
    """Causes of one number; `str` of it is the list.

    what: the number's name.  unit: empty where it is not known.  value: from the equations themselves.
    parts: {"gravity of link 3": its part}, which add up to the value if they are all.
    """

    what: str
    unit: str
    value: float
    parts: Mapping[str, float]

    @property
    def sum(self) -> float:
        """The sum of the parts."""
        return sum(self.parts.values())

    @cached_property
    def least(self) -> float:
        """What a part is told as 0 up to."""
        return ROUNDING * math.fsum(map(abs, self.parts.values()))

    def grouped(self) -> list[tuple[str, float, list[tuple[str, float]]]]:
        """(cause, its part, [(body, its part)]), the largest first, without what is 0."""
        groups: dict[str, dict[str, float]] = {}
        for name, part in self.parts.items():
            cause = _cause(name)
            if abs(part) > self.least:
                groups.setdefault(cause, {})[name.removeprefix(cause).strip()] = part
        found = [
            (cause, sum(bodies.values()), sorted(bodies.items(), key=lambda each: -abs(each[1])))
            for cause, bodies in groups.items()
        ]
        return sorted(found, key=lambda each: -abs(each[1]))

    def rows(self) -> list[tuple[str, float]]:
        """Lines of the list: causes, and under one of several bodies these."""
        rows: list[tuple[str, float]] = []
        for cause, total, bodies in self.grouped():
            if len(bodies) == 1:
                rows.append((f"{cause} {bodies[0][0]}".strip(), total))
                continue
            rows.append((cause, total))
            rows += [(f"  {body}", part) for body, part in bodies[:BODIES]]
            if rest := bodies[BODIES:]:
                rows.append((f"  of {len(rest)} more", sum(part for _, part in rest)))
        return rows

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        head = f"{self.what} = {self.value:.6g}{unit}, the sum of"
        rows, balance = self.rows(), f"= {self.what}; difference {abs(self.sum - self.value):.1g}"
        lines = [head, *_listed([*rows, ("sum", self.sum)], {len(rows): balance})]
        zeros = [name for name, part in self.parts.items() if abs(part) <= self.least]
        more = [f"{len(zeros) - ZEROS} more"] if len(zeros) > ZEROS else []
        lines += [f"  0 here: {', '.join([*zeros[:ZEROS], *more])}."] if zeros else []
        return "\n".join([*lines, *self._blame()])

    def _blame(self) -> list[str]:
        wrong = math.fsum([part for name, part in self.parts.items() if name.startswith(SPURIOUS)])
        if abs(wrong) <= self.least:
            return []
        right = self.value - wrong
        right = right if abs(right) > ROUNDING * (abs(self.value) + abs(wrong)) else 0.0
        told = f"without it {self.what} would be {right:.6g}"
        return [f"  What is spurious is no physics, but a mistake of the formulation: {told}."]

    def to_dict(self) -> dict[str, Json]:
        """Dictionary for JSON."""
        return {"what": self.what, "unit": self.unit, "value": self.value, "sum": self.sum, "parts": dict(self.parts)}


@dataclass(frozen=True)
class CauseInAll:
    """One cause, or all that a body makes, in every torque where it is not 0; `str` of it is the list."""

    name: str
    causes: Sequence[Causes]

    def __str__(self) -> str:
        if not self.causes:
            return f"{self.name}: 0 in every torque here."
        rows: list[tuple[str, float]] = []
        ends: dict[int, str] = {}
        for each in self.causes:
            ends[len(rows)] = f"of {each.value:.4g} {each.unit}".rstrip()
            rows.append((each.what, each.sum))
            alone = len({_cause(name) for name in each.parts}) == 1  # which the head names
            rows += each.rows()[1:] if alone else [(f"  {name}", part) for name, part in each.rows()]
        return "\n".join([f"{self.name}, in each of", *_listed(rows, ends)])

    def to_dict(self) -> dict[str, Json]:
        """Dictionary for JSON."""
        return {"name": self.name, "causes": [each.to_dict() for each in self.causes]}


def _listed(rows: Sequence[tuple[str, float]], ends: Mapping[int, str]) -> list[str]:
    """A line for every (name, number), with a bar; or after the bar, of rows in `ends`, a text; of "sum" no bar."""
    width = max([len(name) for name, _ in rows], default=0)
    longest = max([abs(part) for name, part in rows if name != "sum"], default=0.0)
    lines = []
    for i, (name, part) in enumerate(rows):
        size = BAR * abs(part) / longest if longest else 0.0
        bar = "" if name == "sum" else ("+" if part > 0.0 else "-") * (round(size) or int(part != 0.0))
        if i in ends and bar:
            bar = f"{bar:<{BAR}}"
        lines.append(f"  {name:<{width}}  {part:>+11.4g}  {'  '.join(filter(None, [bar, ends.get(i, '')]))}".rstrip())
    return lines


class CauseTable:
    """The torques of a scene by a formulation, to be asked at a point for causes of one, or for one cause in all.

    graph: the formulation's equations.  at: the point, by the graph's names.
    """

    def __init__(self, scene: Scene, graph: Graph, formulation: str, at: Mapping[str, float]) -> None:
        self.table = torque_by_cause(scene, formulation)
        self.graph, self.at, self.called = graph, at, display_names(scene)
        self.names = Names(graph, self.called)
        self.units = {} if scene.mechanism is None else display_units(scene.mechanism.moving)

    def named(self, text: str) -> str:
        """The torque that a text names, as the graph has it: tau2 of "tau.elbow" or "elbow"; empty for none."""
        for name in (text, f"tau.{text}"):
            if (meant := self.names.meant(name)) in self.graph.outputs:
                return meant
        return ""

    def rows(self, text: str) -> list[str]:
        """The rows that a text names: "gravity", "coriolis of link 2", "link 2"; any case. Empty for none."""
        asked = " ".join(text.lower().split())
        first, *rest = asked.split(" ", 1)
        asked = " ".join([MEANT.get(first, first), *rest])
        rows = {name: name.lower() for name in self.table.rows}
        found = (
            [name for name, row in rows.items() if row == asked]
            or [name for name, row in rows.items() if row.startswith(f"{asked} ")]
            or [name for name, row in rows.items() if row.endswith((f" of {asked}", f" on {asked}"))]
        )
        return found or (self.rows("potential") if asked in POTENTIAL else [])

    def of(self, output: str, by: str = "", rows: Sequence[str] = ()) -> Causes:
        """Causes of an output, or of its derivative by an input or a named node; some of the rows or all of them.

        Raises GraphError for an input that is none.
        """
        every = {name: self.table.graph.outputs[f"{output}_{k}"] for k, name in enumerate(self.table.rows)}
        chosen = {name: every[name] for name in rows or every}
        own = Names(self.table.graph, self.called)
        what, unit = self.names.shown(output), self.units.get(output, "")
        whole = self.graph.outputs[output]
        if by:
            source = self.names.one(by, "input")
            nodes = own.by_name.get(str(source.name), [])
            slopes = changes(dict.fromkeys(nodes[:1], ONE), chosen.values())
            chosen = dict(zip(chosen, slopes, strict=True))
            (whole,) = changes({source: ONE}, [whole])
            what = f"d {what} / d {self.names.called(by)}"
            beside = self.units.get(str(source.name), "")
            unit = unit if beside == "1" else f"{unit} per {beside}" if unit and beside else ""
        outputs = {str(k): node for k, node in enumerate(chosen.values())}
        values = Graph(self.table.graph.inputs, outputs).evaluate(self.at)
        value = float(Graph(self.graph.inputs, {"value": whole}).evaluate(self.at)["value"])
        parts = {name: float(values[str(k)]) for k, name in enumerate(chosen)}
        return Causes(what, unit, value, parts)

    def in_all(self, text: str, by: str = "") -> CauseInAll:
        """One cause, or a body, in every torque where it is not 0, the largest first. Raises GraphError for neither."""
        rows = self.rows(text)
        if not rows:
            outputs = [self.names.shown(name) for name in self.graph.outputs]
            known = list(dict.fromkeys([*map(_cause, self.table.rows), *outputs, *self.table.rows]))
            raise GraphError(f"there is no torque and no cause {text!r:.80}; {or_nearest(text, known)}")
        found = [self.of(output, by, rows) for output in self.graph.outputs if output.startswith("tau")]
        least = ROUNDING * max([abs(part) for each in found for part in each.parts.values()], default=0.0)
        there = [each for each in found if any(abs(part) > least for part in each.parts.values())]
        kinds = {_cause(name) for name in rows}
        name = kinds.pop() if len(kinds) == 1 else f"what {rows[0].removeprefix(_cause(rows[0]))[4:]} does"
        name = rows[0] if len(rows) == 1 else name
        return CauseInAll(name, sorted(there, key=lambda each: -abs(each.sum)))


def _cause(name: str) -> str:
    """`gravity` of "gravity of link 2"."""
    return re.split(" of | on ", name, maxsplit=1)[0]


class Slopes:
    """Derivatives of an output, or a named node, by all inputs at a point; `str` of it lists them with bars."""

    def __init__(self, names: Names, output: str, at: Mapping[str, float]) -> None:
        node, inputs = names.output(output), list(names.graph.inputs)
        bars = cotangents({node: cg.constant(1.0)}, inputs)
        found = Graph(inputs, {"value": node} | {f"slope {i}": bar for i, bar in enumerate(bars)}).evaluate(at)
        slopes = {names.text(each): float(found[f"slope {i}"]) for i, each in enumerate(inputs)}
        self.what, self.value = names.called(output), float(found["value"])
        self.slopes = dict(sorted([each for each in slopes.items() if each[1]], key=lambda each: -abs(each[1])))

    def __str__(self) -> str:
        rows = _listed(list(self.slopes.items()), {})
        about = "Its derivatives by what it depends on:" if rows else "No input changes it here."
        return "\n".join([f"{self.what} = {self.value:.6g}. {about}", *rows])

    def to_dict(self) -> dict[str, Json]:
        """Dictionary for JSON."""
        return {"what": self.what, "value": self.value, "derivatives": self.slopes}

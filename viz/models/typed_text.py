"""A system's Lagrangian as the text that the typed page reads."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Sequence
from unicodedata import normalize

import numpy as np

from cgraph import Node
from cgraph._shared import columns, real_array
from cgraph.extend import OPS, topological
from dynamics.systems.model import Model, as_system
from dynamics.systems.system import System

MOST_COORDINATES = 4  # coordinates that the page takes
_NAME = re.compile(r"[^\W\d_][A-Za-z0-9_]*")
_RESERVED = re.compile(r"(q|qd|qdd|tau|lambda)\d+(_old)?|t|dt|pi|π|.+dot\d*|time|damping|tau|force|coordinates?|[qLTV]")
_ALIASES = ("ln", "arcsin", "arccos", "arctan", "arctan2", "min", "max")  # functions of the page beside the operations
_DOTS = "\N{COMBINING DOT ABOVE}\N{COMBINING DIAERESIS}"
_SUM, _POWER, _WHOLE = 1, 8, 9  # how strongly a sign binds, a power, and a name or a function


def typed_text(model: Model, q: Sequence[float] | None = None, qd: Sequence[float] | None = None) -> str:
    """The Lagrangian of a system as text, as `typed_page` takes it: coordinates, parameters, L, damping and forces.

    What a Lagrangian uses more than once becomes a line of its own. The text means the same graph, node for node.

    Parameters
    ----------
    model : Model
        A system, or a mechanism or scene with one, of up to 4 coordinates whose rates are its velocities.
    q, qd : sequence of n floats, optional
        The start [rad or m, rad/s or m/s]. By default 0.

    Returns
    -------
    str
        The text. Coordinates and parameters with names that it cannot have are renamed.

    Raises
    ------
    TypeError
        For what is no model, or has no Lagrangian, and a start that is not of numbers.
    ValueError
        For a start of another length, more coordinates, constraints, quasi-velocities, or an operation that has no
        text.

    Examples
    --------
    >>> import dynamics as dyn
    >>> spring = dyn.System(lambda q, qd, t, p: 0.5 * qd[0] ** 2 - p["k"] * q[0] ** 2, ["x"], {"k": 2.0}, damping=0.1)
    >>> print(typed_text(spring, q=[1.0]))
    q: x
    k = 2
    L = 0.5 * x'^2 - k * x^2
    damping x = 0.1
    x(0) = 1
    """
    system = as_system(model)
    if system.n > MOST_COORDINATES or system.kinematics.quasi is not None or len(system.constraints):
        raise ValueError(
            f"the page takes up to {MOST_COORDINATES} coordinates whose rates are velocities, without constraints; "
            f"got {system!r}"
        )
    return _Writer(system).text(_start("q", q, system), _start("qd", qd, system))


def _start(what: str, values: Sequence[float] | None, system: System) -> list[float]:
    """Numbers for every coordinate; none where nothing is said."""
    if values is None:
        return []
    found = real_array(what, values)
    if found.shape != (system.n,) or not np.isfinite(found).all():
        raise ValueError(f"{what} needs {system.n} finite numbers, got {values!r:.60}")
    return list(map(float, found))


def text_or_none(model: Model, q: Sequence[float], qd: Sequence[float]) -> str:
    """The text of a model, or an empty one where it has none."""
    try:
        return typed_text(model, q, qd)
    except (TypeError, ValueError):
        return ""


class _Writer:
    """Names and texts of one system's nodes."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.taken: set[str] = set()
        self.coordinates = [self._free(name, f"c{i + 1}") for i, name in enumerate(system.coordinates)]
        parameters = {name: self._free(name, "p") for name in system.parameters}
        self.known: dict[str, str] = {"t": "t", **parameters}
        for i, name in enumerate(self.coordinates):
            self.known |= {f"q{i}": name, f"qd{i}": f"{name}'"}
        self.parameters = [f"{parameters[name]} = {_number(value)}" for name, value in system.parameters.items()]
        self.definitions: list[str] = []
        self.written: dict[Node, tuple[str, int]] = {}

    def text(self, q: Sequence[float], qd: Sequence[float]) -> str:
        """Text of all lines."""
        system, forces = self.system, list(self.system.forces)
        own = [row[i] for i, row in enumerate(system.damping_rows)]
        for i, row in enumerate(system.damping_rows):  # dampers between coordinates are forces
            for k, each in enumerate(row):
                if k != i and each != 0.0:
                    forces[i] = forces[i] - each * system.qd[k]
        order = topological([system.lagrangian, *forces, *[node for node in own if isinstance(node, Node)]])
        uses = Counter([arg for node in order for arg in node.args])
        for node in order:
            self.written[node] = self._formula(node)
            if node.args and uses[node] > 1:
                name = self._free(node.name or "", "s1")
                self.definitions.append(f"{name} = {self.written[node][0]}")
                self.written[node] = name, _WHOLE
        lines = [f"q: {', '.join(self.coordinates)}", *self.parameters, *self.definitions]
        lines.append(f"L = {self.written[system.lagrangian][0]}")
        for kind, values in (("damping", own), ("tau", forces)):
            for name, value in zip(self.coordinates, values, strict=True):
                text = self.written[value][0] if isinstance(value, Node) else _number(value)
                lines += [f"{kind} {name} = {text}"] if text not in ("0", "-0") else []
        for dots, start in (("", q), ("'", qd)):
            lines += [
                f"{name}{dots}(0) = {_number(value)}" for name, value in zip(self.coordinates, start, strict=False)
            ]
        return "\n".join(lines)

    def _free(self, wanted: str, otherwise: str) -> str:
        """The name, if a text may have it and no other has it, or a free one with a number."""
        wanted = re.sub(r"[^\w]", "", wanted)
        wanted = wanted if _usable(wanted) else otherwise
        stem, number = wanted.rstrip("0123456789"), 1
        while wanted in self.taken or not _usable(wanted):
            number += 1
            wanted = f"{stem}_{number}" if _RESERVED.fullmatch(f"{stem}{number}") else f"{stem}{number}"
        self.taken.add(wanted)
        return wanted

    def _formula(self, node: Node) -> tuple[str, int]:
        """The text of a node, and how strongly its outermost operation binds."""
        if node.value is not None:
            if not math.isfinite(node.value):
                raise ValueError(f"the Lagrangian has the number {node.value}, which cannot be typed")
            return _number(node.value), _WHOLE if math.copysign(1.0, node.value) > 0.0 else _SUM
        if not node.args:
            return self.known[str(node.name)], _WHOLE
        if node.op.name == "zero_safe_mul":
            raise ValueError(f"the Lagrangian has the operation {node.op.name!r}, which cannot be typed")
        parts = [self.written[arg] for arg in node.args]
        if node.op.name == "pow":
            return "^".join([self._part(part, _WHOLE) for part in parts]), _POWER
        if (infix := columns(node.op).infix) is not None and infix[1]:  # relations are functions
            symbol, strength = infix
            return f"{self._part(parts[0], strength)} {symbol} {self._part(parts[1], strength + 1)}", strength
        if columns(node.op).signs == (-1,):
            return f"-{self._part(parts[0], _SUM + 1)}", _SUM
        return f"{node.op.name}({', '.join([text for text, _ in parts])})", _WHOLE

    @staticmethod
    def _part(part: tuple[str, int], least: int) -> str:
        """A text in parentheses, unless it binds as strongly as its place asks for and has no sign in front."""
        text, binds = part
        return text if binds >= least and not text.startswith("-") else f"({text})"


def _usable(name: str) -> bool:
    """Whether a text may have a name of its own that is spelled so."""
    rate = {*normalize("NFD", name)} & {*_DOTS}  # ẋ is a rate, and ö an acceleration
    return bool(_NAME.fullmatch(name)) and not (rate or _RESERVED.fullmatch(name) or name in {*OPS, *_ALIASES})


def _number(value: float) -> str:
    """Number with all its digits, and no point where none is needed."""
    return repr(float(value)).removesuffix(".0")

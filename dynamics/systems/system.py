"""Lagrangian systems: L(q, qd, t), its parameters, damping and applied forces, as nodes."""

from __future__ import annotations

import inspect
import math
import numbers
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, NoReturn

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import real_number, topological

TIME = "t"
BiasForce = tuple[Node, Node]  # a velocity, and the force that is there
_RESERVED = re.compile(r"(q|qd|qdd|tau)\d+(_old)?|t|dt")


class Parameters(dict[str, Node]):
    """{name: node} of the parameters of a system, as its functions get them."""

    def __init__(self, names: Iterable[str]) -> None:
        super().__init__({name: cg.variable(name) for name in names})

    def __missing__(self, name: str) -> NoReturn:
        has = ", ".join(self) or "none"
        raise ValueError(f"the system has no parameter {name!r} (it has {has}); give it to `parameters`")


class System:
    """A mechanical system with Lagrangian L(q, qd, t) = K - P.

    lagrangian(q, qd, t) or (q, qd, t, p): gives L as a node, or a sequence of partial Lagrangians L_i that are summed.
        q, qd: sequences of nodes in the order of `coordinates`; t: a node; p: {parameter name: node}.
    coordinates: their names, for messages and drawings; graphs have inputs q0, q1, ... in this order.
    parameters: {name: value}; each is an input of the graphs, and `simulate` binds it to the value.
    forces(q, qd, t[, p]): one generalized force for each coordinate, node or number, beside the applied tau.
    damping: viscous coefficient >= 0 for all coordinates or for each; the force is -damping * qd.

    The equation of motion is  d/dt dL/dqd - dL/dq = tau + forces - damping * qd.

    Raises TypeError or ValueError, naming what was given and what was needed.
    """

    def __init__(
        self,
        lagrangian: Callable[..., Node | Sequence[Node]],
        coordinates: Sequence[str],
        parameters: Mapping[str, float] | None = None,
        forces: Callable[..., Sequence[Node | float]] | None = None,
        damping: float | Sequence[float] = 0.0,
    ) -> None:
        self.coordinates = _coordinate_names(coordinates)
        self.parameters = {name: parameter_value(name, value) for name, value in (parameters or {}).items()}
        self.damping = per_coordinate("damping", damping, self.n, minimum=0.0)
        p = Parameters(self.parameters)
        given = called("lagrangian", lagrangian, self.q, self.qd, self.t, p)
        partials = [given] if isinstance(given, (Node, numbers.Real)) else sequence("the lagrangian must give", given)
        if not partials:
            raise ValueError("the lagrangian gave no partial Lagrangians")
        self.partial_lagrangians = tuple([as_node("the lagrangian", each) for each in partials])
        applied: Sequence[Node | float] = [0.0] * self.n
        if forces is not None:
            with cg.tag("force"):
                applied = sequence("forces must give", called("forces", forces, self.q, self.qd, self.t, p))
            if len(applied) != self.n:
                raise ValueError(f"forces must give {self.n} values, one for each coordinate, got {len(applied)}")
        self.forces = tuple([as_node("forces", each) for each in applied])
        known = {*self.q, *self.qd, self.t, *p.values()}
        for node in topological((*self.partial_lagrangians, *self.forces)):
            if node.op.name == "variable" and node not in known:
                raise ValueError(f"the system uses {node.name!r}, which is no coordinate, parameter or t")

    @property
    def system(self) -> System:
        """The system itself, as a `Model` has it."""
        return self

    @property
    def ode(self) -> None:
        """None: no first-order system."""
        return None

    @property
    def mechanism(self) -> None:
        """None: a Lagrangian alone has no bodies."""
        return None

    @property
    def n(self) -> int:
        """Number of coordinates."""
        return len(self.coordinates)

    @cached_property
    def q(self) -> list[Node]:
        """Coordinates, variables q0, q1, ..."""
        return cg.variables([f"q{i}" for i in range(self.n)])

    @cached_property
    def qd(self) -> list[Node]:
        """Velocities, variables qd0, qd1, ..."""
        return cg.variables([f"qd{i}" for i in range(self.n)])

    @cached_property
    def qdd(self) -> list[Node]:
        """Accelerations, variables qdd0, qdd1, ..."""
        return cg.variables([f"qdd{i}" for i in range(self.n)])

    @cached_property
    def tau(self) -> list[Node]:
        """Applied forces, variables tau0, tau1, ..."""
        return cg.variables([f"tau{i}" for i in range(self.n)])

    @cached_property
    def t(self) -> Node:
        """Time."""
        return cg.variable(TIME)

    @cached_property
    def extra_inputs(self) -> list[Node]:
        """Inputs that every graph of the system has after its state: t if anything depends on it, and parameters."""
        reached = set(topological((*self.partial_lagrangians, *self.forces)))
        time = [self.t] if self.t in reached else []
        return [*time, *cg.variables(list(self.parameters))]

    @cached_property
    def lagrangian(self) -> Node:
        """L, the sum of the partial Lagrangians (the paper, section 4.3)."""
        return _sum(self.partial_lagrangians)

    @cached_property
    def kinetic(self) -> Node:
        """K: the terms of L that depend on the velocities."""
        return self._split[0]

    @cached_property
    def potential(self) -> Node:
        """P: the terms of L that do not depend on the velocities, with their sign turned; L = K - P."""
        return self._split[1]

    @cached_property
    def _split(self) -> tuple[Node, Node]:
        moving = set(self.qd)
        for node in topological([self.lagrangian]):
            if any(arg in moving for arg in node.args):
                moving.add(node)
        kinetic: list[Node] = []
        potential: list[Node] = []
        stack = [(1, self.lagrangian)]
        while stack:  # take sums apart until each term has velocities in it throughout, or none
            sign, node = stack.pop()
            if node.op.name in ("add", "sub") and node in moving:
                a, b = node.args
                stack += [(-sign if node.op.name == "sub" else sign, b), (sign, a)]
            elif node.op.name == "neg" and node in moving:
                stack.append((-sign, node.args[0]))
            elif node in moving:
                kinetic.append(node if sign > 0 else -node)
            else:
                potential.append(node if sign < 0 else -node)
        return _sum(kinetic), _sum(potential)

    def bias_forces(self) -> Sequence[BiasForce] | None:
        """The bias as forces f at velocities z, nodes of L: sum of f dz/dqd = d/dt dL/dqd - dL/dq at qdd = 0.

        None where nobody knows better than to derive it from L, as here.
        """
        return None

    def graph(self, outputs: Mapping[str, Node], *state: Sequence[Node]) -> Graph:
        """A graph over state variables, then t if needed, then the parameters."""
        return Graph([node for part in state for node in part] + self.extra_inputs, outputs)

    def __repr__(self) -> str:
        parameters = f", parameters {', '.join(self.parameters)}" if self.parameters else ""
        return f"<System of {self.n} coordinate(s) {', '.join(self.coordinates[:6])}{parameters}>"


class BodySystem(System):
    """The system of bodies that give their bias themselves, by bias_forces(q, qd)."""

    def __init__(
        self,
        bias_forces: Callable[[Sequence[Node], Sequence[Node]], Sequence[BiasForce]],
        *of_system: Any,
        **more: Any,
    ) -> None:
        super().__init__(*of_system, **more)
        self._bias_forces = bias_forces

    def bias_forces(self) -> Sequence[BiasForce]:
        """See System."""
        return self._bias_forces(self.q, self.qd)


def per_coordinate(what: str, value: float | Sequence[float], n: int, minimum: float = -math.inf) -> tuple[float, ...]:
    """One finite number for each coordinate, from one for all or a sequence. Raises ValueError otherwise."""
    values = [value] * n if isinstance(value, numbers.Real) else sequence(f"{what} must be", value)
    if len(values) != n:
        raise ValueError(f"{what} needs one number for each of the {n} coordinates, got {len(values)}")
    for i, each in enumerate(values):
        if not math.isfinite(real_number(f"{what} of coordinate {i}", each)) or each < minimum:
            bound = f" and at least {minimum:g}" if math.isfinite(minimum) else ""
            raise ValueError(f"{what} must be finite{bound}, got {each!r} for coordinate {i}")
    return tuple([float(each) for each in values])


def _coordinate_names(names: Sequence[str]) -> tuple[str, ...]:
    if isinstance(names, str):
        names = names.split()
    if not names:
        raise ValueError("a system needs at least one coordinate")
    for name in names:
        if not isinstance(name, str) or not name:
            raise TypeError(f"a coordinate's name must be a non-empty string, got {name!r}")
    if len(set(names)) < len(names):
        raise ValueError(f"coordinate names must differ, got {', '.join(names)}")
    return tuple(names)


def parameter_value(name: str, value: float) -> float:
    """The value of a parameter, checked. Raises TypeError or ValueError naming it."""
    if not isinstance(name, str):
        raise TypeError(f"a parameter's name must be a string, got {name!r:.60}")
    if _RESERVED.fullmatch(name):
        raise ValueError(f"parameter {name!r} has the name of a coordinate, velocity, force or time; choose another")
    if isinstance(value, bool) or not isinstance(value, numbers.Real) or not math.isfinite(value):
        raise ValueError(f"parameter {name!r} must be a finite number, got {value!r}")
    return float(value)


def called(what: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """function(*arguments), or without the last of them, the parameters, where it does not take them.

    Raises TypeError, naming `what`, for what is no such function.
    """
    names = "(q, qd, t) or (q, qd, t, p)" if len(arguments) == 4 else "(x, t) or (x, t, p)"
    if not callable(function):
        raise TypeError(f"{what} must be a function of {names}, got {function!r:.60}")
    signature = inspect.signature(function)
    for chosen in (arguments, arguments[:-1]):
        try:
            signature.bind(*chosen)
        except TypeError:
            continue
        return function(*chosen)
    raise TypeError(f"{what} must take {names}, got {signature}")


def sequence(what: str, value: Any) -> list[Any]:
    """The values as a list. Raises TypeError, "<what> a sequence ...", for what is none."""
    try:
        return list(value)
    except TypeError:
        raise TypeError(f"{what} a sequence of nodes or numbers, got {type(value).__name__}: {value!r:.60}") from None


def as_node(what: str, value: Any) -> Node:
    """The node, or the constant of a number. Raises TypeError or ValueError, naming `what`, for anything else."""
    try:
        return value if isinstance(value, Node) else cg.constant(value)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{what} must give nodes or numbers: {error}") from None


def _sum(nodes: Sequence[Node]) -> Node:
    total: Node | None = None
    for node in nodes:
        total = node if total is None else total + node
    return cg.constant(0.0) if total is None else total

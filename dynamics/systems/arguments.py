"""Arguments of systems: names, numbers, parameters and functions, checked."""

import inspect
import math
import numbers
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from inspect import Signature
from typing import Any, NoReturn

import numpy as np

import cgraph as cg
from cgraph import Node
from cgraph._shared import check_name, formulating, is_finite, is_function, or_nearest, real_number, require_mapping
from cgraph.extend import topological

TIME = "t"
ONCE = "the function is called once, with nodes, of which it makes a formula"
HINTS = {
    r"for \^": "a power is written **, as in qd[0]**2",
    r"numbers, got Node|BoundFunction|not 'Node'|not Node|<node": ONCE,
    r"'Parameters' object": "a parameter is taken by its name, as in p['m']",
    r"'Node'|Node\.|\"Node\"": "t and each entry of q and qd is a node, which cg.sin, cg.where, .. and + - * / ** take",
    r"'list'|list ind|non-int": "coordinates, velocities and states are lists in the order of their names, as q[0]",
}  # what is right, by what Python says where nodes are taken for something else
_RESERVED = re.compile(r"(q|qd|qdd|tau|lambda)\d+(_old)?|t|dt")


class Parameters(dict[str, Node]):
    """{name: node} of the parameters of a system, as its functions get them."""

    def __init__(self, names: Iterable[str]) -> None:
        super().__init__({name: cg.variable(name) for name in names})

    def __missing__(self, name: str) -> NoReturn:
        raise ValueError(
            f"the system has no parameter {name!r} ({or_nearest(str(name), list(self))}); give it to `parameters`"
        )


def names_of(what: str, kind: str, names: Sequence[str] | str, *, spaces: bool = True) -> tuple[str, ...]:
    """Names of that kind, from a sequence or one string with spaces between. Raises TypeError or ValueError."""
    if isinstance(names, str):
        names = names.replace(",", " ").split()
    kinds = f"{kind[:-1]}ies" if kind.endswith("y") else f"{kind}s"
    names = sequence(f"{kinds} must be", names)
    if not names:
        raise ValueError(f"{what} needs at least one {kind}")
    for name in names:
        check_name(f"a {kind}", name, spaces=spaces)
    if len(set(names)) < len(names):
        raise ValueError(f"{kind} names must differ, got {', '.join(names)}")
    return tuple(names)


def per_coordinate(
    what: str, value: float | Sequence[float], names: Sequence[str], minimum: float = -math.inf
) -> tuple[float, ...]:
    """One finite number for each of the names, from one for all or a sequence. Raises ValueError."""
    n = len(names)
    entries = [value] * n if isinstance(value, numbers.Real) else sequence(f"{what} must be", value)
    if len(entries) != n:
        shown = ", ".join(names[:8]) + (", ..." if n > 8 else "")
        raise ValueError(f"{what} needs one number for each of {shown}: {n}, got {len(entries)}")
    for name, number in zip(names, entries[:1] if isinstance(value, numbers.Real) else entries, strict=False):
        if not math.isfinite(real_number(f"{what} of {name!r}", number)) or number < minimum:
            bound = f" and at least {minimum:g}" if math.isfinite(minimum) else ""
            raise ValueError(f"{what} must be finite{bound}, got {number!r} for {name!r}")
    return tuple([float(number) for number in entries])


def coefficients(
    what: str, value: float | Node | Sequence[float | Node], names: Sequence[str], minimum: float = 0.0
) -> tuple[float | Node, ...]:
    """A number that is not below the minimum, or a node, for each of the named coordinates. Raises ValueError."""
    entries = [value] * len(names) if isinstance(value, numbers.Real | Node) else sequence(f"{what} must be", value)
    known = per_coordinate(what, [0.0 if isinstance(each, Node) else each for each in entries], names, minimum)
    return tuple([each if isinstance(each, Node) else number for each, number in zip(entries, known, strict=True)])


def dampers(value: Any, names: Sequence[str]) -> tuple[Any, ...]:
    """Damping: a coefficient for each of the names, or rows of a matrix that takes energy. Raises ValueError."""
    rows: Sequence[Any] = [value] if isinstance(value, numbers.Real | Node) else sequence("damping must be", value)
    if not any([hasattr(row, "__len__") for row in rows]):
        return coefficients("damping", value, names)
    if len(rows) != len(names):
        raise ValueError(f"a matrix of damping needs a row for each of {', '.join(names)}, got {len(rows)}")
    matrix = tuple([coefficients("a row of damping", row, names, -math.inf) for row in rows])
    if not any([isinstance(each, Node) for row in matrix for each in row]):
        whole = np.array(matrix, dtype=np.float64)
        scale = np.sqrt(np.where(np.diag(whole) > 0.0, np.diag(whole), 1.0))  # of units
        if np.linalg.eigvalsh((whole + whole.T) / np.outer(scale, scale))[0] < -len(names) * 2.0**-50:
            raise ValueError(f"damping must take energy, qd D qd >= 0 at all qd, which {whole.tolist()} does not")
    return matrix


def parameters_of(parameters: Mapping[str, float] | None) -> dict[str, float]:
    """{name: value}, checked. Raises TypeError or ValueError."""
    given = {} if parameters is None else require_mapping("parameters", parameters, "name: number")
    return {name: parameter_value(name, value) for name, value in given.items()}


def parameter_value(name: str, value: float) -> float:
    """The value of a parameter, checked. Raises TypeError or ValueError naming it."""
    check_name("a parameter", name, spaces=False)
    if _RESERVED.fullmatch(name):
        raise ValueError(f"parameter {name!r} has the name of a coordinate, velocity, force or time; choose another")
    if isinstance(value, bool) or not is_finite(value):
        raise ValueError(f"parameter {name!r} must be a finite number, got {value!r}")
    return float(value)


def finite_time(t: float) -> float:
    """The time [s]. Raises TypeError or ValueError for what is no finite number."""
    time = real_number("t", t)
    if not math.isfinite(time):
        raise ValueError(f"t must be finite, got {t!r} s")
    return time


def new_variables(stem: str, count: int, taken: Collection[str]) -> list[Node]:
    """Variables of this stem and a number, with more underscores where a name is taken."""
    while any(f"{stem}{k}" in taken for k in range(count)):
        stem += "_"
    return cg.variables([f"{stem}{k}" for k in range(count)])


def call_user_function(what: str, function: Callable[..., object], *arguments: object, state: str = "x") -> Any:
    """function(*arguments), or without the last of them, the parameters, where it does not take them.

    An argument with a default, as in `lambda q, qd, t, i=i: ..`, is the caller's own unless it is called t or p.
    state: what those before t are called, of others than q and qd.
    Raises TypeError, naming `what`, for what is no such function.
    """
    state = {4: "q, qd", 5: "q, qd, tau"}.get(len(arguments), state)
    names = f"({state}, t) or ({state}, t, p)"
    if not is_function(function):
        raise TypeError(f"{what} must be a function of {names}, got {function!r:.60}")
    signature = inspect.signature(function)
    for chosen, last in ((arguments, "p"), (arguments[:-1], "t")):
        if _takes(signature, len(chosen), last):
            break
    else:
        raise TypeError(f"{what} must take {names}, got {signature}")
    _require_order(what, signature, names)
    token = formulating.set(True)
    try:
        return function(*chosen)
    except (TypeError, AttributeError, IndexError, KeyError) as error:  # of Python, on nodes or a list of them
        hint = next((hint for pattern, hint in HINTS.items() if re.search(pattern, str(error))), None)
        if hint is None:
            raise
        hint += "; what needs numbers is a SampledController" if hint is ONCE and "controller" in what else ""
        raise TypeError(f"{what}: {hint} ({error})") from error
    finally:
        formulating.reset(token)


def _require_order(what: str, signature: Signature, names: str) -> None:
    """Raises TypeError for arguments of these names in other places, such as (t, x) or, of constraints, (q, qd, t)."""
    right = names.rpartition("(")[2].rstrip(")").split(", ")
    given = [*signature.parameters][: len(right)]
    wrong = [name for name, place in zip(given, right, strict=False) if name in {*right, "qd"} - {place}]
    if [name for name in wrong if name != "p" or given.index("p") == right.index("t")]:
        more = "; conditions on velocities belong to velocity_constraints=" if what == "constraints" else ""
        raise TypeError(f"{what} must take {names}, in this order, got ({', '.join(given)}){more}")


def _takes(signature: Signature, count: int, last: str) -> bool:
    """Whether so many arguments fit, of which the last has no default, or is called so: others are values kept."""
    try:
        signature.bind(*[None] * count)
    except TypeError:
        return False
    place = [*signature.parameters.values()][count - 1 : count]
    return all([each.default is each.empty or each.name == last for each in place])


def require_known(what: str, nodes: Iterable[Node], known: Collection[Node], otherwise: str) -> None:
    """Raises ValueError for a variable among nodes that is none of the known ones, in words `otherwise`."""
    for node in topological(list(nodes)):
        if node.op.name == "variable" and node not in known:
            raise ValueError(f"{what} uses {node.name!r}, which is {otherwise}")


def sequence(what: str, value: Any) -> list[Any]:
    """The values as a list. Raises TypeError, "<what> a sequence ...", for what is none, a text and a mapping."""
    try:
        if not isinstance(value, str | Mapping):
            return list(value)
    except TypeError:
        pass
    more = "; is `return` missing?" if value is None and "give" in what else ""
    raise TypeError(f"{what} a sequence, got {type(value).__name__}: {value!r:.60}{more}")


def one_for_each(what: str, given: object, names: Sequence[str], of: str) -> list[Node]:
    """A node for each of the names, of nodes or numbers that a function gave. Raises TypeError or ValueError."""
    values = sequence(f"{what} must give", given)
    if len(values) != len(names):
        raise ValueError(f"{what} must give {len(names)} values, one for each of {', '.join(names)}; got {len(values)}")
    return [node_or_number(f"{of} {name!r}", value) for name, value in zip(names, values, strict=True)]


def node_or_number(what: str, value: Any) -> Node:
    """The node, or the constant of a number. Raises TypeError or ValueError, naming `what`, for anything else."""
    try:
        if isinstance(value, bool):
            raise TypeError(f"{value} is a comparison by Python; cg.equal, cg.where, < and > compare nodes")
        return value if isinstance(value, Node) else cg.constant(value)
    except (TypeError, ValueError) as error:
        raise type(error)(f"{what} must be a node or a number: {error}") from None

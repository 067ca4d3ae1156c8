"""Statements of C or JavaScript, one for each operation, in one function or, for long graphs, in several."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from ..core.node import CONSTANT, VARIABLE, Node
from ..core.row import Row

PART = 2000  # operations in a function: compilers take more than proportionally to its length


class Statements(NamedTuple):
    """direct: results that are inputs or constants.  parts: of each function.  size: of w, values that parts share.

    ops: the operations, in the order of their first use.
    """

    direct: list[str]
    parts: list[list[str]]
    size: int
    ops: list[Row]


def statements(
    nodes: Sequence[Node],
    places: Mapping[Node, str],
    results: Sequence[tuple[str, Node]],
    number: Callable[[float], str],
    operation: Callable[[Row], str],
    local: str,
    note: Callable[[Node], str] = lambda node: "",
) -> Statements:
    """The statements that compute nodes.

    places: for each input its place in x.  results: places in y, and their nodes.  number, operation: texts of a number
    and of an operation, with {0}, {1} for arguments.  local: declares a constant.  note: what follows a statement.

    A value that its own part alone needs is a local constant, numbered as in `Graph.listing`; places in w are used
    again once nothing needs their values.
    """
    known = _known(nodes)
    steps = [node for node in nodes if node not in known and node.op is not VARIABLE]
    text = {node: f"x[{place}]" for node, place in places.items()}
    needed = {*[arg for node in steps for arg in node.args], *[node for _, node in results]}
    text |= {node: number(value) for node, value in known.items() if node in needed}
    stored: dict[Node, list[str]] = {}
    for place, node in results:
        stored.setdefault(node, []).append(place)
    listed = {node: i for i, node in enumerate([node for node in nodes if node.args], 1)}
    texts = {op: operation(op) for op in dict.fromkeys([node.op for node in steps])}
    last_use = {arg: i for i, node in enumerate(steps) for arg in node.args}
    direct = [f"y[{place}] = {text[node]};" for place, node in results if node in text]
    parts: list[list[str]] = []
    free: list[int] = []
    read_last: dict[int, list[int]] = {}  # step: the places in w that nothing reads after it
    size = 0
    for i, node in enumerate(steps):
        if i % PART == 0:
            parts.append([])
        expression = texts[node.op].format(*[text[arg] for arg in node.args])
        free += read_last.pop(i, ())
        last = last_use.get(node, i)
        if last // PART == i // PART:
            text[node] = f"v{listed[node]}"
            target = f"{local} {text[node]}"
        else:
            if not free:
                free.append(size)
                size += 1
            read_last.setdefault(last, []).append(free[-1])
            text[node] = target = f"w[{free.pop()}]"
        parts[-1].append(f"{target} = {expression};{note(node)}")
        parts[-1] += [f"y[{place}] = {text[node]};" for place in stored.get(node, ())]
    return Statements(direct, parts, size, [*texts])


def _known(nodes: Sequence[Node]) -> dict[Node, float]:
    """Values of the nodes that no input reaches.

    As `evaluate` has them: a compiler that meets sin(0.3) rounds it correctly, the library that it links need not.
    """
    known: dict[Node, float] = {}
    for node in nodes:
        if node.op is CONSTANT:
            assert node.value is not None
            known[node] = node.value
        elif node.args and all([arg in known for arg in node.args]):
            known[node] = float(node.op.scalar(*[known[arg] for arg in node.args]))
    return known

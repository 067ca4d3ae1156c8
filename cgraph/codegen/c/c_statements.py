"""The body in C: a statement for each operation, in one function or, for long graphs, in several."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...core.node import CONSTANT, VARIABLE, Node
from .c_numbers import CNumbers

PART = 2000  # operations in a function: compilers take more than proportionally to its length


def functions(
    name: str,
    nodes: Sequence[Node],
    places: Mapping[Node, str],
    results: Sequence[tuple[str, Node]],
    numbers: CNumbers,
) -> list[str]:
    """Text of the function `name`, after that of the functions it calls.

    places: for each input its place in x.  results: places in y, and their nodes. Raises ValueError for an operation
    that has no text in C, and for a constant beyond the numbers.
    """
    kind, keyword = numbers.type, f"{name.upper()}_RESTRICT"
    known = _known(nodes)
    steps = [node for node in nodes if node not in known and node.op is not VARIABLE]
    text = {node: f"x[{place}]" for node, place in places.items()}
    needed = {*[arg for node in steps for arg in node.args], *[node for _, node in results]}
    text |= {node: numbers.text(value) for node, value in known.items() if node in needed}
    stored: dict[Node, list[str]] = {}
    for place, node in results:
        stored.setdefault(node, []).append(place)

    parts, w_size = _parts(name, nodes, steps, text, stored, numbers)
    helpers = [text.format(name=name) for text in dict.fromkeys([numbers.helper(node.op) for node in steps]) if text]
    computed = set(steps)
    body = [f"y[{place}] = {text[node]};" for place, node in results if node not in computed]
    if len(parts) > 1:
        called = [f"{name}_part_{k}" for k in range(1, len(parts) + 1)]
        body = [f"{numbers.type} w[{max(w_size, 1)}];", *body, *[f"{function}(x, w, y);" for function in called]]
        arrays = f"const {kind} *{keyword} x, {kind} *{keyword} w, {kind} *{keyword} y"
        unused = ["(void)x, (void)w, (void)y;"]  # a part need not touch all three
        helpers += [
            _function(f"static void {function}({arrays})", unused + part)
            for function, part in zip(called, parts, strict=True)
        ]
    else:
        body += parts[0] if parts else []
        if not any([node.op is VARIABLE for node in nodes]):
            body.insert(0, "(void)x;")
    return [*helpers, _function(f"void {name}(const {kind} *{keyword} x, {kind} *{keyword} y)", body)]


def _function(signature: str, body: Sequence[str]) -> str:
    return "\n".join([signature, "{", *[f"    {line}" for line in body], "}", ""])


def _parts(
    name: str,
    nodes: Sequence[Node],
    steps: Sequence[Node],
    text: dict[Node, str],
    stored: Mapping[Node, list[str]],
    numbers: CNumbers,
) -> tuple[list[list[str]], int]:
    """The statements of each part, and the size of w, whose places are used again once nothing needs their values.

    A value that its own part alone needs is a local constant, numbered as in `Graph.listing`.
    """
    number = {node: i for i, node in enumerate([node for node in nodes if node.args], 1)}
    texts = {op: numbers.operation(op) for op in dict.fromkeys([node.op for node in steps])}
    last_use = {arg: i for i, node in enumerate(steps) for arg in node.args}
    parts: list[list[str]] = []
    free: list[int] = []
    read_last: dict[int, list[int]] = {}  # step: the places in w that nothing reads after it
    w_size = 0
    for i, node in enumerate(steps):
        if i % PART == 0:
            parts.append([])
        expression = texts[node.op].format(*[text[arg] for arg in node.args], name=name)
        free += read_last.pop(i, ())
        last = last_use.get(node, i)
        if last // PART == i // PART:
            text[node] = f"v{number[node]}"
            target = f"const {numbers.type} {text[node]}"
        else:
            if not free:
                free.append(w_size)
                w_size += 1
            read_last.setdefault(last, []).append(free[-1])
            text[node] = target = f"w[{free.pop()}]"
        note = f" /* {comment(node.name)} */" if node.name else ""
        parts[-1].append(f"{target} = {expression};{note}")
        parts[-1] += [f"y[{place}] = {text[node]};" for place in stored.get(node, ())]
    return parts, w_size


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


def comment(text: str) -> str:
    """The text, as it may stand between /* and */."""
    printable = "".join([character if character.isprintable() else "?" for character in text])
    return printable.replace("*/", "* /").replace("/*", "/ *")

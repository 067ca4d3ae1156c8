"""The body in C: a statement for each operation, in one function or, for long graphs, in several."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from ...core.node import CONSTANT, VARIABLE, Node
from ...operations.operation import columns

PART = 2000  # operations in a function: compilers take more than proportionally to its length


def functions(
    name: str, nodes: Sequence[Node], places: Mapping[Node, str], results: Sequence[tuple[str, Node]]
) -> list[str]:
    """Text of the function `name`, after that of the functions it calls.

    places: for each input its place in x.  results: places in y, and their nodes.
    """
    known = _known(nodes)
    steps = [node for node in nodes if node not in known and node.op is not VARIABLE]
    text = {node: f"x[{place}]" for node, place in places.items()}
    text |= {node: _number(value) for node, value in known.items()}
    stored: dict[Node, list[str]] = {}
    for place, node in results:
        stored.setdefault(node, []).append(place)

    parts, w_size = _parts(name, nodes, steps, text, stored)
    helpers = [text.format(name=name) for text in dict.fromkeys([columns(node.op).c_helper for node in steps]) if text]
    computed = set(steps)
    body = [f"y[{place}] = {text[node]};" for place, node in results if node not in computed]
    if len(parts) > 1:
        called = [f"{name}_part_{k}" for k in range(1, len(parts) + 1)]
        body = [f"double w[{max(w_size, 1)}];", *body, *[f"{function}(x, w, y);" for function in called]]
        arrays = "const double *restrict x, double *restrict w, double *restrict y"
        unused = ["(void)x, (void)w, (void)y;"]  # a part need not touch all three
        helpers += [
            _function(f"static void {function}({arrays})", unused + part)
            for function, part in zip(called, parts, strict=True)
        ]
    else:
        body += parts[0] if parts else []
        if not any([node.op is VARIABLE for node in nodes]):
            body.insert(0, "(void)x;")
    return [*helpers, _function(f"void {name}(const double *restrict x, double *restrict y)", body)]


def _function(signature: str, body: Sequence[str]) -> str:
    return "\n".join([signature, "{", *[f"    {line}" for line in body], "}", ""])


def _parts(
    name: str, nodes: Sequence[Node], steps: Sequence[Node], text: dict[Node, str], stored: Mapping[Node, list[str]]
) -> tuple[list[list[str]], int]:
    """The statements of each part, and the size of w, whose places are used again once nothing needs their values.

    A value that its own part alone needs is a local constant, numbered as in `Graph.listing`.
    """
    numbers = {node: i for i, node in enumerate([node for node in nodes if node.args], 1)}
    last_use = {arg: i for i, node in enumerate(steps) for arg in node.args}
    parts: list[list[str]] = []
    free: list[int] = []
    read_last: dict[int, list[int]] = {}  # step: the places in w that nothing reads after it
    w_size = 0
    for i, node in enumerate(steps):
        if i % PART == 0:
            parts.append([])
        expression = columns(node.op).c.format(*[text[arg] for arg in node.args], name=name)
        free += read_last.pop(i, ())
        last = last_use.get(node, i)
        if last // PART == i // PART:
            text[node] = f"v{numbers[node]}"
            target = f"const double {text[node]}"
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


def _number(value: float) -> str:
    """The number, exactly; in parentheses if it has a sign."""
    size = abs(value)
    if math.isnan(value):
        text = "(double)NAN"
    elif math.isinf(value):
        text = "(double)INFINITY"
    elif size < 1e6 and size.is_integer():
        text = str(size)
    else:
        text = f"{re.sub('[.]?0*p', 'p', size.hex())} /* {size!r} */"
    return text if math.copysign(1.0, value) > 0 else f"(-{text})"


def comment(text: str) -> str:
    """The text, as it may stand between /* and */."""
    printable = "".join([character if character.isprintable() else "?" for character in text])
    return printable.replace("*/", "* /").replace("/*", "/ *")

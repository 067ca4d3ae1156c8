"""The body in C: the functions of a graph's statements."""

from collections.abc import Mapping, Sequence

from ...core.node import VARIABLE, Node
from ...operations.operation import columns
from ..statements import statements
from .c_numbers import CNumbers


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
    found = statements(
        nodes,
        places,
        results,
        numbers.text,
        lambda op: numbers.operation(op).replace("{name}", name),
        f"const {kind}",
        lambda node: f" /* {comment(node.name)} */" if node.name else "",
    )
    texts = dict.fromkeys([numbers.adapted(columns(op).c_helper) for op in found.ops])
    helpers = [text.format(name=name) for text in texts if text]
    body = found.direct
    if len(found.parts) > 1:
        called = [f"{name}_part_{k}" for k in range(1, len(found.parts) + 1)]
        body = [f"{kind} w[{max(found.size, 1)}];", *body, *[f"{function}(x, w, y);" for function in called]]
        arrays = f"const {kind} *{keyword} x, {kind} *{keyword} w, {kind} *{keyword} y"
        unused = ["(void)x, (void)w, (void)y;"]  # a part need not touch all three
        helpers += [
            _function(f"static void {function}({arrays})", unused + part)
            for function, part in zip(called, found.parts, strict=True)
        ]
    else:
        body += [line for part in found.parts for line in part]
        if not any([node.op is VARIABLE for node in nodes]):
            body.insert(0, "(void)x;")
    return [*helpers, _function(f"void {name}(const {kind} *{keyword} x, {kind} *{keyword} y)", body)]


def _function(signature: str, body: Sequence[str]) -> str:
    return "\n".join([signature, "{", *[f"    {line}" for line in body], "}", ""])


def comment(text: str) -> str:
    """The text, as it may stand between /* and */."""
    printable = "".join([character if character.isprintable() else "?" for character in text])
    return printable.replace("*/", "* /").replace("/*", "/ *")

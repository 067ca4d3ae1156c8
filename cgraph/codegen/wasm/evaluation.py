"""The graph's function in WebAssembly: operations in the order of a stack machine, what is used again in locals."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Mapping
from math import copysign

from ...core.graph import Graph
from ...core.node import CONSTANT, Node
from ...core.row import Row
from . import instructions as ins
from .translate import Body, Signature

X, Y, FIRST = 0, 1, 2  # locals: the addresses of inputs and outputs, and the first of the doubles
Key = Node | float  # of a value that is kept; a constant and its negative are one


def evaluation(graph: Graph, texts: Mapping[Row, ast.expr], signatures: Mapping[str, Signature]) -> bytes:
    """The code of evaluate(x, y).  texts: of the operations, on _0, _1, ..

    Arguments are computed right before their operation, by a stack of what is still to be written; a value with
    several uses is computed before the first of them and kept in a local until the last.
    """
    parts = {op: _parts(op, text, signatures) for op, text in texts.items()}
    places = {node: 8 * k for k, node in enumerate(graph.inputs)}
    uses = Counter([_key(node) for node in graph.outputs.values()])
    for node in graph.nodes:
        uses.update([_key(node.args[part]) for part in parts.get(node.op, ()) if isinstance(part, int)])
    kept: dict[Key, int] = {}  # which local has a value
    free: list[int] = []
    count = 0
    code = bytearray()
    pending: list[bytes | Node | tuple[Key]] = []  # a key alone: what the stack has on top is to be kept
    for k, node in reversed([*enumerate(graph.outputs.values())]):
        pending += [ins.STORE + ins.unsigned(8 * k), node, ins.GET + ins.unsigned(Y)]
    while pending:
        item = pending.pop()
        if isinstance(item, bytes):
            code += item
        elif isinstance(item, tuple):
            if not free:
                free.append(FIRST + count)
                count += 1
            kept[item[0]] = free.pop()
            code += ins.TEE + ins.unsigned(kept[item[0]])
        else:
            key = _key(item)
            uses[key] -= 1
            if key in kept:
                code += ins.GET + ins.unsigned(kept[key]) + _sign(item)
                if not uses[key]:
                    free.append(kept.pop(key))
            elif isinstance(key, float):
                number, more = ins.double(key), uses[key]
                if len(number) * more > 2 * more + 2:
                    pending += [_sign(item), (key,), number]
                else:
                    code += ins.double(_value(item))
            else:
                pending += [(key,)] if uses[key] else []
                pending += (
                    [ins.GET + ins.unsigned(X) + ins.LOAD + ins.unsigned(places[item])]
                    if item in places
                    else [part if isinstance(part, bytes) else item.args[part] for part in reversed(parts[item.op])]
                )
    runs = [ins.unsigned(count) + bytes([ins.F64])] if count else []
    return ins.sized(ins.counted(runs) + bytes(code) + ins.END)


def _parts(op: Row, text: ast.expr, signatures: Mapping[str, Signature]) -> list[bytes | int]:
    body = Body(signatures)
    try:
        body.expression(text, ins.F64)
    except (KeyError, NotImplementedError):
        raise ValueError(
            f"operation {op.name!r} has no WebAssembly: its column `python` may have numbers, arguments, + - * / **, "
            f"comparisons, and, or, `a if c else b` and calls of functions, got {ast.unparse(text)}"
        ) from None
    return body.parts


def _key(node: Node) -> Key:
    return abs(_value(node)) if node.op is CONSTANT else node


def _sign(node: Node) -> bytes:
    return ins.NEGATED if node.op is CONSTANT and copysign(1.0, _value(node)) < 0.0 else b""


def _value(node: Node) -> float:
    assert node.value is not None
    return node.value

"""The text listing of a graph, one node a line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from .node import CONSTANT, VARIABLE, Node


def listing(inputs: Sequence[str], nodes: Sequence[Node], outputs: Mapping[str, Node]) -> str:
    """Text such as `%3 = mul %1 %2  # adjoint; kinetic, link 2`, operations numbered in topological order."""
    lines = [f"inputs {' '.join(inputs)}"]
    text: dict[Node, str] = {}
    for node in nodes:
        if node.op is CONSTANT:
            text[node] = repr(node.value)
        elif node.op is VARIABLE:
            text[node] = str(node.name)
        else:
            text[node] = f"%{len(lines)}"
            line = f"{text[node]} = {node.op.name} {' '.join([text[arg] for arg in node.args])}"
            notes = [", ".join(sorted(labels)) for labels in (node.roles, node.tags) if labels]
            name = f"  ({node.name})" if node.name else ""
            lines.append(line + name + (f"  # {'; '.join(notes)}" if notes else ""))
    lines.extend(f"output {name} = {text[node]}" for name, node in outputs.items())
    return "\n".join(lines) + "\n"

"""Graphs and operations for scripts of pages: values as JavaScript, partials as programs, formulas as trees."""

import json
import math
import re

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Json, formula_tree
from cgraph.extend import OPS, Op


def expression(module: str) -> str:
    """A module of `cg.to_js` as an expression, for a script that is no module: {inputs, outputs, evaluate, steps}."""
    text = re.sub("^export ", "", module, flags=re.MULTILINE)
    return f"(() => {{\n{text}return {{ inputs, outputs, evaluate, steps }};\n}})()"


def operations() -> str:
    """The constants VALUE {operation: function}, ROWS {operation: its row} and FORMULA.

    FORMULA: operation -> [tree, least binding, binding].  An operation without a formula is written as a function.
    """
    functions = ",\n".join([f"  {op.name}: {op.javascript}" for op in OPS.values()])
    rows = {
        op.name: {
            "symbol": op.symbol,
            "arity": op.arity,
            "commutative": op.commutative,
            "selects": op.selects,
            "switches": bool(op.piece or op.jumps) and op.arity < 3,  # a `where` does as its condition does
            "rounding": op.rounding,
            "singular": op.singular is not None,
            "slopes": slopes(op),
        }
        for op in OPS.values()
    }
    table = json.dumps(rows, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    formulas = [[op.name, [formula_tree(op), op.mathml.least, op.mathml.binding]] for op in OPS.values() if op.mathml]
    tree = json.dumps(formulas, separators=(",", ":"), ensure_ascii=False)
    return f"const VALUE = {{\n{functions},\n}};\nconst ROWS = {table};\nconst FORMULA = new Map({tree});\n"


def slopes(op: Op) -> dict[str, Json]:
    """The partials of an operation as a small program, from its row: 0 is the output, 1.. the arguments, then `code`.

    A line of code is a number, or an operation and the numbers of its arguments; `out` names one result an argument.
    """
    y, *args = cg.variables(["y", *[f"x{slot}" for slot in range(op.arity)]])
    partials = [cg.constant(each) if not isinstance(each, Node) else each for each in op.partials(y, *args)]
    graph = Graph([y, *args], {str(i): node for i, node in enumerate(partials)})
    number = {node: i for i, node in enumerate([y, *args])}
    code: list[Json] = []
    for node in graph.nodes:
        if node not in number:
            number[node] = op.arity + 1 + len(code)
            code.append(node.value if node.value is not None else [node.op.name, *[number[arg] for arg in node.args]])
    return {"code": code, "out": [number[node] for node in partials]}


def graph_data(graph: Graph) -> dict[str, Json]:
    """{nodes, inputs, outputs} of a graph.

    nodes, arguments before uses: a constant as its value, an input as null, else [operation, *numbers of its
    arguments]; [[name of an input, its number, -1 where nothing uses it]]; [[name of an output, number of a node]].
    """
    number = {node: i for i, node in enumerate(graph.nodes)}
    return {
        "nodes": [
            _number(node.value) if node.value is not None
            else [node.op.name, *[number[arg] for arg in node.args]] if node.args else None
            for node in graph.nodes
        ],
        "inputs": [[name, number.get(node, -1)] for name, node in zip(graph.input_names, graph.inputs, strict=True)],
        "outputs": [[name, number[node]] for name, node in graph.outputs.items()],
    }  # fmt: skip


def _number(value: float) -> float | str:
    """JSON has no infinity."""
    return value if math.isfinite(value) else str(value).replace("inf", "Infinity")

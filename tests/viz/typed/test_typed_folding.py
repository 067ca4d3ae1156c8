"""Folding in the page is the library's, rule for rule: the same nodes, in the same order, of the same arguments."""

import math
from typing import Any

from hypothesis import example, given, settings, strategies as st

import cgraph as cg
from cgraph.core.node import apply
from cgraph.extend import OPS, Builder, folded, topological
from tests.strategies import examples
from tests.viz.typed.typed_script import run_typed

# Those with rules, and one without; the arithmetic twice, since most rules are its.
ARITHMETIC = ["add", "sub", "mul", "div", "neg"]
RULED = [name for name, op in OPS.items() if op.fold is not None]
NUMBERS = [0.0, -0.0, 1.0, -1.0, 2.0, 0.5, -2.0, 3.0]
LIBRARIES = 1e-14  # relative: two libraries' functions of a constant, some times within one another
LEAVES = st.sampled_from(["x", "y", *NUMBERS])


def steps() -> st.SearchStrategy[list[Any]]:
    """Nodes of which later ones may use earlier ones: [op, numbers of nodes] or a leaf."""
    chosen = st.sampled_from([*ARITHMETIC, *ARITHMETIC, *RULED, "tanh"])
    step = st.tuples(chosen, st.lists(st.integers(1, 6), min_size=3, max_size=3))
    return st.tuples(st.lists(LEAVES, min_size=3, max_size=4), st.lists(step, min_size=1, max_size=9)).map(
        lambda parts: [*parts[0], *map(list, parts[1])]
    )


def listed(nodes: list[cg.Node]) -> list[list[Any]]:
    """Every node with the numbers of its arguments, and its name or its value as a text, for JSON has no infinity."""
    order = topological(nodes)
    number = {node: i for i, node in enumerate(order)}
    return [
        [node.op.name, [number[arg] for arg in node.args], node.name if node.value is None else str(node.value)]
        for node in order
    ]


def in_python(program: list[Any]) -> list[list[Any]]:
    nodes: list[cg.Node] = []
    for each in program:
        if isinstance(each, list):
            op, back = each
            nodes.append(apply(OPS[op], *[nodes[-min(i, len(nodes))] for i in back[: OPS[op].arity]]))
        else:
            nodes.append(cg.variable(each) if isinstance(each, str) else cg.constant(each))
    return listed(folded(nodes[-2:], Builder()))


IN_PAGE = """(programs) => programs.map((program) => {
  const nodes = [], back = (i) => nodes.at(-Math.min(i, nodes.length));
  for (const each of program) {
    if (Array.isArray(each)) nodes.push(TYPED.apply(each[0], ...each[1].slice(0, TYPED.ROWS[each[0]].arity).map(back)));
    else nodes.push(typeof each === "string" ? TYPED.variable(each) : TYPED.constant(each));
  }
  const order = TYPED.topological(TYPED.folded(nodes.slice(-2))), number = new Map(order.map((node, i) => [node, i]));
  const shown = ({ name, value }) => (value === null ? name : `${value}`);
  return order.map((node) => [node.op, node.args.map((arg) => number.get(arg)), shown(node)]);
})"""


RARE = [
    ["x", 1.0, ["div", [1, 2]], 2.0, ["mul", [1, 2]]],  # 2 (1 / x)
    ["x", "y", 0.5, ["mul", [1, 3]], ["mul", [1, 3]], 2.0, ["mul", [1, 2]]],  # 2 ((0.5 x) y)
    ["x", "y", -0.5, ["mul", [1, 3]], ["mul", [3, 1]], 2.0, ["mul", [1, 2]]],  # 2 (y (-0.5 x))
    ["x", 1e-200, ["mul", [1, 2]], ["mul", [2, 1]]],  # the product of the numbers is 0
    ["x", 1e200, ["add", [1, 2]], ["sub", [2, 1]], ["mul", [3, 3]], ["mul", [1, 4]]],  # and infinite
]


@example(programs=RARE)
@given(programs=st.lists(steps(), min_size=12, max_size=12))
@settings(max_examples=examples(60))
def test_folding_is_that_of_the_library(programs):
    for program, found in zip(programs, run_typed(IN_PAGE, programs), strict=True):
        expected = in_python(program)
        assert [[op, args] for op, args, _ in found] == [[op, args] for op, args, _ in expected], program
        for (op, _, mine), (*_, theirs) in zip(found, expected, strict=True):
            assert mine == theirs or (op == "constant" and math.isclose(float(mine), float(theirs), rel_tol=LIBRARIES))

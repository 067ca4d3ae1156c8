"""Functions that WebAssembly has no instruction for: the module's own, with the same bits on every machine.

Their largest errors, over all of float64, are asserted in tests/cgraph/codegen/test_wasm_functions.py.
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterable

from ...core.graph import Graph
from ...operations.operation import Op, columns
from ...util.caches import memo
from .elementary_functions import DIGITS, TEXT
from .instructions import INTRINSICS
from .other_functions import TEXT as OTHERS

HELPERS = {"wave", "product", "quickly", "scaled", "growth", "exponential", "logarithm", "logarithm_by"}
HELPERS |= {"by_series", "by_fraction"}
PRIMITIVES = {*INTRINSICS, "load", "store", "word", "address"}
HOST = "math."  # before the name of a function that the host supplies
MATH = frozenset(
    "abs acos acosh asin asinh atan atan2 atanh cbrt ceil clz32 cos cosh exp expm1 floor fround hypot imul log log10 "
    "log1p log2 max min pow random round sign sin sinh sqrt tan tanh trunc".split()
)  # of JavaScript, ECMAScript 2015


def _table() -> bytes:
    """Digits of 2/pi, the last ones first, which `wave` reads at TABLE."""
    one = 1 << 1300
    pi = 4 * (4 * _arctan_of_inverse(5, one) - _arctan_of_inverse(239, one))
    return ((2 * one << DIGITS) // pi).to_bytes(DIGITS // 8, "little")


def _arctan_of_inverse(n: int, one: int) -> int:
    """arctan(1 / n) times one, to a few units (Machin 1706)."""
    term, total, k = one // n, 0, 0
    while term:
        total += (-1) ** k * (term // (2 * k + 1))
        term, k = term // (n * n), k + 1
    return total


WAVE_TABLE = _table()


@memo(8)
def library(at: int) -> dict[str, ast.FunctionDef]:
    """{name: function}, for a table at this place in memory."""
    found = ast.parse((TEXT + OTHERS).replace("TABLE", str(at))).body
    return {each.name: each for each in found if isinstance(each, ast.FunctionDef)}


def text_of(op: Op, imported: Collection[str]) -> ast.expr:
    """The operation on _0, _1, ..: its row's text in Python, with the host's functions marked as such."""
    read = ast.parse(op.python.format(*[f"_{slot}" for slot in range(op.arity)]), mode="eval")
    text: ast.expr = _PowersCalled().visit(read).body
    own = {*library(0), "abs", "ceil", "floor", "round", "sqrt", "float"} - HELPERS - {*imported}
    for node in ast.walk(text):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id not in own:
            node.func.id = HOST + node.func.id
    return text


class _PowersCalled(ast.NodeTransformer):
    """a ** b as pow(a, b)."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.expr:
        self.generic_visit(node)
        if isinstance(node.op, ast.Pow):
            return ast.Call(ast.Name("pow", ast.Load()), [node.left, node.right], [])
        return node


def page_functions(*graphs: Graph) -> str:
    """JavaScript of what modules of the graphs import as `math` in a page: Math, and what rows have for it.

    Raises ValueError for an operation that calls a function which neither a module nor a page has.
    """
    own = {}
    for op in dict.fromkeys([columns(node.op) for graph in graphs for node in graph.nodes if node.args]):
        for name in called([text_of(op, ())], 0):
            name = name.removeprefix(HOST) if name.startswith(HOST) else ""
            if name == op.name and op.own_javascript:
                own[name] = op.javascript
            elif name and name not in MATH:
                raise ValueError(
                    f"operation {op.name!r} calls {name}, which no page has: its row needs the column `javascript`, a "
                    f"function, or a `python` of functions that are known, such as sin, sqrt and pow"
                )
    texts = "".join([f", {name}: {text}" for name, text in own.items()])
    return f"{{ __proto__: Math{texts} }}" if own else "Math"


def called(texts: Iterable[ast.AST], at: int) -> dict[str, int]:
    """{name: number of arguments} of the functions that the texts call, directly or not."""
    found: dict[str, int] = {}
    waiting = [*texts]
    while waiting:
        for node in ast.walk(waiting.pop()):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id not in PRIMITIVES:
                if node.func.id in library(at) and node.func.id not in found:
                    waiting.append(library(at)[node.func.id])
                found[node.func.id] = len(node.args)
    return found

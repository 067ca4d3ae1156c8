"""JavaScript: an ES module of a graph's function and of steps of its motion, in straight lines."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence

from ..core.graph import Graph
from ..core.row import Row
from ..operations.operation import Op, columns
from ..util.require import require_graph
from ..util.version import __version__
from ..util.words import counted
from ..writing.structure_hash import structure_hash
from .statements import Tableau, checked_methods, statements, weighted_sum

MATH = frozenset(  # functions of real numbers that JavaScript has (ECMAScript 2015), by the names of the C library
    """abs acos acosh asin asinh atan atan2 atanh cbrt ceil cos cosh exp expm1 floor hypot log log10 log1p log2 sin
    sinh sqrt tan tanh trunc""".split()
)
_FORMULA = re.compile(r"\((\w+(?:, \w+)*)\) => ((?:(?!=>)[^{}\[\]\"'`])*)")  # a function of one expression
_MODULE = """\
// {counts}, written by cgraph {version}, structure hash {hash}.
// cgraph claims no rights in this text.

export const inputs = {inputs};
export const outputs = {outputs};
{helpers}

/** The outputs, in the order of their names, at numbers of the inputs x. */
export function evaluate(x, y = new Float64Array({n_out})) {{
{body}
  return y;
}}

/** {{method: n steps of size h from the inputs in x, a Float64Array: its state and time are then those at the end}}. */
export const steps = {{
{steps}}};
"""
_STEPS = """\
  {method}(x, h, n) {{{start}
    at.set(x);
    for (let step = 1; step <= n; step++) {{
{lines}
    }}
    return x;
  }},
"""


def to_js(graph: Graph, methods: Mapping[str, Tableau] | None = None, *, time: str = "t") -> str:
    """An ES module of plain JavaScript that computes the graph, and steps of integration.

    It exports the names `inputs` and `outputs`, the function evaluate(x), from numbers of the inputs in their order to
    a Float64Array of the outputs, and `steps`, of each method a function such as steps.rk4(x, h, n).

    Arithmetic is that of `evaluate`, in the same order: where no function of the C library intervenes, to the last
    bit. sin, exp, pow and the like are those of the browser, which differ from it now and then in the last bits.

    Parameters
    ----------
    graph : Graph
        What is computed. With methods, a state equation such as `dynamics.state_equation(model)`: its first inputs are
        the state, and output k is the rate of input k.
    methods : mapping of str to Tableau, optional
        {name: explicit Runge-Kutta method}, such as `dynamics.integrators.TABLEAUS`.
    time : str
        The input that is the time, if there is one of this name, which steps move.

    Returns
    -------
    str
        The text of a file such as arm.mjs.

    Raises
    ------
    GraphError
        With methods, for a graph that has more outputs than inputs.
    TypeError
        For what is no Graph, methods that are no mapping to tableaus, or a time that is no name.
    ValueError
        For an operation without the column `javascript`, where JavaScript's Math has no such function.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> text = cg.to_js(cg.Graph([x], {"y": cg.sin(x) + 1.0}))
    >>> [line for line in text.splitlines() if "v1" in line]
    ['  const v1 = Math.sin(x[0]);', '  const v2 = v1 + 1.0;']
    """
    require_graph("to_js", graph)
    chosen = checked_methods(methods, graph, time)
    n_in, n_out = len(graph.inputs), len(graph.outputs)
    places, results = ([str(k) for k in range(count)] for count in (n_in, n_out))
    found = statements(graph, places, results, _number, _operation, "const")
    rows = [columns(op) for op in found.ops]
    helpers = [f"const {_function(op)} = {op.javascript};" for op in rows if op.own_javascript and not _formula(op)]
    body = [*found.direct, *[line for part in found.parts for line in part]]
    if len(found.parts) > 1:  # engines optimize no function that is too long
        helpers.append(f"const w = new Float64Array({found.size});")
        helpers += [f"function part{k}(x, y) {{\n{_lines(part)}\n}}" for k, part in enumerate(found.parts)]
        body = [*found.direct, *[f"part{k}(x, y);" for k in range(len(found.parts))]]
    if chosen:
        helpers.append(f"const at = new Float64Array({n_in});")
        stages = range(max([len(each.b) for each in chosen.values()]))
        helpers += [f"const slope{k} = new Float64Array({n_out});" for k in stages]
    clock = graph.input_names.index(time) if time in graph.input_names else None
    return _MODULE.format(
        counts=f"{counted(n_out, 'output')} of {counted(n_in, 'input')}",
        version=__version__,
        hash=structure_hash(graph),
        inputs=_names(graph.input_names),
        outputs=_names([*graph.outputs]),
        n_out=n_out,
        helpers="".join([f"{line}\n" for line in helpers]),
        body=_lines(body),
        steps="".join([_steps(name, each, n_out, clock) for name, each in chosen.items()]),
    )


def _names(names: Sequence[str]) -> str:
    """A list of texts; "<" could end the script of a page that has it."""
    return json.dumps(names).replace("<", "\\u003c")


def _number(value: float) -> str:
    text = repr(value).replace("inf", "Infinity").replace("nan", "NaN")
    return f"({text})" if text.startswith("-") else text


def _operation(row: Row) -> str:
    """JavaScript expression of the operation, with {0}, {1} for arguments. Raises ValueError where there is none."""
    op = columns(row)
    if formula := _formula(op):
        return formula
    if not op.own_javascript and op.name not in MATH:
        raise ValueError(
            f"operation {op.name!r} has no text in JavaScript, whose Math has no function {op.name}: its row needs the "
            f"column `javascript`, a function such as (x) => x * x"
        )
    return f"{_function(op)}({', '.join([f'{{{slot}}}' for slot in range(op.arity)])})"


def _function(op: Op) -> str:
    """What its function is called; names of our own may be words of JavaScript."""
    return f"of_{op.name}" if op.own_javascript else f"Math.{op.name}"


def _formula(op: Op) -> str:
    """The expression of a function that is one, with {0}, {1} for arguments: no engine inlines thousands of calls."""
    found = _FORMULA.fullmatch(op.own_javascript)
    if found is None:
        return ""
    slots = {name: f"{{{slot}}}" for slot, name in enumerate(found[1].split(", "))}
    return re.sub(r"(?<![\w.$])[^\W\d]\w*(?![\w$])", lambda word: slots.get(word[0], word[0]), found[2])


def _steps(name: str, method: Tableau, states: int, clock: int | None) -> str:
    """The function of (x, h, n), a property of `steps`."""

    def moved(array: str, weights: Sequence[float]) -> str:
        change = weighted_sum(weights, repr, lambda k: f"slope{k}[i]")
        return f"for (let i = 0; i < {states}; i++) {array}[i] = x[i] + h * ({change});"

    lines = ["evaluate(x, slope0);"]
    for k in range(1, len(method.b)):
        lines.append(moved("at", method.a[k]))
        lines += [f"at[{clock}] = x[{clock}] + {float(method.c[k])!r} * h;"] if clock is not None else []
        lines.append(f"evaluate(at, slope{k});")
    lines.append(moved("x", method.b))
    lines += [f"x[{clock}] = start + step * h;"] if clock is not None else []
    start = f"\n    const start = x[{clock}];" if clock is not None else ""
    return _STEPS.format(method=json.dumps(name), start=start, lines=_lines(lines, "      "))


def _lines(lines: Sequence[str], space: str = "  ") -> str:
    return "\n".join([f"{space}{line}" for line in lines])

"""The equations of a model as graphs in the order in which a textbook writes them, and as text or LaTeX."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import cgraph as cg
from cgraph import Graph
from cgraph.extend import Formulas, Notation, Op, columns
from dynamics.equations.equations_of_motion import momentum
from dynamics.equations.formulations.formulations import inverse_dynamics
from dynamics.equations.momentum.hamiltonian import hamilton_equations
from dynamics.equations.state_equation import state_equation
from dynamics.scenes import Scene
from dynamics.systems.display_names import display_names

from ..pages.mathml import few

SUM, NEGATION, FUNCTION, LEAF = 1, 2, 3, 4  # how strongly a text binds, as in the rows of operations
DIGITS = 12  # of numbers, in text


def equation_graphs(scene: Scene, *, formulation: str = "chain_rule", momenta: bool = False) -> dict[str, Graph]:
    """The graphs of a scene's equations, {title: graph}: Lagrangian, momenta, and the torque or Hamilton's equations.

    A system of first order has its state equation alone. Of a mechanism the Lagrangian is that of the whole tree.
    Raises for momenta of what has none.
    """
    if scene.ode is not None:  # which has no momenta, as `hamilton_equations` says
        return (
            {"Hamilton's equations": hamilton_equations(scene)}
            if momenta
            else {"State equation": state_equation(scene)}
        )
    system = scene.system
    graphs = {
        "Lagrangian": cg.simplify(system.graph({"L": system.lagrangian}, system.q, system.qd)),
        "Momenta, p = dL/dqd": momentum(scene),
    }
    if momenta:
        return graphs | {"Hamilton's equations": hamilton_equations(scene)}
    title = f"Torque, dp/dt - dL/dq, {formulation.replace('_', ' ')}"
    return graphs | {title: inverse_dynamics(scene, formulation)}


def equations_text(scene: Scene, graphs: dict[str, Graph], lines: int) -> str:
    """The equations as lines of text, each block below its title; the last line of a block says what is left out."""
    names = display_names(scene)
    return "\n\n".join([f"{title}\n{_block(graph, names, lines)}" for title, graph in graphs.items()])


def equations_latex(scene: Scene, graphs: dict[str, Graph], lines: int) -> str:
    """The equations as LaTeX, a block of aligned lines below each title."""
    names = display_names(scene)
    return "\n\n".join([f"% {title}\n{graph.latex(names=names, lines=lines)}" for title, graph in graphs.items()])


def _block(graph: Graph, names: dict[str, str], lines: int) -> str:
    found = Formulas(graph.nodes, graph.outputs, PLAIN, names).lines(list(graph.outputs.values()), lines)
    rows = [f"  {left} = {right}" for left, right in found.equations]
    if found.left_out:
        count, total = len(found.left_out), len(found.left_out) + len(rows)
        rows.append(f"  ({count} of {total} lines are left out; see --lines: those of {few(found.left_out)})")
    return "\n".join(rows)


def _names(names: Iterable[str]) -> dict[str, str]:
    return {name: name for name in names}


def _number(value: float) -> tuple[str, int]:
    return f"{value:.{DIGITS}g}", NEGATION if str(value).startswith("-") else LEAF


def _operation(op: Op, args: Sequence[tuple[str, int]]) -> tuple[str, int]:
    """`a * b`, `-a`, or `name(a, b)`; arguments that bind less than their places ask for in parentheses."""
    row = columns(op)
    if op.name == "pow":
        return "^".join([_within(arg, LEAF) for arg in args]), FUNCTION
    if row.infix is not None:
        symbol, strength = row.infix
        left, right = args
        return f"{_within(left, strength)} {symbol} {_within(right, strength + 1)}", strength
    if row.signs == (-1,):
        return f"-{_within(args[0], NEGATION)}", NEGATION
    return f"{op.name}({', '.join([text for text, _ in args])})", LEAF


def _within(arg: tuple[str, int], least: int) -> str:
    text, binds = arg
    return text if binds >= least and not (text.startswith("-") and least > SUM) else f"({text})"


PLAIN = Notation(_names, _number, _operation, "v{}".format)

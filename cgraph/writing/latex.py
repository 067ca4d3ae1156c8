"""Formulas of nodes and graphs as LaTeX."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..core.node import Node
from ..core.traversal import topological
from .formulas import LINES, Formulas, Lines, Notation
from .latex_texts import literal, name_texts, number_text, operation_text

LATEX = Notation(name_texts, number_text, operation_text, "v_{{{}}}".format)


def latex(node: Node, *, names: Mapping[str, str] | None = None, lines: int = LINES) -> str:
    r"""The formula of a node as LaTeX.

    Parameters
    ----------
    node : Node
        The node.
    names : mapping of str to str, optional
        {name of a variable or node: what a person calls it}.
    lines : int
        Lines of an aligned block, at most; a last one says how many are left out.

    Returns
    -------
    str
        The formula; an aligned block of equations where parts of it have names or are needed more than once.

    Raises
    ------
    TypeError
        For what is no node.
    ValueError
        For fewer than one line.

    Examples
    --------
    >>> import cgraph as cg
    >>> m, v = cg.variables("m v")
    >>> print(cg.latex(0.5 * m * v**2))
    0.5 \, m \, {v}^{2}
    """
    if not isinstance(node, Node):
        raise TypeError(
            f"latex needs a node, got {type(node).__name__}: {node!r:.60}"
            f"{'; of a graph, graph.latex()' if hasattr(node, 'latex') else ''}"
        )
    found = Formulas(topological([node]), {}, LATEX, names).lines([node], lines)
    return found.equations[0][1] if len(found.equations) == 1 and not found.left_out else _block(found)


def graph_latex(nodes: Sequence[Node], outputs: Mapping[str, Node], names: Mapping[str, str] | None, lines: int) -> str:
    """The equations of a graph's outputs as an aligned block."""
    return _block(Formulas(nodes, outputs, LATEX, names).lines(list(outputs.values()), lines))


def _block(lines: Lines) -> str:
    rows = [f"{left} &= {right}" if left else f"& {right}" for left, right in lines.equations]
    if lines.left_out:
        few = ", ".join(lines.left_out[:3]) + (r", \dots" if len(lines.left_out) > 3 else "")
        total = len(lines.left_out) + len(lines.equations)
        rows.append(f"& {literal(f'left out: {len(lines.left_out)} of {total} lines, of ')}{few}")
    return "\\begin{aligned}\n" + " \\\\\n".join(rows) + "\n\\end{aligned}"

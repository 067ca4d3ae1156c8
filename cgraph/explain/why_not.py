"""Independence of an output from an input: how far the input reaches, and what the output is made from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ..core.checks import GraphError
from ..core.graph import Graph
from ..core.html_text import html_lines
from ..core.node import Node
from ..util.json_type import Json
from ..util.require import require_graph
from ..util.words import counted
from .names import Name, Names, joined
from .paths import ancestors, descendants


@dataclass(frozen=True, eq=False)
class WhyNot:
    """Independence of an output from an input; made by `why_not`. `str` of it is the explanation.

    Attributes
    ----------
    graph : Graph
        Where they are.
    output, input : str
        Their names.
    reached : frozenset of Node
        The descendants of the input.
    made_from : frozenset of Node
        The ancestors of the output; no node is in both sets.
    meetings : tuple of Node
        The first descendants of the input that also use an ancestor of the output: there the two are nearest.
    outputs : tuple of str
        Names of the outputs that depend on the input.
    inputs : tuple of str
        Names of the inputs that the output depends on.
    names : mapping of str to str
        {name in the graph: what a person calls it}.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> cg.why_not(cg.Graph([x, y], {"f": cg.sin(x), "g": x * y}), "f", "y").outputs
    ('g',)
    """

    graph: Graph
    output: str
    input: str
    reached: frozenset[Node]
    made_from: frozenset[Node]
    meetings: tuple[Node, ...]
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    names: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        names = Names(self.graph, self.names)
        number = len(self.reached) - 1
        lines = [f"{self.output} does not depend on {self.input}."]
        if number:
            lines.append(
                f"{self.input} reaches {counted(number, 'other node')}, and of the outputs {joined(self.outputs)}."
            )
        elif self.outputs:
            lines.append(f"{self.input} is the output {joined(self.outputs)}; no operation uses it.")
        else:
            lines.append(f"Nothing uses {self.input}.")
        lines.append(f"{self.output} is made from {joined(self.inputs, 12) or 'constants'}.")
        if self.meetings:
            shown = "; ".join([names.line(node) for node in self.meetings[:3]])
            lines.append(f"The two meet where {self.output} does not look: {shown}.")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        return html_lines(str(self))

    def to_dict(self) -> dict[str, Json]:
        """Dictionary for JSON; nodes are numbered as in `graph.nodes`."""
        nodes = self.graph.nodes
        return {
            "output": self.output,
            "input": self.input,
            "reached_outputs": list(self.outputs),
            "made_from_inputs": list(self.inputs),
            "reached": [i for i, node in enumerate(nodes) if node in self.reached],
            "made_from": [i for i, node in enumerate(nodes) if node in self.made_from],
            "meetings": [i for i, node in enumerate(nodes) if node in set(self.meetings)],
        }


def why_not(
    graph: Graph,
    output: Name,
    input: Name,  # noqa: A002 (its name)
    *,
    names: Mapping[str, str] | None = None,
) -> WhyNot:
    """Explain why `output` does not depend on `input`: the input's reach, and what the output is made from.

    Parameters
    ----------
    graph : Graph
        Where they are.
    output, input : str or Node
        Names of an output and an input, or of nodes named by `cg.with_name`, or nodes.
    names : mapping of str to str, optional
        {name in the graph: what a person calls it}, as `why` takes them.

    Returns
    -------
    WhyNot
        `print` it for the explanation.

    Raises
    ------
    GraphError
        If the output does depend on the input, or the graph has no node or several nodes of a name.

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> print(cg.why_not(cg.Graph([x, y], {"f": cg.sin(x), "g": x * y}), "f", "y"))
    f does not depend on y.
    y reaches 1 other node, and of the outputs g.
    f is made from x.
    The two meet where f does not look: %2 = x * y.
    """
    require_graph("why_not", graph)
    known = Names(graph, names)
    source, sink = known.one(input, "input"), known.output(output, "output")
    reached, made_from = descendants(graph.nodes, [source]), ancestors([sink])
    to, origin = known.called(output), known.called(input)
    if sink in reached:
        raise GraphError(f"{to} depends on {origin}; cg.why lists the paths")
    return WhyNot(
        graph,
        to,
        origin,
        reached=frozenset(reached),
        made_from=frozenset(made_from),
        meetings=_first_meetings(graph, reached, made_from),
        outputs=tuple([known.shown(name) for name, node in graph.outputs.items() if node in reached]),
        inputs=tuple([known.text(node) for node in graph.inputs if node in made_from]),
        names=names or {},
    )


def _first_meetings(graph: Graph, reached: set[Node], made_from: set[Node]) -> tuple[Node, ...]:
    """Nodes of `reached` with an argument, not a constant, in `made_from`; none of them a descendant of another."""
    met: set[Node] = set()
    first = []
    for node in graph.nodes:
        if node in reached:
            if any([arg in met for arg in node.args]):
                met.add(node)
            elif any([arg in made_from and arg.value is None for arg in node.args]):
                met.add(node)
                first.append(node)
    return tuple(first)

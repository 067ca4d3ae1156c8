"""Reverse mode: cotangents pulled from the outputs to the inputs."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from .builder import Builder
from .forward import ReachedNodes
from .label import ADJOINT, UNLABELLED, Label
from .node import Node, as_node
from .scope import building
from .traversal import descendants, topological


def cotangents(
    seeds: Mapping[Node, Node],
    wrt: Sequence[Node],
    build: Builder | None = None,
    *,
    fixed: Collection[Node] = (),
    through: Mapping[Node, Node] | None = None,
    zero_wins: bool = False,
) -> list[Node]:
    """Cotangents of the nodes x in `wrt`, x_bar = sum over seeds y of y_bar dy/dx; a constant 0 if no y depends on x.

    seeds: {y: y_bar}.  wrt: leaves or inner nodes; one may depend on another: the cotangent of an inner node counts
    every use of it, and goes on to its arguments.  build: what makes the nodes.
    fixed: inner nodes that count as independent: nothing goes on to their arguments.
    through: {inner node: factor}; what the node's cotangent passes on to the arguments is multiplied by the factor. In
    a result, the terms with the factor are those that came through this node, and at the factor 0 they are left out.
    zero_wins: a seed that is zero counts for nothing, also where a slope is infinite or NaN; else the result is NaN.

    >>> import cgraph as cg
    >>> from cgraph.extend import cotangents
    >>> x, y = cg.variables("x y")
    >>> cotangents({x * y: cg.constant(1.0)}, [x, y])
    [<node variable y>, <node variable x>]
    """
    order = topological(seeds)
    active = descendants(order, wrt)
    bars = dict(seeds)
    reached = ReachedNodes(seeds if zero_wins else dict.fromkeys(seeds))
    # A constant carries no tags. What is made of a constant cotangent takes those of the uses that it came from.
    uses: dict[Node, Label] = {}  # {node with a constant cotangent: label with the tags of its uses}
    with building(build or Builder()) as labelled:
        for node in reversed(order):
            bar = bars.get(node)
            if bar is None or node not in active or not node.args or node in fixed:
                continue
            labelled(_label(node, uses))
            if through and node in through:
                bar = bar * through[node]
            terms: dict[Node, Node] = {}  # of one use, summed by argument first: x * x gives 2 * (bar * x)
            divisor, partials = reached.quotient(node, [node], once=sum([arg in active for arg in node.args]) > 1)
            if divisor is not None:
                bar = bar / divisor
            for arg, partial in zip(node.args, partials, strict=True):
                if arg in active:
                    term = reached.product(node.op, node, bar, partial, bounded=divisor is not None)
                    terms[arg] = terms[arg] + term if arg in terms else term
                    if term.value != 0.0:
                        reached.pass_on(node.op, node, arg, partial)
            for arg, term in terms.items():
                if term.value == 0.0:
                    continue
                if term.value is not None:
                    uses[arg] = uses.get(arg, UNLABELLED).with_tags_of(node.label)
                if arg in bars:  # the sum over all uses of arg has the label of arg, not of this use
                    labelled(_label(arg, uses))
                    bars[arg] = bars[arg] + term
                else:
                    bars[arg] = term
    zero = as_node(0.0)
    return [bars.get(node, zero) for node in wrt]


def _label(node: Node, uses: Mapping[Node, Label]) -> Label:
    label = node.label.derived(ADJOINT)
    return label.with_tags_of(uses[node]) if node in uses else label

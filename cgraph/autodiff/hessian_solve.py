"""Solving with a Hessian without forming it: edge pushing with early elimination."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from numbers import Real
from typing import Literal, get_args

from ..core.builder import Builder
from ..core.graph import Graph
from ..core.label import ADJOINT, TANGENT
from ..core.node import Node, Scalar, as_node
from ..core.reverse import cotangents
from ..core.scope import building
from ..core.traversal import descendants, topological
from ..util.explain_failure import explain_failure
from ..util.require import require_choice, require_flag, require_graph, require_sequence
from .balanced_elimination import BalancedElimination, written_rows
from .schur_elimination import EdgePushing, EliminationStep, elimination_steps, nodes_of

Order = Literal["recursive", "balanced"]


def hessian_solve(
    graph: Graph,
    wrt: str | Node | Sequence[str | Node],
    rhs: Sequence[Scalar],
    *,
    check: bool = False,
    order: Order = "recursive",
) -> list[Node]:
    """Nodes x with (d2f/dw2) x = rhs, for the one output f of `graph` and the inputs w of `wrt`.

    The Hessian is not formed: for f summed along a chain or a tree, such as the energy of its bodies, the result has a
    number of nodes proportional to that of f. Variables whose pivots are the constant zero are eliminated last, two at
    a time if need be, so that f = v w is solved too; there is no other pivoting, so the Hessian should be definite.

    Parameters
    ----------
    graph : Graph
        A function with one output f.
    wrt : str, Node or sequence of these
        The n inputs w.
    rhs : sequence of Node or float, n entries
        The right-hand side, an entry for each of `wrt`.
    check : bool
        Append one more node: 0 where the Hessian is positive definite, else 1 + the index of the first variable to be
        eliminated with a pivot that is zero, negative or NaN; x means nothing there. It costs two operations and a
        constant for each variable. A pivot that should be zero and by rounding is a little more counts as positive;
        then x is huge.
    order : {"recursive", "balanced"}
        "recursive": from the output down, for a chain or a tree from its tips to its base, one after another: the
        fewest nodes, and a depth in proportion to the length of a chain. "balanced": by nested dissection, halves of a
        chain at the same time, seen from their two ends only: a depth in proportion to the logarithm, but for sums
        along the chain, for about twice the nodes, three times where a link has few; where it is not shallower, the
        recursive order stays. Pieces are eliminated with the inertia that they have by themselves: a
        body of next to none beside its neighbors costs digits, and with `check` their pivots have to be positive too.

    Returns
    -------
    list of Node
        x, n nodes; with `check`, n + 1.

    Raises
    ------
    GraphError
        If the graph has several outputs, or not all of the inputs `wrt`.
    ValueError
        If `rhs` has not n entries, or `order` is neither.
    SingularError
        With the index of the variable, if a row has only zeros left, or with `check` a pivot is a constant that is not
        positive.

    Examples
    --------
    >>> import cgraph as cg
    >>> v, w = cg.variables("v w")
    >>> energy = cg.Graph([v, w], {"T": 2.0 * v * v + 3.0 * w * w})
    >>> cg.hessian_solve(energy, "v w".split(), [8.0, 3.0])
    [<node 2.0>, <node 0.5>]
    """
    require_graph("hessian_solve", graph)
    chosen = graph.select_inputs(wrt)
    entries = [as_node(value) for value in require_sequence("rhs", rhs, "numbers and nodes", (Node, Real))]
    require_choice("order", order, get_args(Order))
    return solve_nodes(graph.only_output(), chosen, entries, check=require_flag("check", check), order=order)


@explain_failure
def solve_nodes(
    output: Node,
    wrt: Sequence[Node],
    rhs: Sequence[Node],
    build: Builder | None = None,
    *,
    at: Mapping[Node, Node] | None = None,
    multipliers: Collection[Node] = (),
    check: bool = False,
    order: Order = "recursive",
) -> list[Node]:
    """Nodes x with (d2f/dw2) x = rhs: `cg.hessian_solve` on nodes.

    The tangents t of all nodes that depend on the variables w make f's second differential stationary: W t = b, with W
    the symmetric second-order adjoint and b = rhs at w. Walking the nodes from the output down, an operation passes its
    row of W and its entry of b to its arguments through its partials p (t = sum p t_arg), and adds its adjoint times
    its second partials; a variable, once all nodes that use it are done, is eliminated as by Gauss. One sweep back up
    then gives the tangents, and those of w are x. For a tree of bodies this is the articulated-body algorithm.

    build: what the nodes are built by; by default a new one.  order, check: as of `cg.hessian_solve`.
    at: {z: b_z}, right-hand sides at nodes that depend on w. They stand for (dz/dw)^T b_z more at w, but reach w by the
    elimination itself: fewer nodes, and no large sums at w that the elimination has to undo.
    multipliers: those s of w that f is linear in, f = g(u) + s . h(u), as of constraints h. They have no pivots of
    their own, and each is eliminated after the last of the variables that its df/ds depends on; `check` then is 0 if
    the Hessian is positive definite in u and each of them leaves with a negative pivot, else 1 + the index in w of the
    first that is not so. With them there is no balanced order (ValueError).

    >>> import cgraph as cg
    >>> from cgraph.extend import solve_nodes
    >>> v, tau = cg.variables("v tau")
    >>> (x,) = solve_nodes(0.5 * v * v, [v], [tau])
    >>> x is tau
    True
    """
    build = build or Builder()
    equations = _solved(output, wrt, rhs, build, at or {}, multipliers, order)
    x = [equations.dots[node] for node in wrt]
    if check:
        with building(build) as set_label:
            set_label(output.label.derived(ADJOINT))
            x.append(equations.info(multipliers))
    return x


@explain_failure
def solve_tangents(
    output: Node,
    wrt: Sequence[Node],
    rhs: Sequence[Node],
    build: Builder | None = None,
    *,
    order: Order = "recursive",
) -> dict[Node, Node]:
    """Tangents {z: (dz/dw) x} of the nodes z that f is made from, for the x of `solve_nodes`, which has them anyway.

    At w it is x itself; a product within a rotation may be left out. Arguments and errors are those of `solve_nodes`.
    """
    return _solved(output, wrt, rhs, build or Builder(), {}, (), order).dots


def _solved(
    output: Node,
    wrt: Sequence[Node],
    rhs: Sequence[Node],
    build: Builder,
    at: Mapping[Node, Node],
    multipliers: Collection[Node],
    order: Order,
) -> EdgePushing:
    """W t = b, solved: all tangents."""
    if len(rhs) != len(wrt):
        raise ValueError(f"rhs needs one entry for each of the {len(wrt)} variables, got {len(rhs)}")
    entries, reached = dict(zip(wrt, rhs, strict=True)), topological([output, *at])
    used, depends = set(reached), descendants(reached, wrt)
    nodes = [node for node in wrt if node not in used] + [node for node in reached if node in depends]
    with building(build):
        equations = EdgePushing(build, output, entries, at, nodes)
        passed = equations.arguments(_rows(output, multipliers, wrt))
        plan = elimination_steps(passed, equations.rotations)
    if order == "balanced":
        if multipliers:
            raise ValueError('order "balanced" needs a function without multipliers')
        fewest = elimination_steps(passed, equations.rotations, fewest=True)
        with building(Builder()):
            rows = written_rows(EdgePushing(build, output, entries, at, nodes), fewest)
            alone = EdgePushing(build, output, entries, at, nodes)
        with building(build):
            pieces = BalancedElimination(build, output, entries, at, nodes, fewest, rows)
        if pieces.copies:  # there is more than one piece
            _run(pieces, fewest, build)
            _run(alone, plan, Builder())
            if pieces.depth_of(pieces, wrt) < pieces.depth_of(alone, wrt):
                return pieces
    _run(equations, plan, build)
    return equations


def _run(equations: EdgePushing, plan: Sequence[EliminationStep], build: Builder) -> None:
    """Take the steps out, and give their nodes the tangents."""
    with building(build) as set_label:
        for step in plan:
            set_label(nodes_of(step)[0].label.derived(ADJOINT))
            equations.reduce(step)
        equations.finish()
        for step in reversed(plan):
            set_label(nodes_of(step)[0].label.derived(TANGENT))
            equations.substitute(step)


def _rows(output: Node, multipliers: Collection[Node], wrt: Sequence[Node]) -> dict[Node, list[Node]]:
    """{s: the variables that df/ds depends on}."""
    if not multipliers:
        return {}
    slopes = cotangents({output: as_node(1.0)}, list(multipliers))
    rows = {s: set(topological([slope])) for s, slope in zip(multipliers, slopes, strict=True)}
    if wrong := [s for s, reached in rows.items() if not reached.isdisjoint(multipliers)]:
        raise ValueError(f"the output must be linear in the multipliers, got {wrong[0]!r} with a slope that has one")
    return {s: [w for w in wrt if w in reached] for s, reached in rows.items()}

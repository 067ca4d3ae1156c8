"""Classes of nodes of equations of motion: of a formulation, needed or not; of both forms, what they serve, in rows."""

import re
from collections.abc import Callable, Iterable

from cgraph import Graph, Node
from cgraph._shared import descendants
from cgraph.extend import ADJOINT, PRIMAL, TANGENT, topological
from dynamics.equations.formulations.lagrange_terms import EULER, newton_euler
from dynamics.equations.formulations.verdict import Verdict

LEAVES, DAMPING = "inputs and numbers", "damping"
ENERGIES, NEWTON_EULER = {"kinetic", "potential"}, newton_euler.__name__
_OF_ROLES = {  # by whether it is of a reverse sweep, and of a forward one
    (True, True): "rate of a slope, of d/dt dL/dqd, which dL/dq cancels in part",
    (True, False): "slope, of momenta or dL/dq, or a force carried to joints",
    (False, True): "rate of a position or a velocity",
    (False, False): "position, velocity, acceleration, force on a body",
}
POSITIONS = "of positions alone: kinematics, inertia, and its elimination"
BIAS, ACCELERATIONS = "bias: of velocities, without torques", "accelerations, with the torques"
VELOCITIES, RATES = "velocities of the momenta", "rates of the momenta"
# Rows of the picture by classes of both forms. Of what is solved for, the way back out is a row above the way in.
INWARD, OUTWARD, TOP = "eliminated", "back out", "rates"
ROWS = {
    "of positions": (LEAVES, POSITIONS), "bias": (BIAS, DAMPING), INWARD: (ACCELERATIONS, VELOCITIES), OUTWARD: (),
    TOP: (RATES,),
}  # fmt: skip


def formulation_classes(verdicts: Iterable[Verdict]) -> Callable[[Graph], Callable[[Node], str]]:
    """The class of each node of the verdicts' graphs, as `cg.compare` asks for it.

    "spurious": it serves only derivatives through q = qd dt + q_old.
    "takes in a spurious term": a sum that has a part of it, or what is made of it.
    "Euler relation": q = qd dt + q_old and qd = qdd dt + qd_old, and their rates.  "needed": all else.
    Where one of them is by velocities and all are right, what derivatives the other carries, see `derivative_class`.
    """
    known = {each.graph: each for each in verdicts}
    by_velocities = NEWTON_EULER in [each.formulation for each in known.values()]
    if by_velocities and not any([each.differs for each in known.values()]):
        return lambda graph: derivative_class

    def classes(graph: Graph) -> Callable[[Node], str]:
        wrong = known[graph]
        adjoint = descendants(graph.nodes, [node for node in graph.nodes if ADJOINT in node.roles])
        spoilt = descendants(graph.nodes, [edge.target for edge in wrong.edges])

        def name(node: Node) -> str:
            if node in wrong.nodes:
                return "spurious"
            if node in spoilt:
                return "takes in a spurious term"
            return "Euler relation" if EULER in node.tags and node not in adjoint else "needed"

        return name

    return classes


def derivative_class(node: Node) -> str:
    """Class of a node of a right formulation by its roles, and its bodies by its tags.

    A rate of a slope is of d/dt dL/dqd. What it has of the rates of dz/dqd, for a velocity z in L, dL/dq has as well:
    in the torque they cancel, and a formulation by velocities has neither (`velocity_nodes`).
    """
    if not node.args:
        return LEAVES
    of = sorted(node.tags - ENERGIES - {DAMPING})
    where = f"{of[0]}: " if len(of) == 1 else "several bodies: " if of else ""
    return where + _OF_ROLES[ADJOINT in node.roles, TANGENT in node.roles]


def form_classes(graph: Graph) -> Callable[[Node], str]:
    """The class of each node of `state_equation` or `hamilton_equations`, by what it depends on and what needs it.

    Of positions alone: inertia and its elimination. Then of accelerations the bias, which the torques have no part in,
    and what the torques reach; of momenta what the velocities need, and what only the rates of the momenta need.
    """
    momenta = "p0_dot" in graph.outputs
    inputs = dict(zip(graph.input_names, graph.inputs, strict=True))
    moving, driven = (
        descendants(graph.nodes, [node for name, node in inputs.items() if re.fullmatch(rf"{kind}\d+", name)])
        for kind in ("p" if momenta else "qd", "tau")
    )
    velocities = set(topological([node for name, node in graph.outputs.items() if momenta and name[0] == "q"]))

    def name(node: Node) -> str:
        if not node.args:
            return LEAVES
        if node not in moving and node not in driven:
            return POSITIONS
        if DAMPING in node.tags and node not in velocities and all([arg not in driven for arg in node.args]):
            return DAMPING
        if momenta:
            return VELOCITIES if node in velocities else RATES
        return ACCELERATIONS if node in driven else BIAS

    return name


def form_rows(graph: Graph) -> dict[str, list[Node]]:
    """{title: nodes} of `ROWS`."""
    class_of, rows = form_classes(graph), {title: list[Node]() for title in ROWS}
    title_of = {kind: title for title, kinds in ROWS.items() for kind in kinds}
    if "p0_dot" in graph.outputs:
        title_of[DAMPING] = TOP  # there it is of velocities that have been solved for
    for node in graph.nodes:
        title = title_of[class_of(node)]
        back = title in (INWARD, TOP) and TANGENT in node.roles and PRIMAL not in node.roles
        rows[OUTWARD if back else title].append(node)
    return rows

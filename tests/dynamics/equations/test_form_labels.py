"""What the equations of motion are called in parts: tags of every node, roles, and classes by what needs a node."""

from functools import partial

import pytest

import cgraph as cg
import dynamics as dyn
from cgraph import Graph, Node
from dynamics.equations.equations_of_motion import SOLUTIONS
from dynamics.equations.momentum.hamiltonian import is_quadratic
from viz.models.node_classes import form_classes

from ..mechanisms import FAMILIES, turned_arm
from ..models import cart_pendulum


def tagged_cart() -> dyn.System:
    """A cart with a pendulum in parameters alone: pivots are sums of these."""

    def lagrangian(q: list[Node], qd: list[Node], t: Node, p: dict[str, Node]) -> Node:
        with cg.tag("kinetic"):
            kinetic = 0.5 * p["M"] * qd[0] ** 2 + 0.5 * p["m"] * (qd[0] + qd[1]) ** 2
        with cg.tag("potential"):
            return kinetic - p["k"] * q[1] ** 2

    return dyn.System(lagrangian, "cart load", {"M": 2.0, "m": 1.0, "k": 3.0}, damping=0.3)


SCENES = {name: (lambda name=name: dyn.scenes.load(name)) for name in dyn.scenes.names()}
MODELS = SCENES | {"cart": tagged_cart, "cart pendulum": cart_pendulum, "arm": lambda: turned_arm(5)}
TAGGED = SCENES | {"turned": lambda: turned_arm(3), "mixed": lambda: FAMILIES["mixed"](3)}
GRAPHS = {name: lambda model, name=name: dyn.inverse_dynamics(model, name) for name in dyn.FORMULATIONS}
GRAPHS |= {name: lambda model, name=name: dyn.forward_dynamics(model, name) for name in SOLUTIONS}
GRAPHS |= {"derivatives": dyn.inverse_dynamics_derivatives}


def untagged(graph: cg.Graph) -> list[cg.Node]:
    """Operations without tags; leaves are shared by all."""
    return [node for node in graph.nodes if node.args and not node.tags]


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("model", TAGGED)
def test_every_operation_has_a_tag_and_some_come_of_the_potential(model: str, graph: str) -> None:
    derived = GRAPHS[graph](TAGGED[model]())
    rewritten = (model, graph) == ("two_link", "derivatives")  # by identities: nodes come of several parts at once
    assert rewritten or untagged(derived) == []
    assert [node for node in derived.nodes if "potential" in node.tags]


def test_derivatives_say_whose_they_are() -> None:
    graph = dyn.inverse_dynamics_derivatives(dyn.planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7]))
    for name, bodies in (("M_1_1", {"link 3"}), ("dtau_dqd_1_1", {"link 3"}), ("dtau_dq_2_0", {"link 3"})):
        tags = set().union(*[node.tags for node in cg.Graph(graph.inputs, {name: graph.outputs[name]}).nodes])
        assert bodies | {"kinetic"} <= tags


@pytest.mark.parametrize("name", MODELS)
def test_a_node_of_the_momentum_graph_has_a_role_and_tags_as_of_the_other_form(name: str) -> None:
    model = MODELS[name]()
    lagrange, hamilton = dyn.state_equation(model), dyn.hamilton_equations(model)
    assert not [node for node in hamilton.nodes if node.args and not node.roles]
    if not untagged(lagrange):
        assert not untagged(hamilton)


@pytest.mark.parametrize("name", ["triple_pendulum", "arm"])
def test_composite_momentum_and_damping_are_named_and_serve_the_rates_alone(name: str) -> None:
    graph = dyn.hamilton_equations(MODELS[name]())
    tags = graph.counts().by_tag
    assert tags["momentum"] > 0
    assert ("damping" in tags) == (name == "triple_pendulum")
    velocities = Graph(graph.inputs, {name: node for name, node in graph.outputs.items() if name[0] == "q"})
    here = [node for node in velocities.nodes if "momentum" in node.tags]
    class_of = form_classes(graph)
    assert all(["positions alone" in class_of(node) for node in here])  # of both: turns and first moments


@pytest.mark.parametrize("name", ["spring_mass", "triple_pendulum", "cart"])
def test_classes_are_what_a_node_depends_on_and_what_needs_it(name: str) -> None:
    model = MODELS[name]()
    for graph, kind in ((dyn.state_equation(model), "qd"), (dyn.hamilton_equations(model), "p")):
        class_of = form_classes(graph)
        for node in graph.nodes:
            inputs = {
                str(each.name) for each in cg.Graph(graph.inputs, {"x": node}).nodes if each.op.name == "variable"
            }
            moving = any([each.removeprefix(kind).isdecimal() for each in inputs if each.startswith(kind)])
            driven = any([each.startswith("tau") for each in inputs])
            found = class_of(node)
            assert ("positions alone" in found) == (bool(node.args) and not moving and not driven)
            assert not found.startswith("bias") or (moving and not driven and kind == "qd")


def test_labels_do_not_depend_on_what_was_derived_before() -> None:
    """A system keeps what it has made; no tag of the one who asked first may stay on it."""

    def box() -> dyn.Mechanism:
        free = dyn.Body("box", dyn.Joint("free"), mass=1.0, inertia=(0.1, 0.2, 0.3), center=(0.1, 0.0, 0.0))
        return dyn.Mechanism([free])

    derivations = [partial(dyn.inverse_dynamics, formulation=name) for name in sorted(dyn.FORMULATIONS)]
    derivations += [dyn.state_equation, dyn.hamilton_equations, dyn.momentum_rate, dyn.energy]
    fresh = [derive(box()).listing() for derive in derivations]
    for order in (1, -1):
        kept = box()
        found = [derive(kept).listing() for derive in derivations[::order]]
        assert found[::order] == fresh


def test_velocities_that_need_an_iteration_are_told_from_those_of_one_elimination() -> None:
    fast = dyn.System(lambda q, qd, t: -cg.sqrt(1.0 - qd[0] ** 2) - q[0] ** 2, "x")
    assert not is_quadratic(fast)
    assert is_quadratic(tagged_cart())
    assert is_quadratic(turned_arm(2).system)

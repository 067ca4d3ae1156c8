"""Tags on the equations of motion: every node says where it comes from, and gravity can be told from the rest."""

import pytest

import cgraph as cg
import dynamics as dyn
from dynamics.equations.equations_of_motion import SOLUTIONS
from tests.dynamics.mechanisms import FAMILIES, turned_arm

MODELS = {name: lambda name=name: dyn.scenes.load(name) for name in dyn.scenes.names()}
MODELS |= {"turned": lambda: turned_arm(3), "mixed": lambda: FAMILIES["mixed"](3)}
GRAPHS = {name: lambda model, name=name: dyn.inverse_dynamics(model, name) for name in dyn.FORMULATIONS}
GRAPHS |= {name: lambda model, name=name: dyn.forward_dynamics(model, name) for name in SOLUTIONS}
GRAPHS |= {"derivatives": dyn.inverse_dynamics_derivatives}


def untagged(graph: cg.Graph) -> list[cg.Node]:
    """Operations without tags; leaves are shared by all."""
    return [node for node in graph.nodes if node.args and not node.tags]


@pytest.mark.parametrize("graph", GRAPHS)
@pytest.mark.parametrize("model", MODELS)
def test_every_operation_has_a_tag_and_some_come_of_the_potential(model: str, graph: str) -> None:
    derived = GRAPHS[graph](MODELS[model]())
    rewritten = (model, graph) == ("two_link", "derivatives")  # by identities: nodes come of several parts at once
    assert rewritten or untagged(derived) == []
    assert [node for node in derived.nodes if "potential" in node.tags]


def test_derivatives_say_whose_they_are() -> None:
    graph = dyn.inverse_dynamics_derivatives(dyn.planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7]))
    for name, bodies in (("M_1_1", {"link 3"}), ("dtau_dqd_1_1", {"link 3"}), ("dtau_dq_2_0", {"link 3"})):
        tags = set().union(*[node.tags for node in cg.Graph(graph.inputs, {name: graph.outputs[name]}).nodes])
        assert bodies | {"kinetic"} <= tags

"""Exact counts of the formulations, and how they grow with the number of links."""

from pytest import mark

import dynamics as dyn
from cgraph import structure_hash
from tests.dynamics.mechanisms import FAMILIES, turned_arm
from tests.each_row import each_row


def equal_links(n: int) -> dyn.Mechanism:
    return dyn.planar_arm([0.9] * n, [0.7] * n)


def test_inverse_dynamics_of_the_paper_s_arm_is_small() -> None:
    arm = dyn.planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7])
    counts = dyn.inverse_dynamics(arm, "chain_rule").counts()
    assert (counts.nodes, counts.edges) == (164, 284)


def test_edges_of_equal_rods_follow_the_laws_of_the_page() -> None:
    """Of 1 kg and 1 m without damping, from three links on: docs/paper.md."""
    laws = {
        "by_definition": lambda n: 196 * n - 172,
        "kinetic_only": lambda n: 204 * n - 178,
        "chain_rule": lambda n: 130 * n - 132,
        "chain_rule_literal": lambda n: 46 * n**2 + 26 * n - 68,
    }
    for n in (3, 4, 7):
        arm = dyn.planar_arm([1.0] * n, [1.0] * n)
        found = {name: len(dyn.inverse_dynamics(arm, name).edges) for name in laws}
        assert found == {name: law(n) for name, law in laws.items()}


def test_damping_adds_a_product_and_a_sum_for_each_joint_and_one_constant() -> None:
    plain = dyn.inverse_dynamics(dyn.planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7]), "chain_rule").counts()
    damped = dyn.inverse_dynamics(dyn.scenes.load("triple_pendulum"), "chain_rule").counts()
    assert (damped.nodes - plain.nodes, damped.edges - plain.edges) == (3 * 2 + 1, 3 * 4)


@each_row("n", [1, 2, 3, 4, 8, 12])
def test_each_further_equal_link_adds_79_nodes_and_148_edges_and_91_nodes_to_forward_dynamics(n: int) -> None:
    counts = dyn.inverse_dynamics(equal_links(n), "chain_rule").counts()
    assert counts.nodes == 8 + 79 * (n - 1)
    assert n < 2 or counts.edges == 146 + 148 * (n - 2)
    assert n < 3 or len(dyn.forward_dynamics(equal_links(n), "recursive").nodes) == 156 + 91 * (n - 3)


def test_a_parameter_with_a_half_before_it_leaves_no_halves_behind() -> None:
    """L = m qd^2 / 2 - k q^2 / 2, squares written as products: m qdd + k q."""
    system = dyn.System(
        lambda q, qd, t, p: 0.5 * p["m"] * (qd[0] * qd[0]) - 0.5 * p["k"] * (q[0] * q[0]), ["x"], {"m": 1.0, "k": 1.0}
    )
    names = [node.op.name for node in dyn.inverse_dynamics(system).nodes if node.args]
    assert sorted(names) == ["add", "mul", "mul"]


def test_a_dense_solve_is_taken_that_saves_more_than_a_tenth_of_the_nodes_else_elimination_keeps_more_digits() -> None:
    for model, saves in ((dyn.tree([-1, 0]), False), (turned_arm(2), False), (FAMILIES["serial"](2), True)):
        auto, recursive, dense = (dyn.forward_dynamics(model, method) for method in ("auto", "recursive", "dense"))
        assert len(dense.nodes) < len(recursive.nodes)
        assert (len(dense.nodes) < 0.9 * len(recursive.nodes)) == saves
        assert structure_hash(auto) == structure_hash(dense if saves else recursive)


@mark.parametrize("formulation", ["by_definition", "kinetic_only"])
@mark.parametrize("n", [1, 3, 10])
def test_the_chain_rule_is_smaller_than_the_embedded_formulations(n: int, formulation: str) -> None:
    ours, theirs = (dyn.inverse_dynamics(equal_links(n), each).counts() for each in ("chain_rule", formulation))
    assert all(getattr(ours, size) < getattr(theirs, size) for size in ("nodes", "edges", "depth"))

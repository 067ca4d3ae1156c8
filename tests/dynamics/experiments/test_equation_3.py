"""Eq. (3): what the derivative by definition makes of a rotor on a spring, term by term."""

import numpy as np
from pytest import approx, mark

import dynamics as dyn

STATES = 200
ROUNDING = 1e-13  # a dozen operations, relative to the largest term that is summed
RNG = np.random.default_rng(3)
INERTIA, STIFFNESS = RNG.uniform(0.1, 10.0, (2, STATES))
DT = 10.0 ** RNG.uniform(-6.0, 0.0, STATES)
Q_OLD, QD_OLD, QDD = RNG.uniform(-3.0, 3.0, (3, STATES))
QD = QDD * DT + QD_OLD
Q = QD * DT + Q_OLD
BEFORE = {"q0_old": Q_OLD, "qd0_old": QD_OLD, "qdd0": QDD, "dt": DT, "I": INERTIA, "k": STIFFNESS}
AFTER = {"q0": Q, "qd0": QD, "qdd0": QDD, "I": INERTIA, "k": STIFFNESS}
SPRING_MASS = dyn.scenes.load("spring_mass")


def rate(formulation: str, values: dict[str, np.ndarray], **options: bool) -> np.ndarray:
    return dyn.momentum_rate(SPRING_MASS, formulation, **options).evaluate(values)["p0_dot"]


@mark.parametrize("simplify", [False, True])
def test_by_definition_the_inertial_term_gains_a_spring_force(simplify: bool) -> None:
    terms = STIFFNESS * np.array([QDD * DT**2, 2 * QD * DT, Q_OLD])
    largest = np.abs([*terms, INERTIA * QDD]).max(axis=0)
    gained = rate("by_definition", BEFORE, simplify=simplify) - INERTIA * QDD
    assert (np.abs(gained + terms.sum(axis=0)) / largest).max() < ROUNDING


RIGHT = {"chain_rule": AFTER, "chain_rule_literal": AFTER, "kinetic_only": BEFORE, "kinetic_only_exact": BEFORE}


@mark.parametrize("formulation", RIGHT)
def test_the_chain_rule_gives_the_inertial_term_and_kinetic_only_that_of_one_joint(formulation: str) -> None:
    assert rate(formulation, RIGHT[formulation]) == approx(INERTIA * QDD, rel=ROUNDING, abs=0.0)


def test_the_flawed_graph_of_equation_3_reads_as_the_paper_has_it() -> None:
    assert dyn.momentum_rate(SPRING_MASS, "by_definition").counts().by_operation == {
        "mul": 6,  # I qdd, qdd dt, qd dt, k qd_sum, dt (..), k q
        "variable": 6,
        "add": 4,  # qd, q, qdd dt + qd, the two terms of the spring
        "sub": 1,
    }


def test_spurious_is_the_branch_of_the_spring() -> None:
    """Of the 17 nodes by definition, the right inertial term has I, qdd and I qdd; a subtraction joins the rest on."""
    graph = dyn.momentum_rate(SPRING_MASS, "by_definition")
    gone = dyn.spurious_nodes(graph)
    kept = [node for node in graph.nodes if node not in gone]
    assert (len(graph.nodes), len(gone)) == (17, 13)
    assert sorted(node.name or node.op.name for node in kept) == ["I", "mul", "qdd0", "sub"]
    assert {"k", "dt", "q0_old", "qd0_old"} <= {node.name for node in gone}
    right = dyn.momentum_rate(SPRING_MASS, "kinetic_only_exact")
    assert len(right.nodes) == len(kept) - 1


@mark.parametrize("formulation", RIGHT)
def test_nothing_is_spurious_in_a_right_formulation_of_one_joint(formulation: str) -> None:
    assert dyn.spurious_nodes(dyn.inverse_dynamics(SPRING_MASS, formulation)) == frozenset()
    assert dyn.spurious_nodes(dyn.momentum_rate(SPRING_MASS, formulation)) == frozenset()


def test_the_chain_rule_has_no_trace_of_the_euler_relation() -> None:
    graph = dyn.inverse_dynamics(SPRING_MASS, "chain_rule")
    assert not {"dt", "q0_old", "qd0_old"} & set(graph.input_names)
    assert "Euler relation" not in graph.counts().by_tag

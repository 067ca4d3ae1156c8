"""The verdict on a formulation: against numbers of 60 digits, for random systems in any units and for named ones."""

import random
from collections.abc import Callable, Iterator
from functools import reduce
from operator import add, mul
from pathlib import Path
from typing import Any

import numpy as np
from mpmath import mp, mpf
from pytest import approx, mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics.equations.formulations.lagrange_terms import THROUGH_STEP, after_step, before_step, torques
from dynamics.equations.formulations.verdict import HOW, blame
from tests import high_precision
from tests.dynamics.mechanisms import floating, random_mechanism
from tests.slow import slow
from viz import cli

DIGITS, STEP = 90, mpf(10) ** -50  # s: by so little an embedded torque that is right is off
SEEN = 1e-12  # of the larger torque: graphs fold numbers in 53 bits; a difference is far more, in any units
STATES = 3

Term = Callable[[Any, Any, Any], Any]
# Of q, qd, and a number a: what a Lagrangian may have beside its masses. The first have slope 0 by q.
NOTHING: list[Term] = [
    lambda q, v, a: a * (cg.sin(q[0]) ** 2 + cg.cos(q[0]) ** 2) * v[0] ** 2,
    lambda q, v, a: a * v[0] * v[1],
    lambda q, v, a: a * (q[1] - q[1]) * v[1] ** 2,
    lambda q, v, a: a * (cg.exp(q[0]) * cg.exp(-q[0])) * v[1] ** 2,
    lambda q, v, a: a * cg.sqrt(1.0 + v[0] ** 2),
    lambda q, v, a: a * (cg.exp(cg.log(2.0 + cg.sin(q[1]))) - cg.sin(q[1])) * v[0] ** 2,
]
OF_POSITION: list[Term] = [
    lambda q, v, a: a * q[0],
    lambda q, v, a: -a * (q[0] - q[1]),
    lambda q, v, a: a * q[1] ** 2,
    lambda q, v, a: a * cg.cos(q[0] - q[1]),
    lambda q, v, a: a * cg.exp(-q[1]),
]
OF_BOTH: list[Term] = [
    lambda q, v, a: a * q[0] * v[1],
    lambda q, v, a: a * cg.cos(q[1]) * v[0] * v[1],
    lambda q, v, a: a * q[0] ** 2 * v[1] ** 2,
]


def random_system(seed: int) -> dyn.System:
    """Two coordinates in units of 1e-6 to 1e6, an energy in others, with or without each kind of term."""
    rng = random.Random(seed)
    units, energy = [10.0 ** rng.randint(-6, 6) for _ in range(2)], 10.0 ** rng.randint(-6, 6)
    kinds = [(NOTHING, 0.7), (OF_POSITION, 0.5), (OF_BOTH, 0.3)]
    chosen = [
        (rng.choice(terms), rng.uniform(0.3, 2.0)) for terms, chance in kinds for _ in range(2) if rng.random() < chance
    ]
    parameters = {f"a{i}": a * energy for i, (_, a) in enumerate(chosen)} if rng.random() < 0.5 else {}
    moving, damping, driven = rng.random() < 0.3, rng.choice([0.0, 0.4]), rng.random() < 0.3

    def lagrangian(q: Any, qd: Any, t: Any, p: Any) -> Any:
        x, v = (
            [a / unit for a, unit in zip(q, units, strict=True)],
            [a / unit for a, unit in zip(qd, units, strict=True)],
        )
        total = energy * (0.5 * v[0] ** 2 + 0.8 * v[1] ** 2)
        for i, (term, a) in enumerate(chosen):
            total = total + term(x, v, p.get(f"a{i}", a * energy))
        return total + energy * t * v[0] if moving else total

    force = (lambda q, qd, t: [energy / units[0] * cg.sin(t), 0.0]) if driven else None
    return dyn.System(lagrangian, "x y", parameters, forces=force, damping=[damping * energy, 0.0])


NAMED: dict[str, tuple[dyn.System, tuple[bool, bool]]] = {  # and whether by definition and kinetic only are wrong
    "atwood": (
        dyn.System(
            lambda q, qd, t, p: 0.5 * (p["a"] + p["b"]) * qd[0] ** 2 + (p["a"] - p["b"]) * 9.81 * q[0],
            ["x"],
            {"a": 2.0, "b": 1.0},
        ),
        (True, False),
    ),
    "balance": (
        dyn.System(lambda q, qd, t, p: p["a"] * qd[0] ** 2 + (p["a"] - p["a"]) * 9.81 * q[0], ["x"], {"a": 2.0}),
        (False, False),
    ),
    "ball": (dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) - 9.81 * q[1], "x y"), (True, False)),
    "charge": (dyn.System(lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) + q[0] * qd[1], "x y"), (True, True)),
    "circle": (
        dyn.System(lambda q, qd, t: 0.5 * (cg.sin(q[0]) ** 2 + cg.cos(q[0]) ** 2) * qd[0] ** 2, ["phi"]),
        (False, False),
    ),
}


def differences(system: dyn.System, formulation: str, sizes: list[float]) -> Iterator[tuple[dict[str, Any], Any, Any]]:
    """Random states of the coordinates' sizes, before the step and after it, and both torques."""
    flawed, right, rng = dyn.inverse_dynamics(system, formulation), dyn.inverse_dynamics(system), random.Random(7)
    rates = system.graph({f"{i}": node for i, node in enumerate(system.q_dot)}, system.q, system.qd)
    with mp.workdps(DIGITS):
        for _ in range(STATES):
            at: dict[str, Any] = {"t": mpf(rng.uniform(0.2, 1.0)), "dt": STEP} | system.parameters
            at |= {f"q{i}": mpf(rng.uniform(0.2, 1.0) * size) for i, size in enumerate(sizes)}
            for i, size in enumerate(sizes[: system.n]):
                at |= {f"{kind}{i}": mpf(rng.uniform(0.2, 1.0) * size) for kind in ("qd", "qdd")}
                at[f"qd{i}_old"] = at[f"qd{i}"] - at[f"qdd{i}"] * STEP
            moved = high_precision.evaluate(rates, {name: at[name] for name in rates.input_names}, DIGITS)
            at |= {f"q{i}_old": at[f"q{i}"] - rate * STEP for i, rate in moved.items()}
            yield at, *[high_precision.evaluate(graph, at, DIGITS) for graph in (flawed, right)]


def check(system: dyn.System, formulation: str, sizes: list[float]) -> dyn.Verdict:
    """The verdict, which is that of the numbers, with something to blame if and only if it is guilty."""
    verdict, differs = dyn.formulation_verdict(system, formulation), False
    for at, flawed, right in differences(system, formulation, sizes):
        largest = {name: SEEN * max(abs(flawed[name]), abs(right[name])) for name in right}
        off = {name: flawed[name] - right[name] for name in right}
        differs |= any(abs(off[name]) > largest[name] for name in off)
        excess = verdict.excess_at({name: float(value) for name, value in at.items()})
        assert all(abs(excess.get(name, 0.0) - off[name]) <= largest[name] for name in off)
    assert verdict.differs == differs
    assert verdict.differs == bool(verdict.excess) == bool(verdict.edges or verdict.missing)
    assert verdict.differs or not verdict.nodes
    assert verdict.edges <= set(verdict.graph.edges)
    begin = f"{HOW[formulation]}, the torque is {'wrong at every dt' if verdict.differs else 'right'}"
    assert str(verdict).startswith(begin)
    assert verdict.summary.startswith(begin)
    return verdict


def sizes_of(seed: int) -> list[float]:
    rng = random.Random(seed)
    return [10.0 ** rng.randint(-6, 6) for _ in range(2)]


@mark.parametrize("seed", [*range(6), *slow(*range(6, 200))])
def test_a_verdict_is_that_of_the_numbers_in_any_units(seed: int) -> None:
    system = random_system(seed)
    for formulation in dyn.FORMULATIONS:
        check(system, formulation, sizes_of(seed))


@mark.parametrize("formulation", dyn.FORMULATIONS)
@mark.parametrize("name", NAMED)
def test_a_named_system_is_judged_right_by_lint(name: str, formulation: str, tmp_path: Path, capsys: Any) -> None:
    system, wrong = NAMED[name]
    expected = dict(zip(THROUGH_STEP, wrong, strict=True)).get(formulation, False)
    verdict = check(system, formulation, [1.0] * system.n)
    assert verdict.differs == expected
    (tmp_path / "own.py").write_text(f"from {__name__} import NAMED\nsystem = NAMED[{name!r}][0]\n")
    assert cli.main(["lint", f"{tmp_path / 'own.py'}:system", "--formulation", formulation]) == int(expected)
    assert capsys.readouterr().out.startswith(str(verdict))


def test_what_has_cancelled_is_said_to_be_missing() -> None:
    verdict = dyn.formulation_verdict(NAMED["ball"][0], "by_definition")
    assert (verdict.nodes, verdict.edges, list(verdict.missing)) == (frozenset(), frozenset(), ["tau1"])
    assert str(verdict.excess["tau1"]) == "dL/dq.y = -9.81"
    assert str(verdict.missing["tau1"]) == "-dL/dq.y = 9.81"


def test_where_an_edge_alone_is_wrong_it_is_blamed_and_by_how_much_is_said() -> None:
    verdict = dyn.formulation_verdict(NAMED["atwood"][0], "by_definition")
    assert (len(verdict.nodes), len(verdict.edges), verdict.missing) == (0, 1, {})
    excess = verdict.excess["tau0"]
    assert (excess.formula, excess.value) == ("9.81 * (a - b)", 9.81)
    assert [*verdict.at.items()][-2:] == [("a", 2.0), ("b", 1.0)]
    assert (excess.torque, excess.right) == approx((3.0 * verdict.at["qdd0"], 3.0 * verdict.at["qdd0"] - 9.81))


def test_that_it_holds_is_proved_or_said_not_to_be() -> None:
    circle = dyn.formulation_verdict(NAMED["circle"][0], "by_definition")
    assert circle.proved  # by an identity
    hidden = dyn.System(
        lambda q, qd, t: 0.5 * qd[0] ** 2 * cg.cos(cg.acos(cg.tanh(q[0])) - cg.acos(cg.tanh(q[0])) * 1.0), "x"
    )
    tangled = dyn.System(
        lambda q, qd, t: 0.5 * (qd[0] * (cg.exp(cg.log(2.0 + cg.sin(q[0]))) - cg.sin(q[0]))) ** 2, ["x"]
    )
    assert dyn.formulation_verdict(hidden, "by_definition").differs is False
    verdict = dyn.formulation_verdict(tangled, "kinetic_only")
    assert (verdict.differs, verdict.proved, verdict.nodes) == (False, False, frozenset())
    assert "0 to rounding at all 24 states tried" in str(verdict)


def test_where_no_state_is_finite_nothing_is_said_to_hold() -> None:
    nowhere = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 + cg.sqrt(-1.0 - q[0] ** 2), ["x"])
    verdict = dyn.formulation_verdict(nowhere, "by_definition")
    assert (verdict.differs, verdict.proved, verdict.excess) == (True, False, {})
    assert str(verdict).startswith("By definition, the torque is not shown to be right: dL/dq is finite at none")


@mark.parametrize("joint", ["ball", "free"])
@mark.parametrize("formulation", THROUGH_STEP)
def test_of_quasi_velocities_too(joint: str, formulation: str) -> None:
    """A top that hangs beside its point is heavy; a free body's weight is its only force by definition."""
    kind = dyn.Joint(joint, name="base")
    body = dyn.Body("body", kind, mass=1.3, center=(0.2, 0.1, -0.3), inertia=(0.1, 0.2, 0.25))
    system = dyn.Mechanism([body]).system
    check(system, formulation, [1.0] * system.nq)


@mark.parametrize("seed", [0, 1, 2, *slow(*range(3, 60))])
@mark.parametrize("formulation", THROUGH_STEP)
def test_marked_by_a_factor_the_graph_is_the_same_node_by_node(seed: int, formulation: str) -> None:
    """So every edge to blame is found in it, or has cancelled; with those edges cut, c is gone."""
    system = random_system(seed)
    graph, factor = dyn.inverse_dynamics(system, formulation), cg.variable("factor")
    marked = cg.specialize(torques(system, formulation, factor), {"factor": 1.0})
    assert not cg.compare(marked, graph).only_left + cg.compare(marked, graph).only_right
    found = blame(system, formulation, torques, graph)
    assert found.nodes.issubset(graph.nodes)
    assert all([edge.source in edge.target.args for edge in found.edges])


def test_a_state_after_the_step_is_reached_from_the_one_before_it():
    """Also where q_dot = G(q_old) qd, of a ball joint."""
    top = dyn.Mechanism(
        [dyn.Body("top", dyn.Joint("ball"), mass=1.0, center=(0.1, 0.0, -0.5), inertia=(0.1, 0.1, 0.02))]
    )
    graph = dyn.inverse_dynamics(top, "by_definition")
    at = dict(
        zip(graph.input_names, np.random.default_rng(3).uniform(-1.0, 1.0, len(graph.inputs)).tolist(), strict=True)
    )
    at["dt"] = 0.01
    after = {"q1": 0.3, "q2": -0.4, "qd0": 2.0}
    before = before_step(top.system, at, after)
    found = after_step(top.system, before)
    assert {name: found[name] for name in after} == approx(after, rel=1e-12)
    assert [before[name] for name in ("q0_old", "qd1_old", "qdd0")] == [
        at[name] for name in ("q0_old", "qd1_old", "qdd0")
    ]


def test_a_verdict_takes_the_names_that_it_prints():
    verdict = dyn.formulation_verdict(dyn.scenes.load("triple_pendulum"), "by_definition")
    printed = {verdict.names.get(name, name): value for name, value in verdict.at.items()}
    assert verdict.excess_at(printed) == {name: each.value for name, each in verdict.excess.items()}
    again = dyn.formulation_verdict(dyn.scenes.load("triple_pendulum"), "by_definition", printed)
    assert again.excess == verdict.excess
    with raises(cg.GraphError, match=r"there is no q\.elbow"):
        dyn.formulation_verdict(dyn.scenes.load("triple_pendulum"), "by_definition", {"q.elbow": 1.0})


@mark.parametrize("formulation", dyn.FORMULATIONS)
def test_what_is_counted_as_off_is_among_the_slopes_that_a_model_has(formulation: str) -> None:
    """Of a free body on, as it has more coordinates than velocities, and of one that the formulations agree on."""
    for model in (floating("free", random_mechanism(1, ["revolute"], 1)), random_mechanism(2, ["prismatic"], 1)):
        system, verdict = dyn.as_system(model), dyn.formulation_verdict(model, formulation)
        counted = verdict.off
        assert counted[1::2] == (system.n, system.n * (system.nq + system.n))
        assert (counted.torques > 0) == (counted.slopes > 0) == verdict.differs


S = (1.0 - 0.25 * 0.7**2) ** 0.5
# Terms of Lagrangians, (number, factor, ..), and the kinetic energy at q = (0.3, 0.5), qd = (0.7, -0.2).
TERMS: dict[str, tuple[str, float, Callable[[Any, Any, Any], list[Any]]]] = {
    "spring": ("x", 0.245, lambda q, v, t: [(0.5, v[0], v[0]), (-4.5, q[0], q[0])]),
    "fall": ("x y", 0.265, lambda q, v, t: [(0.5, v[0], v[0]), (0.5, v[1], v[1]), (-9.81, q[1])]),
    "pendulum": ("x", 0.245, lambda q, v, t: [(0.5, v[0], v[0]), (9.81, cg.cos(q[0]))]),
    "orbit": ("x y", 0.2468, lambda q, v, t: [(0.5, v[0], v[0]), (0.5, q[0], q[0], v[1], v[1]), (1.0, 1.0 / q[0])]),
    "magnet": ("x y", 0.265, lambda q, v, t: [(0.5, v[0], v[0]), (0.5, v[1], v[1]), (1.5, q[0], v[1]), (-3.0, q[0])]),
    "pivot": ("x", 0.245, lambda q, v, t: [(0.5, v[0], v[0]), (1.0, v[0], t), (0.5, t, t), (-2.0, q[0], q[0])]),
    "hoop": ("x", 0.245, lambda q, v, t: [(0.5, v[0], v[0]), (2.0, cg.sin(q[0]), cg.sin(q[0])), (9.81, cg.cos(q[0]))]),
    "coupled": ("x y", 0.105, lambda q, v, t: [(0.5, v[0], v[0]), (1.0, v[0], v[1]), (1.0, q[0], q[1])]),
    "free": ("x", 0.98, lambda q, v, t: [(2.0, v[0], v[0])]),
    "fast": ("x", 4.0 / S - 4.0, lambda q, v, t: [(-4.0, cg.sqrt(1.0 - 0.25 * v[0] ** 2)), (-1.0, q[0], q[0])]),
    "henon": ("x y", 0.265, lambda q, v, t: [(0.5, v[0], v[0]), (0.5, v[1], v[1]), (-1.0, q[0], q[0], q[1])]),
}


def total(terms: list[Any], factor: float = 1.0) -> Any:
    return reduce(add, [reduce(mul, (factor * number, *rest)) for number, *rest in terms])


TYPINGS: list[Callable[[list[Any]], Any]] = [
    total,
    lambda terms: total(terms[::-1]),
    lambda terms: 0.5 * total(terms, 2.0),
    lambda terms: -(total(terms, -3.0) / 3.0),
    lambda terms: [total([term]) for term in terms],
    lambda terms: total(terms) + 3.0,
    lambda terms: 0.25 * ((total(terms) + 1.0) * (total(terms) + 1.0) - (total(terms) - 1.0) * (total(terms) - 1.0)),
    lambda terms: 0.25 * reduce(add, [(total([term]) + 1.0) ** 2 - (total([term]) - 1.0) ** 2 for term in terms]),
]


@mark.parametrize("name", TERMS)
def test_how_a_lagrangian_is_typed_changes_no_verdict_and_no_kinetic_energy(name: str) -> None:
    coordinates, expected, terms = TERMS[name]
    told, at = [], {"q0": 0.3, "q1": 0.5, "qd0": 0.7, "qd1": -0.2, "t": 0.4}
    for typing in TYPINGS:
        system = dyn.System(lambda q, qd, t, typing=typing: typing(terms(q, qd, t)), coordinates)
        kinetic = dyn.kinetic_energy(system)
        assert kinetic.evaluate({n: at[n] for n in kinetic.input_names})["K"] == approx(expected, rel=1e-12)
        verdicts = [dyn.formulation_verdict(system, formulation) for formulation in dyn.FORMULATIONS]
        words = [(each.differs, each.proved, each.reason, each.taken, each.off) for each in verdicts]
        off = [(each.symbol, *[round(x, 9) for x in each[2:]]) for one in verdicts for each in one.excess.values()]
        told.append((words, off))
    assert told == told[:1] * len(TYPINGS)


def test_the_kinetic_energy_is_that_of_the_tags_where_there_are_any() -> None:
    """A hoop that turns: by the tags the turning is kinetic, else a part of the energy at rest."""

    def lagrangian(tags: tuple[str, str]) -> dyn.System:
        def energy(q: Any, qd: Any, t: Any) -> Any:
            with cg.tag(tags[0]):
                kinetic = 0.5 * (qd[0] ** 2 + 4.0 * cg.sin(q[0]) ** 2)
            with cg.tag(tags[1]):
                potential = -9.81 * cg.cos(q[0])
            return kinetic - potential

        return dyn.System(energy, "x")

    for tags, expected, words in (
        (("kinetic", "potential"), 0.02 + 2.0 * np.sin(1.0) ** 2, "the terms of L tagged 'kinetic'"),
        (("a", "b"), 0.02, "E - P, the energy less that at rest"),
    ):
        system = lagrangian(tags)
        assert dyn.kinetic_energy(system).evaluate({"q0": 1.0, "qd0": 0.2})["K"] == approx(expected)
        verdict = dyn.formulation_verdict(system, "kinetic_only")
        assert (verdict.differs, verdict.taken) == (tags[0] == "kinetic", f"K is {words}.")
        assert str(verdict).endswith(verdict.taken)

"""Identities: what a scene does not need is seen, no digits are lost for it, and graphs are no longer than SymPy's."""

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from cgraph.extend import hessian_nodes, topological
from dynamics.equations.mass_matrix.accelerations import accelerations
from tests.bench.peers.translate import translated
from tests.dynamics.textbook import TEXTBOOK, points

POINTS = 6
RELATIVE = 1e-9  # of entries at random points: what varies by less is constant


def values(graph: cg.Graph, at: dict[str, np.ndarray]) -> np.ndarray:
    result = graph.evaluate({name: at[name] for name in graph.input_names})
    return np.array([np.broadcast_to(value, POINTS) for value in result.values()])


def sampled(system: dyn.System) -> dict[str, np.ndarray]:
    """Random values of every input, positive and small enough for roots and energies of textbook systems."""
    rng = np.random.default_rng(system.n)
    kinds = {"q": 0.5, "qd": 0.1, "qdd": 0.5, "tau": 0.5}
    inputs = {f"{kind}{i}": low + rng.random(POINTS) for kind, low in kinds.items() for i in range(system.n)}
    return inputs | {"t": rng.random(POINTS)} | {f"qd{i}": 0.1 + 0.2 * rng.random(POINTS) for i in range(system.n)}


def constant_where_it_does_not_vary(graph: cg.Graph, exact: np.ndarray) -> list[str]:
    """Outputs that do not vary, and are no number in the graph."""
    varies = np.ptp(exact, axis=1) > RELATIVE * np.maximum(np.abs(exact).max(axis=1), RELATIVE * np.abs(exact).max())
    rows = zip(graph.outputs.items(), varies, strict=True)
    return [name for (name, node), varied in rows if not varied and node.op.name != "constant"]


@pytest.mark.parametrize("name", TEXTBOOK)
def test_what_is_constant_or_zero_or_cyclic_is_a_fact_of_the_graph(name: str) -> None:
    system = TEXTBOOK[name]()
    at = sampled(system)
    lower = hessian_nodes(system.lagrangian, system.qd)
    entries = {f"{i}{j}": lower[max(i, j)][min(i, j)] for i in range(system.n) for j in range(system.n)}
    as_written = values(system.graph(entries, system.q, system.qd), at)
    matrix = dyn.mass_matrix(system)
    assert not constant_where_it_does_not_vary(matrix, as_written)
    np.testing.assert_allclose(values(matrix, at), as_written, rtol=1e-12, atol=1e-13 * np.abs(as_written).max())

    slopes = dyn.state_space(system)
    assert not constant_where_it_does_not_vary(slopes, values(slopes, at))

    before, after = accelerations(system), dyn.forward_dynamics(system)
    exact = values(before, at)
    np.testing.assert_allclose(values(after, at), exact, rtol=1e-10, atol=1e-12 * np.abs(exact).max())
    used = {node.name for node in after.nodes if node.op.name == "variable"}
    for variable in ("t", *[f"q{i}" for i in range(system.n)]):
        moved = at | {variable: at[variable] + 0.1}
        still = np.allclose(values(before, moved), exact, rtol=1e-11, atol=1e-12 * np.abs(exact).max())
        assert not (still and variable in used), variable


def test_differences_keep_their_digits() -> None:
    """(x - y)^2 is not written out, and 1 - cos x stays beside sin^2 x."""
    spring = points([1.0, 2.0], lambda q, t: [[q[0]], [q[1]]], 2, lambda q, t: 50.0 * (q[0] - q[1]) ** 2)
    at = {"q0": 1e6 + 1e-3, "q1": 1e6, "qd0": 0.0, "qd1": 0.0, "tau0": 0.0, "tau1": 0.0}
    assert dyn.forward_dynamics(spring).evaluate(at)["qdd0"] == pytest.approx(
        -100.0 * (at["q0"] - at["q1"]) - 9.81, rel=1e-14
    )


@pytest.mark.timeout(900)  # SymPy takes minutes
def test_no_longer_than_sympy() -> None:
    """Operations of ours over those that SymPy's cse leaves of the same quantity: at most 1.2, median under 0.9."""
    sp = pytest.importorskip("sympy")
    ratios = {}

    def number(value: float) -> object:
        return sp.Integer(value) if value.is_integer() else sp.Float(value)  # a power 2.0 would be NaN of 0

    for name, make in TEXTBOOK.items():
        system = make()
        n = system.n
        q, qd, qdd, tau = [sp.symbols(f"{kind}0:{n}") for kind in ("q", "qd", "qdd", "tau")]
        env = dict(zip([*system.q, *system.qd, system.t], [*q, *qd, sp.Symbol("t")], strict=True))
        energy = translated(topological([system.lagrangian]), env, sp, {}, number)[system.lagrangian]
        p = [sp.diff(energy, v) for v in qd]
        rates = [(q[i], qd[i]) for i in range(n)] + [(qd[i], qdd[i]) for i in range(n)] + [(sp.Symbol("t"), 1)]
        torques = [sum([sp.diff(p[i], x) * rate for x, rate in rates]) - sp.diff(energy, q[i]) for i in range(n)]
        mass = [sp.diff(momentum, v) for momentum in p for v in qd]
        bias = [torque.subs(dict.fromkeys(qdd, 0)) for torque in torques]
        solved = sp.Matrix(n, n, mass).LUsolve(sp.Matrix([a - b for a, b in zip(tau, bias, strict=True)]))
        for ours, theirs in (
            (dyn.mass_matrix, mass),
            (dyn.inverse_dynamics, torques),
            (dyn.forward_dynamics, list(solved)),
            (dyn.gravity_force, [each.subs(dict.fromkeys(qd, 0)) for each in bias]),
        ):
            shared, left = sp.cse(theirs)
            count = sum([sp.count_ops(each) for each in [*[value for _, value in shared], *left]])
            operations = sum([bool(node.args) for node in ours(system).nodes])
            ratios[name, ours.__name__] = (1 + operations) / (1 + count)
    assert max(ratios.values()) <= 1.2, max(ratios, key=ratios.__getitem__)
    assert np.median(list(ratios.values())) < 0.9

"""The Jacobian that rodas and radau compute is that of the rate, in either form."""

import numpy as np
import pytest

import dynamics as dyn
from cgraph.extend import Map, Program, runner
from dynamics.integrators import derive
from dynamics.integrators.problem import state_jacobian
from dynamics.integrators.step import jacobian_statements, lengths_of
from tests.tolerances import EQUATIONS


@pytest.mark.parametrize(("links", "compressed"), [(1, False), (3, True), (5, True)])
@pytest.mark.parametrize("backend", ["auto", "python"])
def test_the_statements_give_the_jacobian_of_the_rate(links, compressed, backend):
    problem = derive(dyn.planar_arm([1.0] * links, [1.0] * links), {})
    statements = jacobian_statements(problem)
    assert any(isinstance(each, Map) for each in statements) is compressed
    m, p = problem.size, len(problem.parameters)
    registers = lengths_of(statements, {"x": m, "t": 1, "p": p})
    run = runner(Program(registers, statements, record=["jacobian"]), backend)
    rng = np.random.default_rng(links)
    x, more = rng.uniform(-1.0, 1.0, m), rng.uniform(0.5, 1.5, p)
    (found,) = run.run(run.memory({"x": x, "p": more}), passes=1).rows
    graph = state_jacobian(problem)
    expected = np.array(list(graph.evaluate(dict(zip(graph.input_names, [*x, 0.0, *more], strict=True))).values()))
    np.testing.assert_allclose(found, expected, rtol=EQUATIONS, atol=EQUATIONS * np.abs(expected).max())


def test_radau_keeps_what_serves_the_next_step():
    """Of a damped spring that is stiff, with its error held all the same."""
    rates = lambda x, t: [x[1], -2e3 * x[1] - 2e3 * x[0] - x[0] ** 3]  # noqa: E731
    model = dyn.OdeSystem(rates, ["x", "v"])
    fine = dyn.simulate(model, [1.0, 0.0], None, 3.0, "radau", rtol=1e-11)
    run = dyn.simulate(model, [1.0, 0.0], None, 3.0, "radau", rtol=1e-7)
    stats = run.stats
    assert 0 < stats.njev < 0.5 * stats.steps
    assert 0 < stats.nlu < 1.5 * (stats.steps + stats.rejected)  # two of each pair
    assert stats.nlu % 2 == 0
    assert run.q[-1] == pytest.approx(fine.q[-1], rel=1e-6)
    event = dyn.Event("half", lambda x, t: x[0] - 0.5)
    watched = dyn.simulate(model, [1.0, 0.0], None, 3.0, "radau", rtol=1e-7, events=event).stats
    assert (watched.njev, watched.nlu) == (stats.njev, stats.nlu)

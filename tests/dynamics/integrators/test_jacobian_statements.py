"""The Jacobian that rodas and radau compute is that of the rate, in either form."""

import numpy as np
import pytest

import dynamics as dyn
from cgraph.extend import Map, Program, runner
from dynamics.integrators.jacobian_statements import jacobian_statements
from dynamics.integrators.problem import derive, state_jacobian
from tests.tolerances import EQUATIONS


@pytest.mark.parametrize(("links", "compressed"), [(1, False), (3, True), (5, True)])
@pytest.mark.parametrize("backend", ["auto", "python"])
def test_the_statements_give_the_jacobian_of_the_rate(links, compressed, backend):
    problem = derive(dyn.planar_arm([1.0] * links, [1.0] * links), {})
    statements, lengths = jacobian_statements(problem)
    assert any(isinstance(each, Map) for each in statements) is compressed
    m, p = problem.size, len(problem.parameters)
    registers = {"x": m, "t": 1, "p": p, "jacobian": m * m} | lengths
    run = runner(Program(registers, statements, record=["jacobian"]), backend)
    rng = np.random.default_rng(links)
    x, more = rng.uniform(-1.0, 1.0, m), rng.uniform(0.5, 1.5, p)
    (found,) = run.run(run.memory({"x": x, "p": more}), passes=1).rows
    graph = state_jacobian(problem)
    expected = np.array(list(graph.evaluate(dict(zip(graph.input_names, [*x, 0.0, *more], strict=True))).values()))
    np.testing.assert_allclose(found, expected, rtol=EQUATIONS, atol=EQUATIONS * np.abs(expected).max())

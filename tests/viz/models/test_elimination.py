"""The steps of an elimination: their pivots are Schur complements of the mass matrix, from the tip to the base."""

import numpy as np
import pytest

import dynamics as dyn
from cgraph import Graph
from tests.each_row import each_row
from tests.tolerances import SOLVED
from viz.models.inspection import elimination

MODELS = {
    "one": dyn.planar_arm([1.0], [1.0]),
    "three": dyn.planar_arm([1.0, 0.8, 0.7], [1.0, 0.8, 0.7]),
    "five": dyn.planar_arm([1.0, 0.9, 0.8, 0.7, 0.6], [0.5] * 5),
    "tree": dyn.tree([-1, 0, 1, 0]),
}


@each_row("name", MODELS)
def test_a_pivot_is_the_inertia_that_is_left_when_all_joints_further_out_follow(name):
    model = MODELS[name]
    graph, names = dyn.forward_dynamics(model), dyn.display_names(model)
    n = sum(output.startswith("qdd") for output in graph.outputs)
    steps = elimination(graph, names)
    assert sorted(step.joint for step in steps[:n]) == sorted(step.joint for step in steps[n:]) == [*range(n)]
    at = {each: 0.3 + 0.1 * i for i, each in enumerate(graph.input_names)}
    pivots = Graph(graph.inputs, {str(step.joint): step.value for step in steps[:n]}).evaluate(at)
    entries = dyn.mass_matrix(model)
    values = entries.evaluate({each: at[each] for each in entries.input_names})
    mass = np.array(list(values.values())).reshape(n, n)
    gone: list[int] = []
    for step in steps[:n]:
        i = step.joint
        expected = mass[i, i] - (
            mass[i, gone] @ np.linalg.solve(mass[np.ix_(gone, gone)], mass[gone, i]) if gone else 0
        )
        assert pivots[str(i)] == pytest.approx(expected, rel=SOLVED)
        assert f"Eliminate {names[f'qdd{i}'].partition('.')[2]}:" in step.words
        gone.append(i)
    for step in steps[n:]:
        assert step.value is graph.outputs[f"qdd{step.joint}"]
    rates = dyn.hamilton_equations(model)  # have the same pivots, then velocities, and the rates after them
    momenta = elimination(rates, names)
    assert [step.words for step in steps[:n]] == [step.words for step in momenta[:n]]
    for step in momenta[n : 2 * n]:
        assert step.value is rates.outputs[f"q{step.joint}_dot"]
    assert [step.value for step in momenta[2 * n :]] == [rates.outputs[f"p{i}_dot"] for i in reversed(range(n))]
    for made, through in ((graph, steps), (rates, momenta)):
        lit = [node for step in through for node in step.nodes]
        assert len(set(lit)) == len(lit)  # a node is new once
        assert {node for node in made.nodes if node.args} == set(lit)


def test_what_divides_by_no_pivots_has_no_steps():
    assert elimination(dyn.inverse_dynamics(MODELS["three"]), {}) == []
    x = dyn.planar_arm([1.0], [1.0])
    assert elimination(Graph(x.system.q, {"qdd0": x.system.q[0] * 2.0}), {}) == []

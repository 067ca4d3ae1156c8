"""The equations that a person reads mean the graphs: every line is computed again from its text."""

import math

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from tests.each_row import each_row
from viz import cli
from viz.models.equations import equation_graphs, equations_latex, equations_text

FUNCTIONS = {name: getattr(math, name) for name in ("sin", "cos", "exp", "sqrt", "tanh")} | {"abs": abs}


def pulley():
    def lagrangian(q, qd, t, p):
        return 0.5 * (p["m"] + p["M"]) * qd[0] ** 2 - (p["m"] - p["M"]) * -p["g"] * q[0] / -(2 - q[0] ** 3)

    return dyn.System(lagrangian, ["x"], {"m": 1.0, "M": 2.0, "g": 9.81}, damping=0.1)


MODELS = {
    "spring_mass": lambda: dyn.scenes.load("spring_mass"),
    "triple_pendulum": lambda: dyn.scenes.load("triple_pendulum"),
    "pulley": lambda: dyn.scenes.of_model(pulley()),
    "first order": lambda: dyn.scenes.of_model(dyn.OdeSystem(lambda x, t: [x[1], -(cg.sin(x[0]) ** 3)], ["a", "b"])),
}


@each_row(
    "model, momenta",
    [(name, momenta) for name in MODELS for momenta in (False, True) if not (momenta and name == "first order")],
)
def test_lines_of_text_compute_what_the_graphs_do(model, momenta):
    scene = MODELS[model]()
    graphs = equation_graphs(scene, momenta=momenta)
    called = dyn.display_names(scene)
    text = equations_text(scene, graphs, 1000)
    for k, name in enumerate(sorted(called.values(), key=len, reverse=True)):
        text = text.replace(name, f"name_{k}_")
    python = {shown: f"name_{k}_" for k, shown in enumerate(sorted(called.values(), key=len, reverse=True))}
    for (title, graph), block in zip(graphs.items(), text.split("\n\n"), strict=True):
        values = dict(
            zip(graph.input_names, np.random.default_rng(0).uniform(0.3, 1.0, len(graph.inputs)), strict=True)
        )
        known = {python.get(called.get(name, name), name): value for name, value in values.items()}
        heading, *lines = block.splitlines()
        assert heading == title
        for line in lines:
            left, _, right = line.strip().partition(" = ")
            known[left] = eval(right.replace("^", "**"), {"__builtins__": {}, **FUNCTIONS}, known)
        for name, value in graph.evaluate(values).items():
            found = known[python.get(called.get(name, name), name)]
            assert found == pytest.approx(float(value), rel=1e-9), name


def test_what_is_left_out_is_said_and_latex_has_every_block():
    scene = MODELS["triple_pendulum"]()
    graphs = equation_graphs(scene)
    assert "lines are left out; see --lines: those of v6, v9, " in equations_text(scene, graphs, 3)
    assert "left out" not in equations_text(scene, graphs, 1000)
    assert equations_latex(scene, graphs, 40).count(r"\begin{aligned}") == len(graphs) == 3


@each_row(
    "arguments, status, said",
    [
        ("equations spring_mass", 0, "tau.theta = I * qdd.theta + k * q.theta"),
        ("equations spring_mass --formulation by_definition", 1, "By definition, the torque is wrong"),
        (
            "equations spring_mass --formulation euler_embedded --latex",
            1,
            "% By definition, the torque is wrong",
        ),  # a former name
        ("equations spring_mass --momentum", 0, "p_dot.theta = tau.theta - k * q.theta"),
    ],
)
def test_the_command_prints_equations_and_the_verdict(capsys, arguments, status, said):
    assert cli.main(arguments.split()) == status
    assert said in capsys.readouterr().out

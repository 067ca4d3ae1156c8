"""Errors: each says what was given and what was needed."""

import math
import sys
from typing import Any

import numpy as np
import pytest
from pytest import mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics import System
from dynamics.equations.formulations.lagrange_terms import INERTIAL
from dynamics.io.mujoco_twin import MujocoTwin


def mass(q: Any, qd: Any, t: Any) -> cg.Node:
    return 0.5 * qd[0] ** 2


_ARMS: dict[str, tuple[dict[str, Any], str]] = {
    "negative mass": ({"masses": [1.0, -0.8]}, "link 2: mass must be positive and finite, got -0.8 kg"),
    "zero mass": ({"masses": [0.0, 1.0]}, "link 1: mass must be positive and finite, got 0.0 kg"),
    "NaN mass": ({"masses": [math.nan, 1.0]}, "link 1: mass must be positive and finite, got nan kg"),
    "infinite mass": ({"masses": [1.0, math.inf]}, "link 2: mass must be positive and finite, got inf kg"),
    "zero length": ({"lengths": [1.0, 0.0]}, "link 2: length must be positive and finite, got 0.0 m"),
    "NaN length": ({"lengths": [1.0, math.nan]}, "link 2: length must be positive and finite, got nan m"),
    "counts differ": ({"lengths": [1.0]}, "as many masses as lengths, at least one; got 2 and 1"),
    "no links": ({"masses": [], "lengths": []}, "as many masses as lengths, at least one; got 0 and 0"),
    "mass_model": ({"mass_model": "beam"}, """mass_model must be "rod" or "point", got 'beam'"""),
    "gravity": ({"gravity": math.nan}, "gravity must be finite, got nan m/s"),
    "negative damping": ({"damping": [0.1, -0.1]}, "damping must be finite and at least 0, got -0.1 for 'joint 2'"),
    "NaN damping": ({"damping": math.nan}, "damping must be finite and at least 0, got nan for 'joint 1'"),
}


@mark.parametrize("case", _ARMS)
def test_an_arm_that_cannot_be_is_refused(case: str) -> None:
    changed, message = _ARMS[case]
    with raises(ValueError, match=message):
        dyn.planar_arm(**({"masses": [1.0, 1.0], "lengths": [1.0, 1.0]} | changed))


_SYSTEMS: dict[str, tuple[dict[str, Any], type[Exception], str]] = {
    "no coordinates": ({"coordinates": []}, ValueError, "needs at least one coordinate"),
    "coordinate twice": ({"coordinates": ["x", "y", "x"]}, ValueError, "coordinate names must differ, got x, y, x"),
    "coordinate empty": ({"coordinates": [""]}, ValueError, "name of a coordinate must not be empty"),
    "coordinate a number": ({"coordinates": [3]}, TypeError, "name of a coordinate must be a string, got int: 3"),
    "parameter NaN": ({"parameters": {"k": math.nan}}, ValueError, "parameter 'k' must be a finite number, got nan"),
    "parameter text": ({"parameters": {"k": "3"}}, ValueError, "parameter 'k' must be a finite number, got '3'"),
    "damping negative": ({"damping": -1.0}, ValueError, "damping must be finite and at least 0, got -1.0"),
    "damping that feeds": ({"damping": [[-0.1]]}, ValueError, "damping must take energy, qd D qd >= 0"),
    "dampings differ": ({"damping": [1.0, 2.0]}, ValueError, "damping needs one number for each of .*: 1, got 2"),
    "forces too many": (
        {"forces": lambda q, qd, t: [1.0, 2.0]},
        ValueError,
        "forces must give 1 values, one for each of x; got 2",
    ),
    "forces none": ({"forces": lambda q, qd, t: []}, ValueError, "forces must give 1 values, .* got 0"),
    "forces text": (
        {"forces": lambda q, qd, t: ["a"]},
        TypeError,
        "the force on 'x' must be a node or a number: .*str: 'a'",
    ),
    "forces one node": ({"forces": lambda q, qd, t: q[0]}, TypeError, "forces must give .*Node"),
    "forces nothing": ({"forces": lambda q, qd, t: None}, TypeError, "forces must give .*None"),
    "forces of what": ({"forces": lambda q: [q[0]]}, TypeError, r"forces must take \(q, qd, t\).*, got \(q\)"),
    "forces no function": ({"forces": 3.0}, TypeError, "forces must be .*, got .*3.0"),
    "lagrangian text": (
        {"lagrangian": lambda q, qd, t: ["L"]},
        TypeError,
        "the lagrangian must be a node or a number: .*str: 'L'",
    ),
    "lagrangian nothing": (
        {"lagrangian": lambda q, qd, t: None},
        TypeError,
        "the lagrangian must give a node or a sequence, .*None; is `return` missing",
    ),
    "power": ({"lagrangian": lambda q, qd, t: qd[0] ^ 2}, TypeError, r"lagrangian: a power is written \*\*"),
    "equal": ({"lagrangian": lambda q, qd, t: qd[0] if q[0] == 0 else qd[0] ** 2}, TypeError, "cg.equal compares"),
    "by name": ({"lagrangian": lambda q, qd, t: qd.x}, TypeError, r"lists in the order of their names, as q\[0\]"),
    "index": ({"lagrangian": lambda q, qd, t: qd[1] ** 2}, TypeError, "lists in the order of their names"),
    "t as list": ({"lagrangian": lambda q, qd, t: t[0]}, TypeError, "t and each entry of q and qd is a node"),
    "t as number": ({"forces": lambda q, qd, t: [int(t)]}, TypeError, "called once, with nodes"),
    "swapped": ({"lagrangian": lambda qd, q, t: mass(q, qd, t)}, TypeError, r"in this order, got \(qd, q, t\)"),
    "q, qd, t": ({"constraints": lambda q, qd, t: [q[0]]}, TypeError, r"got \(q, qd, t\); conditions on velocities"),
    "forces by name": ({"forces": lambda q, qd, t: {"x": 1.0}}, TypeError, "forces must give a sequence, got dict"),
    "lagrangian NaN": ({"lagrangian": lambda q, qd, t: math.nan}, ValueError, "the lagrangian must be .*NaN"),
    "lagrangian empty": ({"lagrangian": lambda q, qd, t: []}, ValueError, "gave no partial Lagrangians"),
    "lagrangian of what": ({"lagrangian": lambda q: q[0]}, TypeError, r"lagrangian must take \(q, qd, t\)"),
    "lagrangian no function": ({"lagrangian": None}, TypeError, "lagrangian must be .*, got .*None"),
    "foreign variable": (
        {"lagrangian": lambda q, qd, t: mass(q, qd, t) - cg.variable("stray") * q[0]},
        ValueError,
        "the system uses 'stray', which is no coordinate, parameter or t \\(it has x\\)",
    ),
    "foreign in forces": (
        {"forces": lambda q, qd, t: [cg.variable("wind")]},
        ValueError,
        "the system uses 'wind', which is no coordinate",
    ),
}


@mark.parametrize("case", _SYSTEMS)
def test_a_system_that_cannot_be_is_refused(case: str) -> None:
    changed, kind, message = _SYSTEMS[case]
    with raises(kind, match=message):
        System(**({"lagrangian": mass, "coordinates": ["x"]} | changed))


@mark.parametrize("name", ["q0", "qd3", "qdd12", "tau1", "t", "dt", "q0_old", "qd1_old"])
def test_names_of_the_graphs_own_inputs_are_reserved(name: str) -> None:
    with raises(ValueError, match=f"parameter '{name}' has the name of a coordinate"):
        System(mass, ["x"], {name: 1.0})


@mark.parametrize("name", ["q", "tau", "time", "dt2", "k1", "qdot0", "T"])
def test_other_names_are_free(name: str) -> None:
    system = System(lambda q, qd, t, p: 0.5 * p[name] * qd[0] ** 2, ["x"], {name: 2.0})
    assert dyn.inverse_dynamics(system).input_names == ("q0", "qd0", "qdd0", name)


@mark.parametrize("value", [np.float32(2.0), np.int64(2), np.float64(2.0)])
def test_numbers_of_numpy_are_numbers(value: Any) -> None:
    assert System(mass, ["x"], {"k": value}, damping=value).damping == (2.0,)
    assert System(mass, ["x"], {"k": value}).parameters == {"k": 2.0}


@mark.parametrize(
    ("make", "known", "name"),
    [
        (dyn.inverse_dynamics, dyn.FORMULATIONS, "lagrange"),
        (dyn.momentum_rate, INERTIAL, "lagrange"),
        (dyn.momentum_rate, INERTIAL, "newton_euler"),  # forms no momentum
    ],
)
def test_an_unknown_formulation_is_named_with_those_that_there_are(make, known, name) -> None:
    with raises(ValueError, match=f"formulation must be one of {', '.join(known)}, got {name!r}"):
        make(System(mass, ["x"]), name)


def test_without_mujoco_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    arm = dyn.planar_arm([1.0], [1.0])
    for needs in (dyn.to_mjcf, MujocoTwin):
        with raises(ImportError, match=r"pip install -e '\.\[mujoco\]'"):
            needs(arm)

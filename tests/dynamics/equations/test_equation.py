"""The row of an equation is what its graph has: names and shapes of outputs, inputs, docstring, refusal."""

import inspect
import re
from collections.abc import Callable

import numpy as np
import pytest

import dynamics as dyn
from dynamics.equations.equation import EQUATIONS, Equation, Output
from tests.dynamics.mechanisms import floating, random_mechanism
from tests.dynamics.units import Units, in_units
from tests.each_row import each_row
from tests.test_docstrings import lacks

ROWS = [name for name in dyn.__all__ if getattr(dyn, name) is not None and name in EQUATIONS]
MODELS = {
    "chain": random_mechanism(2, ["revolute", "prismatic"], 1),
    "free": floating("free", random_mechanism(1, ["revolute"], 1)),  # more coordinates than velocities
    "spring": dyn.System(lambda q, qd, t, p: 0.5 * qd[0] ** 2 - p["k"] * t * q[0] ** 2, "x", {"k": 2.0}, damping=0.1),
}


def test_every_row_is_looked_at() -> None:
    assert len(ROWS) >= 17
    assert set(EQUATIONS) - {"loss"} == set(ROWS)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", ROWS)
def test_a_graph_has_the_inputs_and_the_outputs_of_its_row(name: str, model: str) -> None:
    row, system = EQUATIONS[name], dyn.as_system(MODELS[model])
    graph = getattr(dyn, name)(MODELS[model])
    assert list(graph.outputs) == [output for each in row.outputs for output in each.of(system)]
    counts = {"q": system.nq, "qd": system.n, "qdd": system.n, "tau": system.n, "p": system.n}
    state = [f"{kind}{i}" for kind in row.inputs for i in range(counts[kind])]
    assert list(graph.input_names) == [*state, *[str(node.name) for node in system.extra_inputs]]


@pytest.mark.parametrize("name", ROWS)
def test_a_row_writes_the_tables_of_the_docstring(name: str) -> None:
    function = getattr(dyn, name)
    assert lacks(function) == []
    text, signature = inspect.getdoc(function) or "", inspect.signature(function)
    words = " ".join(text.split())
    assert next(iter(signature.parameters)) == "model"
    for output in EQUATIONS[name].outputs:
        assert str(output).split()[0].rstrip(",") in text
        assert output.unit in words
    for section in ("Parameters", "Returns", "Raises", "Examples"):
        assert f"\n{section}\n---" in text


@pytest.mark.parametrize("name", [name for name in ROWS if all(output.unit for output in EQUATIONS[name].outputs)])
def test_the_powers_of_length_in_the_units_are_those_of_the_numbers(name: str) -> None:
    """Of hinges and slides: where lengths are twice as many, entries are 1, 2 or 4 times as large, or a part of it."""
    model, row = random_mechanism(4, ["revolute", "prismatic"], 1), EQUATIONS[name]
    way = np.where([body.joint.type.turns for body in model.moving], 1.0, 2.0)
    assert set(way) == {1.0, 2.0}
    rng, factors = np.random.default_rng(0), {"p": 4.0 / way}
    values = {kind: rng.uniform(0.5, 1.5, model.system.n) for kind in row.inputs}
    factors |= {"tau": 4.0 / way} | dict.fromkeys(("q", "qd", "qdd"), way)

    def entries(used: dyn.Mechanism, scale: float) -> dict[str, float]:
        numbers = {kind: x * factors[kind] ** scale for kind, x in values.items()}
        named = {f"{kind}{i}": float(v) for kind, x in numbers.items() for i, v in enumerate(x)}
        found: dict[str, float] = getattr(dyn, name)(used).evaluate(named)
        return found

    here, there = entries(model, 0.0), entries(in_units(model, Units(length=2.0)), 1.0)
    for output in row.outputs:
        pairs = [(here[each], there[each]) for each in output.of(model.system) if here[each]]
        powers = {round(float(np.log2(b / a)), 6) for a, b in pairs}
        assert not pairs or powers == {float(power(unit)) for unit in output.unit.replace(" or ", ", ").split(", ")}


def power(unit: str) -> int:
    above, _, below = unit.partition("/")
    parts = above.split(), below.strip("()").replace("s^2", "s").split()
    count = [sum([{"m": 1, "m^2": 2, "N": 1, "J": 2}.get(part, 0) for part in side]) for side in parts]
    return count[0] - count[1]


@pytest.mark.parametrize("name", [name for name in ROWS if name != "state_equation"])
def test_what_has_no_lagrangian_is_refused_in_a_sentence(name: str) -> None:
    with pytest.raises(TypeError, match="first-order system, which has no Lagrangian"):
        getattr(dyn, name)(dyn.OdeSystem(lambda x, t: [-x[0]], "x"))


def test_of_several_forms_the_smallest_graph_counts() -> None:
    @Equation("q qd", Output("loss", (), "W"))
    def loss(system: dyn.System):  # type: ignore[no-untyped-def]
        yield [system.qd[0] * system.qd[0] + system.q[0] - system.q[0]]
        yield [system.qd[0] * system.qd[0]]

    arm = dyn.planar_arm([1.0], [1.0])
    assert len([node for node in loss(arm).nodes if node.args]) == 1
    assert str(inspect.signature(loss)) == "(model: 'Model') -> 'Graph'"


@each_row(
    ("make", "said"),
    [
        (
            lambda: Output("P", ("n",), "W"),
            "output 'P' of shape ('n',) needs a place {} for each index, 1 in all, got 0",
        ),
        (lambda: Output("M_{}", ("n", "n")), "2 in all, got 1"),
        (lambda: Output("P{}", ("k",)), "a size of output 'P{}' is one of n, 2n, nq or a number as '3', got 'k'"),
        (lambda: Equation("q zz", Output("P")), "inputs of an equation are among q, qd, qdd, tau, p, got 'zz'"),
        (
            lambda: Equation("q", Output("P{}", ("n",)), rewritten=False)(lambda system: [[system.q[0]]])(
                MODELS["chain"]
            ),
            "a derivation must give a node for each of 2 outputs, gave 1",
        ),
    ],
)
def test_a_row_that_would_lose_outputs_is_refused(make: Callable[[], object], said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        make()

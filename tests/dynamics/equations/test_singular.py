"""Mass matrices that are not positive definite at one state: seen, and the coordinate named."""

import math
from itertools import pairwise

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn
from dynamics import SingularMassMatrixError, forward_dynamics, raise_if_singular
from dynamics.equations.equations_of_motion import SOLUTIONS
from tests.each_row import each_row
from tests.slow import slow
from tests.tolerances import CONDITIONED, LAST_BITS

METHODS = [name for name in SOLUTIONS if name != "auto"]


def accelerations(system: dyn.System, method: str, **values: float) -> dict[str, float]:
    """The outputs at a state that is zero but for `values`, checked."""
    graph = forward_dynamics(system, method, check=True)
    result = graph.evaluate(dict.fromkeys(graph.input_names, 0.0) | system.parameters | values)
    raise_if_singular(system, result["info"])
    return result


def two_points(inner: float) -> dyn.System:
    """A double pendulum of two points, the inner of the given mass, on rods of 1 m; q1 is relative to the first rod."""

    def lagrangian(q, qd, t, p):
        first, second = q[0], q[0] + q[1]
        x = qd[0] * cg.cos(first) + (qd[0] + qd[1]) * cg.cos(second)
        y = qd[0] * cg.sin(first) + (qd[0] + qd[1]) * cg.sin(second)
        return 0.5 * p["inner"] * qd[0] * qd[0] + 0.5 * (x * x + y * y)

    return dyn.System(lagrangian, ["shoulder", "elbow"], {"inner": inner})


SLIDER = dyn.System(lambda q, qd, t: 0.5 * qd[0] * qd[0] * q[0], ["slider"])
JOINT = dyn.System(lambda q, qd, t: 0.5 * qd[0] * qd[0] * cg.cos(q[0]), ["joint"])
MASSLESS = two_points(0.0)


@pytest.mark.parametrize("method", METHODS)
@each_row(
    ("system", "state", "result"),
    [
        (SLIDER, {"q0": 0.5, "tau0": 1.0}, 2.0),
        *[(SLIDER, {"q0": place, "tau0": 1.0}, "slider") for place in (0.0, -0.5, math.nan)],
        (JOINT, {"q0": 1.5}, 0.0),
        (JOINT, {"q0": 1.6}, "joint"),  # though the result is finite
        (MASSLESS, {"q1": 1.0}, 0.0),
        (MASSLESS, {"tau0": 1.0}, "shoulder"),  # of a straight rod
        (two_points(0.5), {"tau0": 1.0}, 2.0),
        (two_points(-0.1), {"q1": 0.1}, "shoulder"),
    ],
)
def test_an_inertia_that_is_not_positive_is_found_where_it_is(
    system: dyn.System, state: dict[str, float], result: float | str, method: str
) -> None:
    if isinstance(result, float):
        assert accelerations(system, method, **state)["qdd0"] == result
    else:
        with pytest.raises(SingularMassMatrixError, match=f"not positive definite: coordinate '{result}'"):
            accelerations(system, method, **state)


def string(n: int) -> dyn.System:
    """n beads on a line, each sprung and coupled to the next, of masses m0 .. ."""
    names = [f"m{i}" for i in range(n)]

    def lagrangian(q, qd, t, p):
        kinetic = [0.5 * p[name] * v * v for name, v in zip(names, qd, strict=True)]
        coupling = [0.05 * (a - b) * (a - b) for a, b in pairwise(qd)]
        return [*kinetic, *coupling]

    return dyn.System(lagrangian, [f"bead {i}" for i in range(n)], dict.fromkeys(names, 1.0))


def test_the_first_of_thirty_that_fails_is_named_in_a_batch_with_its_state():
    system = string(30)
    graph = forward_dynamics(system, check=True)
    assert len(graph.nodes) <= len(forward_dynamics(system).nodes) + 3 * 30 + 1
    columns = np.array([[system.parameters.get(name, 0.1)] * 4 for name in graph.input_names])
    columns[graph.input_names.index("m17"), 2] = -1.0
    columns[graph.input_names.index("m4"), 2] = -1.0
    run = cg.compile(graph)
    pivot = run.batch(columns)[list(graph.outputs).index("info")]
    assert pivot.tolist() == [0.0, 0.0, 18.0, 0.0]
    raise_if_singular(system, pivot[:2])
    with pytest.raises(SingularMassMatrixError, match="at state 2: coordinate 'bead 17'"):
        raise_if_singular(system, pivot)
    for name, column in zip(["m0", "m29"], columns.T, strict=False):
        column[graph.input_names.index(name)] = -1.0
        assert system.coordinates[int(run(column)[-1]) - 1] == f"bead {name[1:]}"


def quadratic(rng: np.random.Generator, unit: np.ndarray, signs: list[float]) -> dyn.System:
    """L = sum of sign_k z_k^2 / 2 with as many random velocities z_k(q, qd), the coordinates in these units."""
    n = len(unit)
    a, b = rng.normal(size=(len(signs), n)), rng.normal(size=(len(signs), n))

    def lagrangian(q, qd, t):
        z = [
            sum((u + w * cg.sin(q[0] / unit[0])) * v / s for u, w, v, s in zip(*rows, qd, unit, strict=True))
            for rows in zip(a, b, strict=True)
        ]
        return [0.5 * sign * velocity * velocity for sign, velocity in zip(signs, z, strict=True)]

    return dyn.System(lagrangian, [f"x{i}" for i in range(n)])


@pytest.mark.parametrize("seed", [*range(8), *slow(*range(8, 40))])
def test_of_random_lagrangians_the_singular_ones_are_refused_and_the_others_solved(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 4))
    signs = rng.choice([-1.0, 1.0], n).tolist()
    unit = 10.0 ** rng.uniform(-8, 8, n)
    system = quadratic(rng, unit, signs)
    graph, inverse = forward_dynamics(system), dyn.inverse_dynamics(system)
    numbers = rng.uniform(0.5, 1.5, (3, n)) * [unit, unit, 1.0 / unit]
    values = dict(zip(graph.input_names, numbers.ravel().tolist(), strict=True))
    known = {k: value for k, value in (values | graph.evaluate(values)).items() if k in inverse.input_names}
    back = np.array(list(inverse.evaluate(known).values()))
    assert back * unit == pytest.approx(numbers[2] * unit, rel=CONDITIONED, abs=CONDITIONED)
    with pytest.raises(SingularMassMatrixError, match="singular"):
        forward_dynamics(quadratic(rng, unit, signs[1:]))


def test_an_indefinite_mass_matrix_with_no_diagonal_is_solved_with():
    def lagrangian(q, qd, t):
        return [qd[0] * qd[1] - q[0] * q[1], (2.0 + cg.sin(q[0])) * qd[2] * qd[3], qd[1] * qd[3]]

    system = dyn.System(lagrangian, "w x y z".split())
    for method in SOLUTIONS:
        graph = forward_dynamics(system, method)
        values = dict.fromkeys(graph.input_names, 0.0) | {"q0": 0.5, "q1": 0.25, "tau2": 3.0}
        found = np.array(list(graph.evaluate(values).values()))
        s = 2.0 + math.sin(0.5)
        matrix = np.array([[0, 1, 0, 0], [1, 0, 0, 1], [0, 0, 0, s], [0, 1, s, 0]])
        assert matrix @ found == pytest.approx([-0.25, -0.5, 3.0, 0.0], abs=LAST_BITS)
        with pytest.raises(SingularMassMatrixError, match="not positive definite: coordinate"):
            forward_dynamics(system, method, check=True)


@pytest.mark.parametrize(
    ("lagrangian", "words"),
    [
        (lambda q, qd, t: cg.sqrt(qd[0] * qd[0] + qd[1] * qd[1]), "a motion of 'x' and 'y' has no inertia"),
        (lambda q, qd, t: 0.5 * (3.0 * qd[0] + 0.1 * qd[1]) ** 2, "has no inertia"),
        (lambda q, qd, t: 0.5 * (cg.sin(q[1]) * qd[0] + q[0] * qd[1]) ** 2, "a motion of 'x' and 'y' has no inertia"),
        (lambda q, qd, t: qd[0] * q[1], "'y' has no inertia"),
    ],
)
def test_a_motion_without_inertia_is_refused_wherever_accelerations_are_asked_for(lagrangian, words):
    system = dyn.System(lagrangian, ["x", "y"])
    for use in (forward_dynamics, dyn.certify, lambda s: dyn.simulate(s, [1.0, 0.3], [0.5, 0.2], t_end=1.0)):
        with pytest.raises(SingularMassMatrixError, match=words):
            use(system)


def test_masses_far_apart_are_no_lack_of_inertia():
    """A dense M loses the light mass in the heavy one, 1e-20 of it; elimination does not."""

    def lagrangian(q, qd, t):
        return [0.5 * qd[0] * qd[0], 0.5e20 * (qd[0] + qd[1]) * (qd[0] + qd[1])]

    graph = forward_dynamics(dyn.System(lagrangian, ["x", "y"]))
    assert graph.evaluate(dict.fromkeys(graph.input_names, 0.0) | {"tau0": 1.0}) == {"qdd0": 1.0, "qdd1": -1.0}


def test_an_inertia_that_is_not_positive_is_named_by_its_velocity() -> None:
    """Of a free body there are more coordinates than velocities: the last of these has no fellow among them."""
    flat = dyn.Body("flat", dyn.Joint("free"), mass=1.0, inertia=np.diag([1.0, 1.0, 2.0]))
    with pytest.raises(dyn.SingularMassMatrixError, match=r"'flat.wz' has an inertia that is not positive"):
        dyn.raise_if_singular(dyn.Mechanism([flat]), 6)


def random_chain(seed: int) -> dyn.Mechanism:
    """Of two to four joints of all types, most bodies without mass, in units of any size."""
    rng = np.random.default_rng(seed)
    kinds = ["revolute", "prismatic", "ball", "free", "universal", "planar", "cylindrical"]
    bodies, count = [], int(rng.integers(2, 5))
    mass, length = 10.0 ** rng.uniform(-6.0, 6.0, 2)
    for i in range(count):
        inertia = mass * length**2 * np.diag([0.1, 0.2, 0.25]) if rng.integers(2) else np.zeros((3, 3))
        numbers = {"mass": mass, "center": length * rng.normal(size=3), "inertia": inertia}
        place = length * rng.normal(size=3) if rng.integers(2) else np.zeros(3)
        axis = np.eye(3)[rng.integers(3)] if rng.integers(2) else rng.normal(size=3)
        heavy = i == count - 1 or rng.random() < 0.3
        joint = dyn.Joint(str(rng.choice(kinds)), axis, place)
        bodies.append(dyn.Body(f"b{i}", joint, f"b{i - 1}" if i else "world", **(numbers if heavy else {})))
    return dyn.Mechanism(bodies)


def lacks_inertia(mechanism: dyn.Mechanism) -> bool:
    """Whether the eigenvalues of M, scaled to 1 on its diagonal, have one that is rounding at a random state."""
    system, rng = mechanism.system, np.random.default_rng(0)
    size = [
        max(np.abs(np.asarray(b.joint.position)).max() + np.abs(np.asarray(b.center)).max() for b in mechanism.bodies)
    ]
    q = np.where([unit == "m" for b in mechanism.moving for unit in b.joint.type.units], size, 1.0)
    matrix = dyn.arrays_at(system, dyn.mass_matrix(system), q=q * rng.uniform(0.5, 1.5, system.nq))["M"]
    scale = np.sqrt(np.diagonal(matrix))
    if not scale.all():
        return True
    smallest = np.linalg.eigvalsh(matrix / np.outer(scale, scale))[0]
    assert not 1e-13 < smallest < 1e-9, "neither"
    return bool(smallest < 1e-13)


@pytest.mark.parametrize("seed", [*range(6), *slow(*range(6, 300))])
def test_of_random_chains_those_without_inertia_are_refused(seed: int) -> None:
    """Whatever the types of their joints: a massless slide below a free body, a massless ball on a ball."""
    try:
        mechanism = random_chain(seed)
    except dyn.MechanismError:  # of a body that carries nothing
        return
    if lacks_inertia(mechanism):
        for use in (forward_dynamics, dyn.inverse_mass_matrix, dyn.hamilton_equations):
            with pytest.raises(SingularMassMatrixError):
                use(mechanism)
    else:
        assert len(forward_dynamics(mechanism).outputs) == mechanism.system.n


@pytest.mark.parametrize("seed", [*range(6), *slow(*range(6, 300))])
def test_slides_in_more_directions_than_there_are_have_no_inertia(seed: int) -> None:
    """M is constant, so that its pivots are folded: rounding of constants is what is left of one that should be zero.

    Slides follow one another along axes in a line, a plane or in space; those that a mass ends are independent where
    they are no more than that has dimensions.
    """
    rng = np.random.default_rng(seed)
    count, dimensions = int(rng.integers(2, 8)), int(rng.integers(1, 4))
    span, unit = np.linalg.qr(rng.normal(size=(3, 3)))[0][:, :dimensions], 10.0 ** rng.uniform(-6.0, 6.0)
    bodies, since, regular = [], 0, True  # massless slides so far
    for i in range(count):
        heavy = i == count - 1 or rng.random() < 0.3
        joint = dyn.Joint("prismatic", span @ rng.normal(size=dimensions), rng.normal(size=3))
        mass = unit * 10.0 ** rng.uniform(-3.0, 3.0) if heavy else 0.0
        bodies.append(dyn.Body(f"b{i}", joint, f"b{i - 1}" if i else "world", mass))
        since += 1
        if heavy:
            regular, since = regular and since <= dimensions, 0
    if regular:
        assert len(forward_dynamics(dyn.Mechanism(bodies)).outputs) == count
    else:
        with pytest.raises(SingularMassMatrixError):
            forward_dynamics(dyn.Mechanism(bodies))


def test_a_speed_has_a_square_at_rest() -> None:
    fall = dyn.System(lambda q, qd, t: 0.5 * cg.hypot(qd[0], qd[1]) ** 2 - 9.81 * q[1], "x y")
    assert dyn.simulate(fall, [0.0, 0.0], [0.0, 0.0], 1.0).q[-1] == pytest.approx([0.0, -4.905])


@pytest.mark.parametrize("held", [False, True])
def test_a_force_that_overflows_is_no_singular_mass_matrix(held: bool) -> None:
    """At all states that are tried; the one of interest is another."""

    def steep(q: list[cg.Node], qd: list[cg.Node], t: cg.Node) -> cg.Node:
        inertia = 0.5 * (1.0 + q[0] ** 2) * qd[0] ** 2 + 0.5 * qd[1] ** 2 + 0.1 * qd[0] * qd[1] * cg.cos(q[1])
        return inertia - 1e-9 * cg.exp(1e9 * q[0]) - 1e-9 * cg.exp(1e9 * q[1])

    rows = {"constraints": lambda q, t: {"equal": q[0] - q[1]}} if held else {}
    steep_system = dyn.System(steep, ["x", "y"], **rows)
    at = dict.fromkeys(dyn.forward_dynamics(steep_system).input_names, 0.0)
    found = dyn.forward_dynamics(steep_system).evaluate(at)
    # M = [[1, 0.1], [0.1, 1]], and the force is 1 in both directions, down
    assert [found["qdd0"], found["qdd1"]] == pytest.approx([-1.0 / 1.1] * 2, rel=1e-14)

"""Random types of joints of a user's own, whose directions depend on their coordinates, in random trees.

Every graph of a mechanism is held against the same tree with a chain of joints of one axis in the place of such a
joint, against Lagrange's equations by differences of the energies, and against the dense equations of M and the bias.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from pytest import mark

import cgraph as cg
import dynamics as dyn
from dynamics.multibody.algebra import spatial
from dynamics.multibody.algebra.spatial import Triple
from dynamics.multibody.algebra.spatial_vectors import Twist
from dynamics.multibody.bodies.joint_coordinates import places
from dynamics.multibody.joints import TYPES, SpatialJoint
from tests.dynamics.mechanisms import Array, random_body, random_joint, random_state
from tests.slow import slow

ROUNDING = 1e-10  # of the largest of its kind, in some thousand sums; M is not well conditioned in every tree
THROUGH_STEP = 1e-6  # the same of what is divided by a step of 1e-3
ZERO, ONE = cg.constant(0.0), cg.constant(1.0)
PITCH = 0.3
Nodes = Sequence[cg.Node]


class Part(NamedTuple):
    """A hinge, a slide or a screw in the chain that a random joint is, at rest in the axes of the joint."""

    kind: str
    axis: Array  # (3,), of length 1
    place: Array  # (3,) [m]


class Random(SpatialJoint):
    """A chain of parts as one joint: q turns and moves the body by one after another, and qdot = G u, G constant."""

    kind = "random"

    def __init__(self, seed: int, *, mixed: bool) -> None:
        rng = np.random.default_rng((seed, mixed))
        count = int(rng.integers(2, 4))
        kinds = ["revolute", *rng.choice(["revolute", "prismatic", "screw"], count - 1)]
        axes = [axis / np.linalg.norm(axis) for axis in rng.normal(size=(count, 3))]
        points = [*(0.3 * rng.normal(size=(count - 1, 3))), np.zeros(3)]  # the last is at the body's origin
        self.parts = [Part(str(kind), axis, place) for kind, axis, place in zip(kinds, axes, points, strict=True)]
        self.coordinates = tuple([f"x{k}" for k in range(count)])
        self.velocities = tuple([f"w{k}" for k in range(count)]) if seed % 4 < 2 else self.coordinates
        self.units = tuple(["m" if part.kind == "prismatic" else "rad" for part in self.parts])
        self.velocity_units = tuple([f"{unit}/s" for unit in self.units])
        self.neutral, self.groups = (0.0,) * count, tuple(range(count))
        self.mixing = np.eye(count) + 0.3 * rng.normal(size=(count, count)) if mixed else np.eye(count)

    def _steps(self, q: Nodes) -> Iterator[tuple[list[list[cg.Node]], Triple, Part]]:
        """Of each part its turn, and from where the last one has its origin to where this one has, before the turn."""
        before = np.zeros(3)
        for x, part in zip(q, self.parts, strict=True):
            turn = [[ONE if i == j else ZERO for j in range(3)] for i in range(3)]
            if part.kind != "prismatic":
                across = np.cross(np.eye(3), part.axis)
                for i in range(3):
                    for j in range(3):
                        turn[i][j] = turn[i][j] + across[i, j] * cg.sin(x)
                        turn[i][j] = turn[i][j] + (across @ across)[i, j] * (1.0 - cg.cos(x))
            offset = spatial.constant(part.place - before)
            yield turn, spatial.plus(offset, spatial.scaled(_slide(part, x), spatial.constant(part.axis))), part
            before = part.place

    def rotation(self, q: Nodes) -> list[list[cg.Node]]:
        columns = [spatial.constant(axis) for axis in np.eye(3)]
        for turn, _, _ in reversed(list(self._steps(q))):
            columns = [spatial.rotate(turn, column) for column in columns]
        return [[columns[j][i] for j in range(3)] for i in range(3)]

    def translation(self, q: Nodes) -> Triple:
        point = spatial.STILL
        for turn, offset, _ in reversed(list(self._steps(q))):
            point = spatial.plus(offset, spatial.rotate(turn, point))
        return point

    def velocity(self, q: Nodes, u: Nodes) -> Twist:
        omega, velocity = spatial.STILL, spatial.STILL
        for (turn, offset, part), rate in zip(self._steps(q), self.rate(q, u), strict=True):
            velocity = spatial.plus(velocity, spatial.cross(omega, offset))
            axis = spatial.constant(part.axis)
            spin = ZERO if part.kind == "prismatic" else rate
            omega = spatial.plus(spatial.rotate_transpose(turn, omega), spatial.scaled(spin, axis))
            slide = spatial.scaled(_slide(part, rate), axis)
            velocity = spatial.plus(spatial.rotate_transpose(turn, velocity), slide)
        return Twist(omega, velocity)

    def rate(self, q: Nodes, u: Nodes) -> Nodes:
        return [sum([float(g) * x for g, x in zip(row, u, strict=True)], spatial.ZERO) for row in self.mixing]

    def placement(self, axis: Array, at: Array) -> tuple[Array, Array]:
        raise NotImplementedError

    def resists(self, mass: float, inertia: Array) -> bool:
        return mass > 0.0


def _slide(part: Part, x: cg.Node) -> cg.Node:
    return {"revolute": ZERO, "prismatic": x, "screw": PITCH * x}[part.kind]


class Twins(NamedTuple):
    """A tree with a random joint, and the same with a chain of massless bodies in its place.

    mixing: qd of the second is this times qd of the first.
    """

    model: dyn.Mechanism
    twin: dyn.Mechanism
    mixing: Array


def twins(seed: int, joint: Random) -> Twins:
    """joint: in `TYPES`. Two trees in three have no other joint of several freedoms."""
    rng = np.random.default_rng((seed, 1))
    count = int(rng.integers(2, 4))
    at, bodies, apart = int(rng.integers(count)), list[dyn.Body](), list[dyn.Body]()
    kinds = ["revolute", "prismatic", "screw"] + (["ball", "free", "free (body axes)", "universal"] * (seed % 3 == 0))
    armature = 0.0 if np.any(joint.mixing != np.eye(len(joint.parts))) else 0.2
    for i in range(count):
        parent, name = f"b{rng.integers(i)}" if i else "world", f"b{i}"
        if i != at:
            kind = str(rng.choice(kinds))
            none = ("stiffness", "spring_reference", "armature", *(["pitch"] if kind != "screw" else []))
            others = dict.fromkeys(none, 0.0) if kind not in ("revolute", "prismatic") else {}
            body = random_body(name, kind, parent, rng, joint=random_joint(kind, rng, **others))
            bodies.append(body)
            apart.append(body)
            continue
        placed: dict[str, Any] = {"position": 0.3 * rng.normal(size=3)}
        placed["orientation"] = spatial.from_quaternion(rng.normal(size=4))
        body = random_body(name, "random", parent, rng, joint=dyn.Joint("random", armature=armature, **placed))
        bodies.append(body)
        before, outer = np.zeros(3), parent
        for k, part in enumerate(joint.parts):
            position, last = part.place - before, k + 1 == len(joint.parts)
            if not k:
                position = placed["position"] + placed["orientation"] @ position
            pitch = PITCH if part.kind == "screw" else 0.0
            turned = {"orientation": placed["orientation"]} if not k else {}
            single = dyn.Joint(part.kind, part.axis, position, armature=armature, pitch=pitch, **turned)
            inner = name if last else f"{name}.{k}"
            own = {"mass": body.mass, "center": body.center, "inertia": body.inertia} if last else {}
            apart.append(dyn.Body(inner, single, outer, **own))
            before, outer = part.place, inner
    gravity = 5.0 * rng.normal(size=3)
    model, twin = dyn.Mechanism(bodies, gravity), dyn.Mechanism(apart, gravity)
    mixing = np.eye(model.system.n)
    place = {body.name: each.u for body, each in zip(model.moving, places(model.moving), strict=True)}[f"b{at}"]
    mixing[place, place] = joint.mixing
    return Twins(model, twin, mixing)


def _state(given: Twins, seed: int) -> tuple[dict[str, Array], dict[str, Array]]:
    """A state of the first as the graphs have it, and the same of the second."""
    q, qd, qdd, tau = random_state(given.model, seed)
    inverse = np.linalg.inv(given.mixing)
    first = {"q": q, "qd": qd, "qdd": qdd, "tau": tau, "p": tau}
    second = {"qd": given.mixing @ qd, "qdd": given.mixing @ qdd, "tau": inverse.T @ tau, "p": inverse.T @ tau}
    return first, first | second


def _values(graph: cg.Graph, state: dict[str, Array]) -> Array:
    named = {f"{name}{k}": float(x) for name, row in state.items() for k, x in enumerate(row)}
    if "dt" in graph.input_names:  # embedded: with the state before
        old = {"q": state["q"] - 1e-3 * state["qd"], "qd": state["qd"] - 1e-3 * state["qdd"]}
        named |= {f"{name}{k}_old": float(x) for name, row in old.items() for k, x in enumerate(row)} | {"dt": 1e-3}
    values = graph.evaluate({name: named[name] for name in graph.input_names})
    return np.array(list(values.values()), dtype=np.float64)


def _as_first(values: Array, given: Twins, kinds: str) -> Array:
    """Values of the second as those of the first, block by block.

    kinds: of rows, and behind | of columns: q coordinates, v velocities, f forces, 1 what both have alike.
    """
    system, found = given.model.system, []
    of = {"q": np.eye(system.nq), "v": np.linalg.inv(given.mixing), "f": given.mixing.T}

    def side(kinds: str) -> Array:
        parts = [of[kind].copy() for kind in kinds]
        return np.block([[part if part is row else np.zeros((len(row), len(part))) for part in parts] for row in parts])

    for block in kinds.split():
        rows, _, columns = block.partition("|")
        of["1"] = np.eye(len(values) // (system.n if columns else 1))
        left, right = side(rows), np.linalg.inv(side(columns)) if columns else np.eye(1)
        table, values = np.split(values, [len(left) * len(right)])
        found.append((left @ table.reshape(len(left), -1) @ right).ravel())
    return np.concatenate(found)


def _regressor(model: dyn.Mechanism) -> cg.Graph:
    """Columns of the bodies that both have."""
    graph, bodies = dyn.regressor(model), [body.name for body in model.moving]
    own = {name: node for name, node in graph.outputs.items() if "." not in bodies[int(name.split("_")[2]) // 10]}
    return cg.Graph(graph.inputs, own)


LAST: Callable[[dyn.Mechanism], str] = lambda model: model.bodies[-1].name  # noqa: E731 (a name for a short function)
AT = (0.3, -0.2, 0.1)
GRAPHS: dict[str, tuple[Callable[[dyn.Mechanism], cg.Graph], str]] = {
    "inverse dynamics": (dyn.inverse_dynamics, "f"),
    **{name: (lambda m, name=name: dyn.inverse_dynamics(m, name), "f") for name in dyn.FORMULATIONS},
    "forward dynamics": (dyn.forward_dynamics, "v"),
    "state equation": (dyn.state_equation, "q v"),
    "mass matrix": (dyn.mass_matrix, "f|v"),
    "inverse mass matrix": (dyn.inverse_mass_matrix, "v|f"),
    "bias": (dyn.bias, "f"),
    "gravity": (dyn.gravity_force, "f"),
    "coriolis": (dyn.coriolis, "f|v"),
    "momentum": (dyn.momentum, "f"),
    "momentum rate": (dyn.momentum_rate, "f"),
    "energy": (dyn.energy, "1"),
    "kinetic": (dyn.kinetic_energy, "1"),
    "potential": (dyn.potential_energy, "1"),
    "derivatives": (dyn.inverse_dynamics_derivatives, "f f|v f|v f|v"),
    "state space": (dyn.state_space, "vv|vv vv|f"),
    "state space of momenta": (lambda m: dyn.state_space(m, form="momentum"), "vf|vf vf|f"),
    "hamiltonian": (dyn.hamiltonian, "1"),
    "hamilton equations": (dyn.hamilton_equations, "q f"),
    "regressor": (_regressor, "f|1"),
    "center of mass": (dyn.center_of_mass, "1"),
    "its Jacobian": (dyn.center_of_mass_jacobian, "1|v"),
    "spatial momentum": (dyn.spatial_momentum, "1"),
    "momentum about the center": (lambda m: dyn.spatial_momentum(m, "center of mass"), "1"),
    "placement": (lambda m: dyn.frame_placement(m, LAST(m), AT), "1"),
    "velocity": (lambda m: dyn.frame_velocity(m, LAST(m), AT, "body"), "1"),
    "acceleration": (lambda m: dyn.frame_acceleration(m, LAST(m), AT), "1"),
    "bias acceleration": (lambda m: dyn.frame_bias_acceleration(m, LAST(m), AT), "1"),
    "jacobian": (lambda m: dyn.frame_jacobian(m, LAST(m), AT), "1|v"),
    "jacobian rate": (lambda m: dyn.frame_jacobian_rate(m, LAST(m), AT), "1|v"),
    "motion": (lambda m: m.motion(LAST(m), AT), "1"),
}
EMBEDDED = ("by_definition", "kinetic_only", "kinetic_only_exact")  # in the velocities of the coordinates alone


def _error(value: Array, reference: Array) -> float:
    scale = float(np.abs(reference).max())
    return float(np.abs(value - reference).max()) / scale if scale else float(np.abs(value).max())


FEW = (6, 17)
SEEDS = [*FEW, *slow(*[seed for seed in range(100) if seed not in FEW])]


@mark.parametrize("seed", SEEDS)
def test_every_graph_is_that_of_its_joints_of_one_axis(seed: int) -> None:
    joint = Random(seed, mixed=seed % 2 == 1)
    with patch.dict(TYPES, random=joint):
        compare(twins(seed, joint), seed)


def compare(given: Twins, seed: int) -> None:
    first, second = _state(given, seed + 7)
    worst: dict[str, float] = {}
    for name, (derive, kinds) in GRAPHS.items():
        if name in EMBEDDED and given.model.system.kinematics.quasi is not None:
            continue
        value = _values(derive(given.model), first)
        worst[name] = _error(value, _as_first(_values(derive(given.twin), second), given, kinds))
    both = zip(given[:2], (first, second), strict=True)
    torques = [dyn.Rows(model).inverse(*[s[k] for k in ("q", "qd", "qdd")]) for model, s in both]
    worst["by rows"] = _error(torques[0], _as_first(torques[1], given, "f"))
    wrong = {name: e for name, e in worst.items() if not e < (THROUGH_STEP if name in EMBEDDED else ROUNDING)}
    assert not wrong

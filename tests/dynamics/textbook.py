"""Textbook systems written from positions, as somebody would who differentiates them by the chain rule."""

from collections.abc import Callable, Sequence

import cgraph as cg
import dynamics as dyn
from cgraph import Node
from cgraph.extend import tangents

G = 9.81


def velocity(position: Sequence[Node], q: Sequence[Node], qd: Sequence[Node], t: Node) -> list[Node]:
    """dr/dt by the chain rule."""
    rates = tangents(dict(zip([*q, t], [*qd, cg.constant(1.0)], strict=True)), position)
    return [rates.get(x, cg.constant(0.0)) for x in position]


def kinetic(mass: float, position: Sequence[Node], q: Sequence[Node], qd: Sequence[Node], t: Node) -> Node:
    """m v^2 / 2."""
    v = velocity(position, q, qd, t)
    return 0.5 * mass * sum([part**2 for part in v[1:]], v[0] ** 2)


def points(
    masses: Sequence[float], places: Callable[..., list[list[Node]]], n: int, more: Callable[..., Node] | None = None
) -> dyn.System:
    """Point masses at places(q, t) in gravity along the last axis, with a potential."""

    def lagrangian(q, qd, t):
        at = places(q, t)
        terms = [kinetic(m, r, q, qd, t) - m * G * r[-1] for m, r in zip(masses, at, strict=True)]
        total = sum(terms[1:], terms[0])
        return total if more is None else total - more(q, t)

    return dyn.System(lagrangian, [f"x{i}" for i in range(n)])


s, c = cg.sin, cg.cos
W, R, L1, L2 = 2.3, 0.7, 1.1, 0.6


def top() -> dyn.System:
    """The heavy symmetric top in Euler angles, from the angular velocity in axes of the body."""
    a, b, weight = 0.3, 0.12, 1.4 * G * 0.25

    def lagrangian(q, qd, t):
        _, theta, psi = q
        wx = qd[0] * s(theta) * s(psi) + qd[1] * c(psi)
        wy = qd[0] * s(theta) * c(psi) - qd[1] * s(psi)
        wz = qd[0] * c(theta) + qd[2]
        return 0.5 * a * (wx**2 + wy**2) + 0.5 * b * wz**2 - weight * c(theta)

    return dyn.System(lagrangian, ["phi", "theta", "psi"])


def charge() -> dyn.System:
    """A charge in a constant magnetic field, in polar coordinates."""

    def lagrangian(q, qd, t):
        x = [q[0] * c(q[1]), q[0] * s(q[1])]
        v = velocity(x, q, qd, t)
        return 0.5 * (v[0] ** 2 + v[1] ** 2) + 0.5 * W * (x[0] * v[1] - x[1] * v[0])

    return dyn.System(lagrangian, ["r", "phi"])


def relativistic() -> dyn.System:
    """A relativistic planet in polar coordinates."""

    def lagrangian(q, qd, t):
        v = velocity([q[0] * c(q[1]), q[0] * s(q[1])], q, qd, t)
        return -4.0 * cg.sqrt(1.0 - (v[0] ** 2 + v[1] ** 2) / 4.0) + 1.0 / q[0]

    return dyn.System(lagrangian, ["r", "phi"])


TEXTBOOK: dict[str, Callable[[], dyn.System]] = {
    "pendulum": lambda: points([1.3], lambda q, t: [[R * s(q[0]), -R * c(q[0])]], 1),
    "hoop": lambda: points([1.3], lambda q, t: [[R * s(q[0]) * c(W * t), R * s(q[0]) * s(W * t), -R * c(q[0])]], 1),
    "spherical": lambda: points([1.3], lambda q, t: [[R * s(q[0]) * c(q[1]), R * s(q[0]) * s(q[1]), -R * c(q[0])]], 2),
    "elastic": lambda: points(
        [1.3], lambda q, t: [[q[0] * s(q[1]), -q[0] * c(q[1])]], 2, lambda q, t: 20.0 * (q[0] - R) ** 2
    ),
    "relative double": lambda: points(
        [1.3, 0.8],
        lambda q, t: [
            [L1 * s(q[0]), -L1 * c(q[0])],
            [L1 * s(q[0]) + L2 * s(q[0] + q[1]), -L1 * c(q[0]) - L2 * c(q[0] + q[1])],
        ],
        2,
    ),
    "absolute double": lambda: points(
        [1.3, 0.8],
        lambda q, t: [[L1 * s(q[0]), -L1 * c(q[0])], [L1 * s(q[0]) + L2 * s(q[1]), -L1 * c(q[0]) - L2 * c(q[1])]],
        2,
    ),
    "relative triple": lambda: points(
        [1.3, 0.8, 0.5],
        lambda q, t: [
            [L1 * s(q[0]), -L1 * c(q[0])],
            [L1 * s(q[0]) + L2 * s(q[0] + q[1]), -L1 * c(q[0]) - L2 * c(q[0] + q[1])],
            [
                L1 * s(q[0]) + L2 * s(q[0] + q[1]) + R * s(q[0] + q[1] + q[2]),
                -L1 * c(q[0]) - L2 * c(q[0] + q[1]) - R * c(q[0] + q[1] + q[2]),
            ],
        ],
        3,
    ),
    "cart pole": lambda: points(
        [2.0, 0.5], lambda q, t: [[q[0], cg.constant(0.0)], [q[0] + L1 * s(q[1]), -L1 * c(q[1])]], 2
    ),
    "moving pivot": lambda: points([1.3], lambda q, t: [[R * s(q[0]), 0.2 * c(W * t) - R * c(q[0])]], 1),
    "rotating pivot": lambda: points(
        [1.3], lambda q, t: [[0.4 * c(W * t) + R * s(q[0]), 0.4 * s(W * t) - R * c(q[0])]], 1
    ),
    "swinging Atwood": lambda: points(
        [1.3, 2.0], lambda q, t: [[q[0] * s(q[1]), -q[0] * c(q[1])], [cg.constant(0.0), q[0] - 3.0]], 2
    ),
    "rotating tube": lambda: points([1.3], lambda q, t: [[q[0] * c(W * t), q[0] * s(W * t), cg.constant(0.0)]], 1),
    "catenary": lambda: points([1.3], lambda q, t: [[q[0], cg.cosh(q[0])]], 1),
    "catenoid": lambda: points([1.3], lambda q, t: [[cg.cosh(q[0]) * c(q[1]), cg.cosh(q[0]) * s(q[1]), q[0]]], 2),
    "cycloid": lambda: points([1.3], lambda q, t: [[R * (q[0] - s(q[0])), R * (c(q[0]) - 1.0)]], 1),
    "cone": lambda: points([1.3], lambda q, t: [[0.6 * q[0] * c(q[1]), 0.6 * q[0] * s(q[1]), 0.8 * q[0]]], 2),
    "torus": lambda: points(
        [1.3], lambda q, t: [[(2.0 + R * c(q[0])) * c(q[1]), (2.0 + R * c(q[0])) * s(q[1]), R * s(q[0])]], 2
    ),
    "spherical coordinates": lambda: points(
        [1.3],
        lambda q, t: [[q[0] * s(q[1]) * c(q[2]), q[0] * s(q[1]) * s(q[2]), q[0] * c(q[1])]],
        3,
        lambda q, t: -1.0 / q[0],
    ),
    "wedge": lambda: points([2.0, 0.7], lambda q, t: [[q[0], cg.constant(0.0)], [q[0] + 0.8 * q[1], -0.6 * q[1]]], 2),
    "turning frame": lambda: points(
        [1.3], lambda q, t: [[q[0] * c(W * t) - q[1] * s(W * t), q[0] * s(W * t) + q[1] * c(W * t), q[2]]], 3
    ),
    "top": top,
    "charge": charge,
    "relativistic planet": relativistic,
}

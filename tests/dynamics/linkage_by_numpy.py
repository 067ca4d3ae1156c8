"""Where the parts of a linkage are, how fast, and how far its loops are open: plain NumPy, apart from the library."""

from typing import NamedTuple

import numpy as np

import dynamics as dyn
from tests.dynamics.models import Array


class Placed(NamedTuple):
    """A body's axes as columns, its origin, its spin and the speed of its origin."""

    axes: Array
    origin: Array
    spin: Array
    speed: Array


def turn(axis: Array, angle: float) -> Array:
    """Rodrigues' formula."""
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * across + (1.0 - np.cos(angle)) * across @ across


def placed(mechanism: dyn.Mechanism, q: Array, qd: Array) -> dict[str, Placed]:
    """All bodies, on revolute and prismatic joints."""
    found = {"world": Placed(np.eye(3), np.zeros(3), np.zeros(3), np.zeros(3))}
    for body, x, rate in zip(mechanism.bodies, q, qd, strict=True):
        on = found[body.parent]
        axis = np.asarray(body.joint.axis) / np.linalg.norm(body.joint.axis)
        axes, arm = on.axes @ np.asarray(body.joint.orientation), on.axes @ np.asarray(body.joint.position)
        along = axes @ axis
        if body.joint.kind == "prismatic":
            arm = arm + x * along
            speed = on.speed + np.cross(on.spin, arm) + rate * along
            found[body.name] = Placed(axes, on.origin + arm, on.spin, speed)
        else:
            speed = on.speed + np.cross(on.spin, arm)
            found[body.name] = Placed(axes @ turn(axis, x), on.origin + arm, on.spin + rate * along, speed)
    return found


def energies(mechanism: dyn.Mechanism, q: Array, qd: Array) -> tuple[float, float]:
    """The kinetic energy, of armatures, too, and that of weight."""
    kinetic = potential = 0.0
    parts = placed(mechanism, q, qd)
    for body, rate in zip(mechanism.bodies, qd, strict=True):
        part, given = parts[body.name], np.asarray(body.inertia)
        inertia = part.axes @ (np.diag(given) if given.shape == (3,) else given) @ part.axes.T
        arm = part.axes @ np.asarray(body.center)
        speed = part.speed + np.cross(part.spin, arm)
        kinetic += 0.5 * body.mass * speed @ speed + 0.5 * part.spin @ inertia @ part.spin
        kinetic += 0.5 * body.joint.armature * rate**2
        potential -= body.mass * np.asarray(mechanism.gravity) @ (part.origin + arm)
    return float(kinetic), float(potential)


def openness(mechanism: dyn.Mechanism, q: Array, length: float) -> float:
    """The largest gap of the loops, of a length or in rad."""
    parts, widest = placed(mechanism, q, 0.0 * q), 0.0
    for loop in mechanism.loops:
        one, other = parts[loop.body], parts[loop.to]
        ends = [part.origin + part.axes @ np.asarray(at) for part, at in ((one, loop.at), (other, loop.to_at))]
        gaps = [np.linalg.norm(ends[0] - ends[1]) / length]
        if loop.kind == "hinge":
            axes = [p.axes @ np.asarray(axis) for p, axis in ((one, loop.axis), (other, loop.to_axis))]
            gaps.append(np.linalg.norm(np.cross(*axes)) / np.linalg.norm(axes[0]) / np.linalg.norm(axes[1]))
        elif loop.kind == "weld":
            gaps.append(np.abs(one.axes - other.axes).max())
        widest = max(widest, *map(float, gaps))
    return widest

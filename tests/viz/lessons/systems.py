"""Systems for lessons: the scenes, and some to which a sentence made for an arm would not apply."""

import cgraph as cg
import dynamics as dyn


def atwood() -> dyn.System:
    """Two masses over a pulley: by definition nothing holds them, and rk4 is exact."""
    return dyn.System(lambda q, qd, t: 1.5 * qd[0] ** 2 + 9.81 * q[0], ["x"])


def hoop() -> dyn.System:
    """A bead on a hoop that turns: at rest on it, its energy depends on the place."""
    return dyn.System(
        lambda q, qd, t: 0.245 * (qd[0] ** 2 + 5.29 * cg.sin(q[0]) ** 2) + 6.867 * cg.cos(q[0]), ["angle"]
    )


def cart_pole() -> dyn.System:
    """A pole upside down on a cart, whose place is in no formula."""
    return dyn.System(
        lambda q, qd, t: (
            0.75 * qd[0] ** 2 + 0.5 * qd[0] * qd[1] * cg.cos(q[1]) + 0.25 * qd[1] ** 2 - 4.905 * cg.cos(q[1])
        ),
        ["cart", "pole"],
    )


def orbit() -> dyn.System:
    """A Lagrangian as somebody types it: a point about a center, by parameters."""
    return dyn.System(
        lambda q, qd, t, p: 0.5 * p["m"] * (qd[0] ** 2 + q[0] ** 2 * qd[1] ** 2) + p["k"] / q[0],
        ["r", "phi"],
        {"m": 1.0, "k": 2.0},
    )


def magnetic() -> dyn.System:
    """A charge in a magnetic field: p is not zero at rest."""
    return dyn.System(
        lambda q, qd, t: 0.5 * (qd[0] ** 2 + qd[1] ** 2) + q[0] * qd[1] - q[1] * qd[0] - 0.1 * q[0] ** 4, ["x", "y"]
    )


def driven() -> dyn.System:
    """A pendulum whose pivot shakes, with damping: L depends on time."""
    return dyn.System(
        lambda q, qd, t: 0.5 * qd[0] ** 2 + qd[0] * cg.cos(3.0 * t) * cg.cos(q[0]) + 9.81 * cg.cos(q[0]),
        ["angle"],
        damping=0.1,
    )


def block() -> dyn.System:
    """Nothing depends on where it is."""
    return dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2, ["x"])


def bead() -> dyn.scenes.Scene:
    """A bead on a rod that turns about a point, by a constraint, pushed as time goes on."""

    def energy(q, qd, t, p):
        return 0.5 * p["m"] * (qd[0] ** 2 + qd[1] ** 2) - 9.81 * p["m"] * q[1]

    system = dyn.System(
        energy,
        "x y",
        {"m": 2.0},
        forces=lambda q, qd, t: [cg.sin(t), 0.0],
        damping=0.1,
        constraints=lambda q, t: {"rod": q[0] ** 2 + q[1] ** 2 - 1.0},
    )
    return dyn.scenes.Scene("bead", "", system, (0.6, 0.8), (0.0, 0.0), 1.0)


def ball() -> dyn.Mechanism:
    """A body about a point, with a quaternion, and a name that is no HTML."""
    joint = dyn.Joint("ball", name="<b>top</b>")
    return dyn.Mechanism([dyn.Body("top", joint, mass=1.0, center=(0.1, 0.0, -0.5), inertia=(0.1, 0.1, 0.02))])


SYSTEMS = {each.__name__: each for each in (atwood, hoop, cart_pole, orbit, magnetic, driven, block, bead, ball)}

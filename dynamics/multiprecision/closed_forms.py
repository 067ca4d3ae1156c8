"""Motions known in closed form, to many digits by mpmath: functions of time, none of which integrates anything."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from cgraph._shared import install

from .solution import Reference, from_text

if TYPE_CHECKING:
    from mpmath import mpf
    from mpmath.ctx_mp import MPContext

DIGITS = 30  # of the texts; the stated error is 10^-DIGITS
GUARD = 40  # more digits in the arithmetic: a phase of 10^15 rad, or a modulus next to 1, costs some of them


def solution(times: Sequence[float], state: Callable[[MPContext, mpf], Sequence[mpf]], how: str) -> Reference:
    """state(mp, t): the state at time t, in mpmath numbers."""
    try:
        import mpmath
    except ImportError:
        raise ImportError(f"closed forms need mpmath: {install('reference')}") from None
    mp = mpmath.mp
    with mp.workdps(DIGITS + GUARD):
        rows = [[mpmath.nstr(mp.mpf(value), DIGITS + 6) for value in state(mp, mp.mpf(t))] for t in map(float, times)]
    return from_text(times, rows, 10.0**-DIGITS, f"closed form: {how}")


def exponential(times: Sequence[float], x: float, rate: float) -> Reference:
    """xdot = rate x from x. States (x)."""
    return solution(times, lambda mp, t: [x * mp.exp(rate * t)], "exponential")


def oscillator(
    times: Sequence[float], x: float, v: float, mass: float, stiffness: float, damping: float = 0.0
) -> Reference:
    """M xdd + damping xd + stiffness x = 0 from (x, v), for any damping but the critical one. States (x, v)."""

    def state(mp: MPContext, t: mpf) -> list[mpf]:
        decay = mp.mpf(damping) / (2 * mp.mpf(mass))
        root = mp.sqrt(mp.mpc(decay**2 - mp.mpf(stiffness) / mp.mpf(mass)))
        fast, slow = -decay - root, -decay + root
        b = (v - fast * x) / (slow - fast)
        a = x - b
        return [
            (a * mp.exp(fast * t) + b * mp.exp(slow * t)).real,
            (a * fast * mp.exp(fast * t) + b * slow * mp.exp(slow * t)).real,
        ]

    return solution(times, state, "damped oscillator by its two eigenvalues")


def free_fall(times: Sequence[float], q: Sequence[float], qd: Sequence[float], qdd: Sequence[float]) -> Reference:
    """Constant accelerations qdd from (q, qd). States (q, qd)."""

    def state(mp: MPContext, t: mpf) -> list[mpf]:
        x, v, a = ([mp.mpf(value) for value in row] for row in (q, qd, qdd))
        places = [p + s * t + b * t * t / 2 for p, s, b in zip(x, v, a, strict=True)]
        return [*places, *[s + b * t for s, b in zip(v, a, strict=True)]]

    return solution(times, state, "constant acceleration")


def kepler(times: Sequence[float], eccentricity: float, mu: float = 1.0) -> Reference:
    """An orbit about the origin, semi-major axis 1, from its pericentre (1 - e, 0). States (x, y, vx, vy).

    The start is `kepler_start`: its speed is rounded to float64, and the orbit is that of the rounded start.
    """
    x0, _, _, v0 = kepler_start(eccentricity, mu)

    def state(mp: MPContext, t: mpf) -> list[mpf]:
        r, v, g = mp.mpf(x0), mp.mpf(v0), mp.mpf(mu)
        a = 1 / (2 / r - v * v / g)
        e = 1 - r / a
        motion = mp.sqrt(g / a**3)
        mean = motion * t
        turns = mp.nint(mean / (2 * mp.pi))
        mean -= 2 * mp.pi * turns  # in [-pi, pi], where Newton's method from sign(M) pi converges for every e < 1
        anomaly = mp.pi * mp.sign(mean)
        for _ in range(200):
            step = (anomaly - e * mp.sin(anomaly) - mean) / (1 - e * mp.cos(anomaly))
            anomaly -= step
            if abs(step) < mp.mpf(10) ** -(DIGITS + GUARD // 2):
                break
        s, c, b = mp.sin(anomaly), mp.cos(anomaly), mp.sqrt(1 - e * e)
        rate = motion / (1 - e * c)
        return [a * (c - e), a * b * s, -a * s * rate, a * b * c * rate]

    return solution(times, state, "Kepler's equation by Newton's method")


def kepler_start(eccentricity: float, mu: float = 1.0) -> tuple[float, float, float, float]:
    """(x, y, vx, vy) at the pericentre of the orbit with semi-major axis 1."""
    return 1.0 - eccentricity, 0.0, 0.0, (mu * (1.0 + eccentricity) / (1.0 - eccentricity)) ** 0.5


def pendulum(times: Sequence[float], angle: float, stiffness: float) -> Reference:
    """qdd = -stiffness sin(q), let go at rest at any angle but a multiple of pi. States (q, qd).

    With q from the nearest hanging position, sin(q/2) = k sn(u), qd = 2 k w cn(u), u = K + w t, k = sin(q(0)/2),
    w^2 = stiffness.
    """

    def state(mp: MPContext, t: mpf) -> list[mpf]:
        w = mp.sqrt(mp.mpf(stiffness))
        hanging = 2 * mp.pi * mp.nint(mp.mpf(angle) / (2 * mp.pi))
        k = mp.sin((mp.mpf(angle) - hanging) / 2)
        u = mp.ellipk(k * k) + w * t
        sn, cn = mp.ellipfun("sn", u=u, m=k * k), mp.ellipfun("cn", u=u, m=k * k)
        return [hanging + 2 * mp.asin(k * sn), 2 * k * w * cn]

    return solution(times, state, "Jacobi elliptic functions")


def free_rigid_body(times: Sequence[float], inertia: Sequence[float], omega: Sequence[float]) -> Reference:
    """Euler's equations without torque, principal inertias in increasing order. States: angular velocity, body axes.

    Landau and Lifshitz, "Mechanics", section 37, from any start that is no permanent rotation and not on a separatrix.
    """
    return solution(times, lambda mp, t: Rotor(mp, inertia, omega).velocity(t), "Jacobi elliptic functions")


class Rotor:
    """A rigid body without torque from a start: w_a = first cn(u), w_1 = middle sn(u), w_c = last dn(u)."""

    def __init__(self, mp: MPContext, inertia: Sequence[float], omega: Sequence[float]) -> None:
        i, w = [mp.mpf(value) for value in inertia], [mp.mpf(value) for value in omega]
        energy = sum(a * b * b for a, b in zip(i, w, strict=True))  # twice
        square = sum((a * b) ** 2 for a, b in zip(i, w, strict=True))
        # With L^2 < 2 T I_2 the body turns about axis 1; the roles of axes 1 and 3 change then.
        a, c = (0, 2) if square > energy * i[1] else (2, 0)
        turn = mp.sign(w[c]) or 1
        self.first = mp.sqrt((energy * i[c] - square) / (i[a] * (i[c] - i[a])))
        self.middle = turn * mp.sqrt((energy * i[c] - square) / (i[1] * (i[c] - i[1])))
        self.last = turn * mp.sqrt((square - energy * i[a]) / (i[c] * (i[c] - i[a])))
        self.rate = mp.sqrt((i[c] - i[1]) * (square - energy * i[a]) / (i[0] * i[1] * i[2]))
        self.m = (i[1] - i[a]) * (energy * i[c] - square) / ((i[c] - i[1]) * (square - energy * i[a]))
        self.start = mp.ellipf(mp.atan2(w[1] / self.middle, w[a] / self.first), self.m)
        self.mp, self.inertia, self.energy, self.square, self.a, self.c = mp, i, energy, square, a, c

    def velocity(self, t: mpf) -> list[mpf]:
        """Angular velocity in the body's axes."""
        u = self.start + self.rate * t
        sn, cn, dn = (self.mp.ellipfun(name, u=u, m=self.m) for name in ("sn", "cn", "dn"))
        result = [self.mp.mpf(0)] * 3
        result[self.a], result[1], result[self.c] = self.first * cn, self.middle * sn, self.last * dn
        return result


def cyclotron(times: Sequence[float], start: Sequence[float], frequency: float) -> Reference:
    """A charge in a uniform field along z: (vx, vy)' = frequency (vy, -vx). States (x, y, vx, vy)."""

    def state(mp: MPContext, t: mpf) -> list[mpf]:
        x, y, u, v = (mp.mpf(value) for value in start)
        w = mp.mpf(frequency)
        s, c = mp.sin(w * t), mp.cos(w * t)
        return [x + (u * s + v * (1 - c)) / w, y + (v * s - u * (1 - c)) / w, u * c + v * s, v * c - u * s]

    return solution(times, state, "circles at the cyclotron frequency")


def cosine(times: Sequence[float]) -> Reference:
    """x = cos(t). States (x)."""
    return solution(times, lambda mp, t: [mp.cos(t)], "cosine")


def two_modes(times: Sequence[float], q: Sequence[float], stiffness: Sequence[float]) -> Reference:
    """(q0 + q1)'' = -stiffness_0 (q0 + q1) and q1'' = -stiffness_1 q1, from rest at q. States (q0, q1, qd0, qd1)."""

    def state(mp: MPContext, t: mpf) -> list[mpf]:
        w, v = (mp.sqrt(mp.mpf(value)) for value in stiffness)
        both, second = mp.mpf(q[0]) + mp.mpf(q[1]), mp.mpf(q[1])
        place, speed = second * mp.cos(v * t), -second * v * mp.sin(v * t)
        return [both * mp.cos(w * t) - place, place, -both * w * mp.sin(w * t) - speed, speed]

    return solution(times, state, "two modes of vibration")

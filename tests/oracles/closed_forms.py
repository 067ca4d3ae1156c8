"""Motions known in closed form, to 30 digits by mpmath: functions of time, none of which integrates anything."""

from collections.abc import Callable, Sequence
from typing import Any

import mpmath
from mpmath import mp, mpf

from dynamics.multiprecision.reference import Reference, from_text

DIGITS = 30  # of the texts; the stated error is 10^-DIGITS
GUARD = 40  # more digits in the arithmetic: a phase of 10^15 rad, or a modulus next to 1, costs some of them


def solution(times: Sequence[float], state: Callable[[mpf], Sequence[Any]]) -> Reference:
    """state(t): the state at time t."""
    with mp.workdps(DIGITS + GUARD):
        rows = [[mpmath.nstr(mpf(value), DIGITS + 6) for value in state(mpf(float(t)))] for t in times]
    return from_text(times, rows, 10.0**-DIGITS, "closed form")


def exponential(times: Sequence[float], x: float, rate: float) -> Reference:
    """xdot = rate x from x. States (x)."""
    return solution(times, lambda t: [x * mp.exp(rate * t)])


def cosine(times: Sequence[float]) -> Reference:
    """x = cos(t). States (x)."""
    return solution(times, lambda t: [mp.cos(t)])


def oscillator(times: Sequence[float], x: float, v: float, stiffness: float, damping: float = 0.0) -> Reference:
    """xdd + damping xd + stiffness x = 0 from (x, v), for any damping but the critical one. States (x, v)."""

    def state(t: mpf) -> list[mpf]:
        decay = mpf(damping) / 2
        root = mp.sqrt(mp.mpc(decay**2 - mpf(stiffness)))
        fast, slow = -decay - root, -decay + root
        b = (v - fast * x) / (slow - fast)
        parts = [((x - b) * mp.exp(fast * t), fast), (b * mp.exp(slow * t), slow)]
        return [sum(part.real for part, _ in parts), sum((part * rate).real for part, rate in parts)]

    return solution(times, state)


def free_fall(times: Sequence[float], q: float, qd: float, qdd: float) -> Reference:
    """A constant acceleration from (q, qd). States (q, qd)."""
    return solution(times, lambda t: [mpf(q) + mpf(qd) * t + mpf(qdd) * t * t / 2, mpf(qd) + mpf(qdd) * t])


def kepler(times: Sequence[float], start: Sequence[float]) -> Reference:
    """An orbit about the origin with mu = 1 from its pericentre (r, 0, 0, v). States (x, y, vx, vy)."""

    def state(t: mpf) -> list[mpf]:
        r, v = mpf(start[0]), mpf(start[3])
        a = 1 / (2 / r - v * v)
        e, motion = 1 - r / a, a ** mpf(-1.5)
        mean = motion * t
        mean -= 2 * mp.pi * mp.nint(mean / (2 * mp.pi))
        anomaly = mp.pi * mp.sign(mean)  # from which Newton's method converges for every e < 1
        for _ in range(60):
            anomaly -= (anomaly - e * mp.sin(anomaly) - mean) / (1 - e * mp.cos(anomaly))
        s, c, b = mp.sin(anomaly), mp.cos(anomaly), mp.sqrt(1 - e * e)
        rate = motion / (1 - e * c)
        return [a * (c - e), a * b * s, -a * s * rate, a * b * c * rate]

    return solution(times, state)


def pendulum(times: Sequence[float], angle: float, stiffness: float) -> Reference:
    """qdd = -stiffness sin(q), let go at rest at any angle but a multiple of pi. States (q, qd).

    With q from the nearest hanging position, sin(q/2) = k sn(u), qd = 2 k w cn(u), u = K + w t, k = sin(q(0)/2),
    w^2 = stiffness.
    """

    def state(t: mpf) -> list[mpf]:
        w = mp.sqrt(mpf(stiffness))
        hanging = 2 * mp.pi * mp.nint(mpf(angle) / (2 * mp.pi))
        k = mp.sin((mpf(angle) - hanging) / 2)
        u = mp.ellipk(k * k) + w * t
        sn, cn = mp.ellipfun("sn", u=u, m=k * k), mp.ellipfun("cn", u=u, m=k * k)
        return [hanging + 2 * mp.asin(k * sn), 2 * k * w * cn]

    return solution(times, state)


def free_rigid_body(times: Sequence[float], inertia: Sequence[float], omega: Sequence[float]) -> Reference:
    """Euler's equations without torque, principal inertias in increasing order. States: angular velocity, body axes.

    Landau and Lifshitz, "Mechanics", section 37, from any start that is no permanent rotation and not on a separatrix:
    w_a = first cn(u), w_1 = middle sn(u), w_c = last dn(u).
    """

    def state(t: mpf) -> list[mpf]:
        i, w = [mpf(value) for value in inertia], [mpf(value) for value in omega]
        energy = sum(a * b * b for a, b in zip(i, w, strict=True))  # twice
        square = sum((a * b) ** 2 for a, b in zip(i, w, strict=True))
        # With L^2 < 2 T I_2 the body turns about axis 1; the roles of axes 1 and 3 change then.
        a, c = (0, 2) if square > energy * i[1] else (2, 0)
        turn = mp.sign(w[c]) or 1
        first = mp.sqrt((energy * i[c] - square) / (i[a] * (i[c] - i[a])))
        middle = turn * mp.sqrt((energy * i[c] - square) / (i[1] * (i[c] - i[1])))
        last = turn * mp.sqrt((square - energy * i[a]) / (i[c] * (i[c] - i[a])))
        rate = mp.sqrt((i[c] - i[1]) * (square - energy * i[a]) / (i[0] * i[1] * i[2]))
        m = (i[1] - i[a]) * (energy * i[c] - square) / ((i[c] - i[1]) * (square - energy * i[a]))
        u = mp.ellipf(mp.atan2(w[1] / middle, w[a] / first), m) + rate * t
        sn, cn, dn = (mp.ellipfun(name, u=u, m=m) for name in ("sn", "cn", "dn"))
        found = {a: first * cn, 1: middle * sn, c: last * dn}
        return [found[axis] for axis in range(3)]

    return solution(times, state)


def cyclotron(times: Sequence[float], start: Sequence[float], frequency: float) -> Reference:
    """A charge in a uniform field along z: (vx, vy)' = frequency (vy, -vx). States (x, y, vx, vy)."""

    def state(t: mpf) -> list[mpf]:
        x, y, u, v = (mpf(value) for value in start)
        w = mpf(frequency)
        s, c = mp.sin(w * t), mp.cos(w * t)
        return [x + (u * s + v * (1 - c)) / w, y + (v * s - u * (1 - c)) / w, u * c + v * s, v * c - u * s]

    return solution(times, state)


def two_modes(times: Sequence[float], q: Sequence[float], stiffness: Sequence[float]) -> Reference:
    """(q0 + q1)'' = -stiffness_0 (q0 + q1) and q1'' = -stiffness_1 q1, from rest at q. States (q0, q1, qd0, qd1)."""

    def state(t: mpf) -> list[mpf]:
        w, v = (mp.sqrt(mpf(value)) for value in stiffness)
        both, second = mpf(q[0]) + mpf(q[1]), mpf(q[1])
        place, speed = second * mp.cos(v * t), -second * v * mp.sin(v * t)
        return [both * mp.cos(w * t) - place, place, -both * w * mp.sin(w * t) - speed, speed]

    return solution(times, state)

"""The free rotor with its orientation, by Jacobi's functions and an elliptic integral of the third kind."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from dynamics.multiprecision import Reference
from dynamics.multiprecision.closed_forms import Rotor, solution

if TYPE_CHECKING:
    from mpmath import mpf
    from mpmath.ctx_mp import MPContext


class TurningRotor(Rotor):
    """A rotor, and how it stands."""

    def frame(self, t: mpf) -> list[mpf]:
        """In the body's axes: those whose z is the angular momentum, and whose x leans towards axis c."""
        momentum = [i * w for i, w in zip(self.inertia, self.velocity(t), strict=True)]
        z = self.mp.matrix(momentum) / self.mp.sqrt(self.square)
        x = self.mp.matrix([int(k == self.c) - z[self.c] * z[k] for k in range(3)])
        x /= self.mp.norm(x)
        y = [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]]
        return [x, self.mp.matrix(y), z]

    def precession(self, t: mpf) -> mpf:
        """How far axis c has turned about L: the integral of L (2T - I_c w_c^2) / (L^2 - I_c^2 w_c^2) [rad]."""
        mp, moment = self.mp, self.inertia[self.c]
        across = self.square - (moment * self.last) ** 2  # L^2 - I_c^2 w_c^2 = across (1 - n sn^2)
        n = -((moment * self.last) ** 2) * self.m / across
        share = self._third(n, self.start + self.rate * t) - self._third(n, self.start)
        return mp.sqrt(self.square) / moment * (t + (self.energy * moment - self.square) / across * share / self.rate)

    def _third(self, n: mpf, u: mpf) -> mpf:
        """The integral of 1 / (1 - n sn^2) from 0 to u."""
        mp, m = self.mp, self.m
        turns = mp.nint(u / (2 * mp.ellipk(m)))
        v = u - 2 * turns * mp.ellipk(m)
        amplitude = mp.atan2(mp.ellipfun("sn", u=v, m=m), mp.ellipfun("cn", u=v, m=m))
        return 2 * turns * mp.ellippi(n, m) + mp.ellippi(n, amplitude, m)


def free_rotor(times: Sequence[float], inertia: Sequence[float], omega: Sequence[float]) -> Reference:
    """The same motion with the orientation. States: the body's axes, seen in those at t = 0, row by row; omega.

    The body turns about the axis of its angular momentum by an elliptic integral of the third kind, and stands against
    that axis as its angular velocity says (E. T. Whittaker, "Analytical Dynamics", section 69).
    """

    def state(mp: MPContext, t: mpf) -> list[mpf]:
        rotor = TurningRotor(mp, inertia, omega)
        first, here, angle = rotor.frame(mp.mpf(0)), rotor.frame(t), rotor.precession(t)
        s, c = mp.sin(angle), mp.cos(angle)
        turned = [first[0] * c + first[1] * s, first[1] * c - first[0] * s, first[2]]
        rotation = sum([a * b.T for a, b in zip(turned, here, strict=True)], mp.zeros(3, 3))
        return [*rotation, *rotor.velocity(t)]

    return solution(times, state, "Jacobi elliptic functions, and an integral of the third kind")

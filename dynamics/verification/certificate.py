"""The certificate of a model: equations among its graphs that hold whatever the model is, and agreement with peers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Graph
from cgraph._shared import Array, real_number, require_whole
from cgraph.extend import Builder, cotangents

from ..equations.constraints.constraint_rank import CLEAR
from ..equations.equations_of_motion import (
    bias,
    coriolis,
    energy,
    forward_dynamics,
    gravity_force,
    mass_matrix,
    require_quadratic,
)
from ..equations.formulations.formulations import inverse_dynamics
from ..equations.linearization.inverse_dynamics_derivatives import inverse_dynamics_derivatives
from ..equations.linearization.linearization import state_space
from ..equations.mass_matrix.singular_mass_matrix import balanced
from ..equations.states.evaluate import evaluate
from ..equations.torque_parts.torque_table import TorqueTable, torque_by_joint_motion, torque_by_link
from ..systems.kinematics import ONE, changes, gathered
from ..systems.model import Model, as_system
from ..systems.system import System
from . import peer_agreement as agreement
from .held_states import Held, new_rows, random_states
from .residual import DIFFERENCES, POSITIVE, Certificate, Residual, UnavailableError, rounded, worst

if TYPE_CHECKING:
    from ..io.load import Source


STEP = 1e-3  # of differences, in units of the coordinates
FORWARD = {0: -25.0, 1: 48.0, 2: -36.0, 3: 16.0, 4: -3.0}  # 12 times the weights of values a step apart
# On a state's own side of a kink or jump, such as a joint limit, differences are those of a smooth function.
STENCILS = ({-2: 1.0, -1: -8.0, 1: 8.0, 2: -1.0}, FORWARD, {-k: -weight for k, weight in FORWARD.items()})
OFF_KINKS = 8.0  # steps, beyond a stencil, away from states that constraints hold at the very kink of a limit
MOST_STATES = 1_000_000  # of a certificate, some of whose matrices are kept for all states


def certify(
    model: Model, states: int = 20, seed: int = 0, *, speed: float = 1.0, twin: Source | None = None
) -> Certificate:
    """Check the model's graphs against each other, against differences of L, and against MuJoCo and Pinocchio.

    With constraints the states meet them, and are no singular positions, where a row follows from the others: other
    states are drawn then. Where none is seen, slopes of accelerations are left out. The equations are those of the
    whole, J^T lambda in them, and of the rows. Inverse dynamics and tables are those of the system without.

    A peer that disagrees is asked again with one term taken out on both sides, then two; what restores the agreement is
    in the residual's note.

    Parameters
    ----------
    model : Model
        A system, a mechanism or a scene.
    states, seed : int
        How many random states, with q uniform in -pi .. pi, and the seed of their generator.
    speed : float
        Standard deviation of qd, qdd and tau, which are normal; with constraints, before qd is moved onto them.
    twin : str, path or MjModel, optional
        What MuJoCo compares with in place of the model's own translation: a path or text of MJCF or URDF, with the
        joints of the same names, or in the same order. Its contacts, limits and friction loss are left out, and those
        of its actuators that the model has not; the others have random inputs.

    Returns
    -------
    Certificate

    Raises
    ------
    ValueError
        For fewer than one state, a seed below 0, and a twin that cannot be read, has another number of coordinates, or
        stands beside a model that is not of rigid bodies.
    ConstraintError
        Where random states cannot be moved onto the constraints.
    SingularMassMatrixError
        For a coordinate or a motion without inertia. A mass matrix that is regular, but indefinite, is a residual that
        fails, and its note says so.
    ImportError
        For a twin without MuJoCo.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.certify(dyn.planar_arm([1.0, 0.8], [1.0, 0.5]), states=2).passed
    True
    """
    if require_whole("states", states, 1) > MOST_STATES:
        raise ValueError(f"states must be at most {MOST_STATES}, got {states}")
    require_whole("seed", seed)
    if not math.isfinite(real_number("speed", speed)):
        raise ValueError(f"speed must be finite, got {speed!r}")
    theirs = None if twin is None else agreement.original(twin, model)
    rng = np.random.default_rng(seed)
    system, t = as_system(model), float(rng.uniform())
    at = random_states(system, states, t, speed, rng)
    residuals, left_out = _among_graphs(_Checks(system, at, t, rng))
    for name, peer in agreement.peers(model, theirs):
        try:
            residuals.append(agreement.residual(name, peer(), at))
        except UnavailableError as error:
            left_out.append(str(error) if str(error).startswith(name) else f"{name}: {error}")
    if len(system.constraints):
        held, said = agreement.with_loops(model, at)
        residuals, left_out = [*residuals, *held], [*left_out, *said]
    return Certificate(states, seed, tuple(residuals), tuple(left_out))


def _among_graphs(checks: _Checks) -> tuple[list[Residual], list[str]]:
    """The residuals among the model's graphs, and what says nothing of it."""
    residuals, left_out = list(checks.always()), []
    if doubtful := np.count_nonzero(checks.new_rows < CLEAR):
        left_out.append(
            f"slopes of accelerations: at {doubtful} of {len(checks.new_rows)} states a constraint says nothing, or "
            "next to nothing, that the others do not say, and accelerations are not determined"
        )
    if not checks.moves:
        left_out.append("M and the Coriolis matrix on motions: the constraints admit none")
    try:
        require_quadratic(checks.system)
    except ValueError as error:
        return residuals, [*left_out, f"the Coriolis matrix: {error}"]
    return [*residuals, *checks.of_coriolis()], left_out


class _Checks:
    """The equations at some states."""

    def __init__(self, system: System, at: dict[str, Array], t: float, rng: np.random.Generator) -> None:
        self.system, self.at, self.t, self.rng = system, at, t, rng
        self.timed = system.t in system.extra_inputs
        self.held, n = Held(system, self.value), system.n
        self.new_rows = np.array([new_rows(system, q, t) for q in at["q"]])
        self.inverse, self.inertia = inverse_dynamics(system), self.matrix(mass_matrix(system))
        # |M| times the largest velocity, (N, n, n): size of the terms of dM/dt, which cancel where M is constant
        self.rate_terms = np.abs(self.inertia) * np.abs(at["qd"]).max(axis=1)[:, None, None]
        self.admitted = self.held.admitted(self.inertia)  # M of the motions that constraints admit
        self.moves = bool(self.admitted.shape[-1])
        rows = zip(system.forces, system.braking(Builder()), strict=True)
        self.pushed = self.value(self.graph({f"f{i}": force - brake for i, (force, brake) in enumerate(rows)}))
        self.bias = self.value(bias(system))
        self.accelerations, multipliers = np.split(self.value(forward_dynamics(system)), [n], axis=1)
        # size of the terms of M qdd + bias
        self.driven = (np.abs(self.inertia) @ np.abs(self.accelerations)[..., None])[..., 0] + np.abs(self.bias)
        self.held_by = self.held.matrix * multipliers[:, None]  # forces of the constraints, one by one, (N, n, m)

    def value(self, graph: Graph, **other: ArrayLike | None) -> Array:
        """Outputs, (N, n_out), at the states, some of them replaced."""
        return evaluate(self.system, graph, {**self.at, **other}, self.t)

    def matrix(self, graph: Graph) -> Array:
        """Outputs as (N, n, n)."""
        return self.value(graph).reshape(-1, self.system.n, self.system.n)

    def graph(self, outputs: dict[str, cg.Node]) -> Graph:
        return self.system.graph(outputs, self.system.q, self.system.qd, self.system.qdd)

    def rate(self, graph: Graph) -> Graph:
        """d/dt of the outputs along (qd, qdd)."""
        system = self.system
        x_dot = dict(zip([*system.q, *system.qd], [*system.q_dot, *system.qdd], strict=True))
        rates = changes(x_dot | ({system.t: ONE} if self.timed else {}), graph.outputs.values())
        return self.graph(dict(zip(graph.outputs, rates, strict=True)))

    def always(self) -> Iterator[Residual]:
        """Residuals of every Lagrangian."""
        yield from self._mass_matrix()
        # Bodies state their bias by Newton and Euler; the chain rule asks nothing but the Lagrangian.
        still, pushed = self.value(inverse_dynamics(self.system, "chain_rule"), qdd=None), self.pushed
        equation = "bias = inverse dynamics at qdd = 0, without damping and forces"
        terms = (self.rate_terms @ np.abs(self.at["qd"])[..., None])[..., 0] + np.abs(still) + np.abs(pushed)
        yield rounded(equation, self.bias - still - pushed, terms)
        yield self._forward()
        yield self._power()
        yield self._energy()
        yield self._sum("links: partial torques add up to tau", torque_by_link(self.system))
        yield self._adjoint()
        yield from self._derivatives()
        graphs = {"L": self.graph({"L": self.system.lagrangian}), "tau": self.inverse}
        if self.held.any:
            yield self.held.closed(self.accelerations, self.inertia, np.abs(self.held_by).sum(axis=-1))
            constraints = self.system.constraints
            rows = enumerate([*constraints.positions, *constraints.rates])
            graphs["the constraints and their rates"] = self.graph({f"{k}": row for k, row in rows})
        for name, graph in graphs.items():
            yield self._differences(f"AD: slope of {name} along a line = differences", graph)

    def of_coriolis(self) -> Iterator[Residual]:
        """Residuals of a Lagrangian that is quadratic in the velocities."""
        matrix = self.matrix(coriolis(self.system))
        qd = self.at["qd"]
        terms = (np.abs(matrix) + self.rate_terms) @ np.abs(qd)[..., None]
        force, gravity = (matrix @ qd[..., None])[..., 0], self.value(gravity_force(self.system))
        off, size = force + gravity - self.bias, terms[..., 0] + np.abs(gravity)
        yield rounded("coriolis: C qd + gravity = bias", off, size)
        if self.moves and not self.timed:
            rate = self.matrix(self.rate(mass_matrix(self.system)))
            skew, terms = rate - 2.0 * matrix, np.abs(rate) + np.abs(matrix) + self.rate_terms
            yield rounded("coriolis: dM/dt - 2 C is skew", skew + np.swapaxes(skew, 1, 2), terms)
        yield self._sum("motion: torques by motion add up to tau", torque_by_joint_motion(self.system))

    def _mass_matrix(self) -> Iterator[Residual]:
        n = self.system.n
        still = self.value(self.inverse, qdd=None)
        columns = np.stack([self.value(self.inverse, qdd=unit) - still for unit in np.eye(n)], axis=-1)
        terms = np.abs(columns) + np.abs(still)[..., None]
        yield rounded("M: symmetric, as columns of inverse dynamics", columns - np.swapaxes(columns, 1, 2), terms)
        yield rounded("M: d2L/dqd2 = columns of inverse dynamics", columns - self.inertia, terms)
        if not self.moves:
            return
        sizes = np.linalg.eigvalsh(balanced(self.admitted))
        smallest, rounding = float(sizes.min()), n * np.finfo(float).eps
        kind = "regular, but indefinite, " if smallest < 0.0 < sizes.max() else "negative, " if smallest < 0.0 else ""
        if np.abs(sizes).min() <= rounding:
            kind = "singular, "
        note = f"{kind}smallest eigenvalue {smallest:.1e}, scaled"
        equation = "M: positive definite" + " on motions that the constraints admit" * self.held.any
        yield Residual(equation, max(0.0, rounding - smallest), POSITIVE, note)

    def _forward(self) -> Residual:
        tau, qdd = self.at["tau"], self.accelerations
        terms = self.driven + np.abs(tau)
        equation = "inverse dynamics of forward dynamics = tau" + " + J^T lambda" * self.held.any
        held, terms = self.held_by.sum(axis=-1), terms + np.abs(self.held_by).sum(axis=-1)
        return rounded(equation, self.value(self.inverse, qdd=qdd) - tau - held, terms)

    def _power(self) -> Residual:
        system, qd, tau, qdd = self.system, self.at["qd"], self.at["tau"], self.accelerations
        gained = self.value(self.rate(energy(system)), qdd=qdd)[..., 0]
        forces, held = self.pushed, self.held_by.sum(axis=-1)
        power = np.concatenate([qd * (tau + forces), qd * held], axis=-1)
        equation = "energy: dE/dt = qd . (tau + forces - damping" + " + J^T lambda" * self.held.any + ")"
        if self.timed:
            (slope,) = cotangents({system.lagrangian: ONE}, [system.t])
            power = np.concatenate([power, -self.value(self.graph({"dL/dt": slope}))], axis=-1)
            equation += " - dL/dt"
        terms = np.abs(qd) * (np.abs(self.held_by).sum(axis=-1) + self.driven)
        total = np.abs(power).sum(axis=-1) + terms.sum(axis=-1)
        return rounded(equation, (gained - power.sum(axis=-1))[:, None], total[:, None])

    def _energy(self) -> Residual:
        qd = self.at["qd"]
        slopes = self.value(cg.gradient(energy(self.system), self.system.qd))
        momenta = self.inertia @ qd[..., None]
        terms = np.abs(self.inertia) @ np.abs(qd)[..., None]
        return rounded("energy: dE/dqd = M qd", slopes - momenta[..., 0], terms[..., 0])

    def _sum(self, equation: str, table: TorqueTable) -> Residual:
        cells = self.value(table.graph).reshape(-1, len(table.rows), len(table.columns))
        axis = 1 + table.sum_axis
        return rounded(equation, cells.sum(axis=axis) - self.value(self.inverse), np.abs(cells).sum(axis=axis))

    def _adjoint(self) -> Residual:
        """u . (J v) by forward mode and (J^T u) . v by reverse mode, J = d tau / d(q, qd, qdd)."""
        system = self.system
        state = [*system.q, *system.qd, *system.qdd]
        u, v = self.rng.normal(size=system.n), self.rng.normal(size=len(state))
        torques = list(self.inverse.outputs.values())
        given, taken = ([cg.constant(float(each)) for each in numbers] for numbers in (v, u))
        dots = changes(dict(zip(state, given, strict=True)), torques)
        bars = cotangents(gathered(zip(torques, taken, strict=True)), state, Builder())
        pushed, pulled = (self.value(self.graph({str(i): x for i, x in enumerate(nodes)})) for nodes in (dots, bars))
        terms = np.abs(pushed * u).sum(axis=-1) + np.abs(pulled * v).sum(axis=-1)
        return rounded("AD: u . (J v) = (J^T u) . v for tau", (pushed @ u - pulled @ v)[:, None], terms[:, None])

    def _differences(self, equation: str, graph: Graph) -> Residual:
        """Catches what no comparison of derivatives with derivatives can: a rule of differentiation that is wrong."""
        system = self.system
        sizes = {"q": system.nq, "qd": system.n, "qdd": system.n}
        line = {name: self.rng.normal(size=size) for name, size in sizes.items()}
        given = [cg.constant(float(each)) for part in line.values() for each in part]
        dots = changes(dict(zip([*system.q, *system.qd, *system.qdd], given, strict=True)), graph.outputs.values())

        def near(steps: float) -> dict[str, Array]:
            far = STEP * (steps + OFF_KINKS * self.held.any)
            return {name: self.at[name] + far * part for name, part in line.items()}

        moved = {k / 2: self.value(graph, **near(k / 2)) for k in range(-8, 9)}
        slope = self.value(self.graph(dict(zip(graph.outputs, dots, strict=True))), **near(0.0))

        def differences(stencil: Mapping[int, float], step: float) -> Array:
            total: Array = np.sum([weight * moved[k * step] for k, weight in stencil.items()], axis=0)
            return total / (12.0 * step * STEP)

        misses = []
        for stencil in STENCILS:
            wide, narrow = (differences(stencil, step) for step in (1.0, 0.5))
            misses.append(np.maximum(np.abs(slope - narrow) - np.abs(wide - narrow), 0.0))
        unexplained = np.min(misses, axis=0)
        scale = np.abs(slope) + np.max([np.abs(moved[k]) for k in (-2.0, -1.0, -0.5, 0.5, 1.0, 2.0)], axis=0)
        return Residual(equation, worst(unexplained, scale), DIFFERENCES)

    def _derivatives(self) -> Iterator[Residual]:
        """Residuals of the derivatives of torques, and of accelerations times M, how far these miss their equation.

        Multipliers of rows of which a share s is new are rounded by 1 / s, and slopes that have them by 1 / s^2. Slopes
        of accelerations are not determined where s is not clear.
        """
        system, inertia, new_rows = self.system, self.inertia, self.new_rows
        n = system.n
        line = self.rng.normal(size=4 * n)  # dxi, dqd, dqdd and dtau
        xi, v, a, f = ([cg.constant(float(x)) for x in part] for part in np.split(line, 4))
        seeds = dict(zip([*system.q, *system.qd], [*system.kinematics.rate(xi), *v], strict=True))

        def along(graph: Graph, more: dict[cg.Node, cg.Node]) -> Array:
            """The first n outputs' slopes."""
            slopes = changes(seeds | more, list(graph.outputs.values())[:n])
            outputs = dict(zip(graph.outputs, slopes, strict=False))
            return self.value(system.graph(outputs, system.q, system.qd, list(more)))

        pushed = along(self.inverse, dict(zip(system.qdd, a, strict=True)))
        entries = self.value(inverse_dynamics_derivatives(system))[:, n:].reshape(-1, 3, n, n)
        terms = np.swapaxes(entries, 1, 2).reshape(-1, n, 3 * n) * line[: 3 * n]
        equation = "derivatives: dtau/dq, dtau/dqd and M along a line = AD of inverse dynamics"
        yield rounded(equation, terms.sum(axis=-1) - pushed, np.abs(terms).sum(axis=-1))
        clear = new_rows >= CLEAR
        if not clear.any():
            return
        slopes = np.abs(terms[..., : 2 * n]).sum(axis=-1) + np.abs(line[3 * n :])  # of forces that constraints take up
        pushed = along(forward_dynamics(system), dict(zip(system.tau, f, strict=True)))
        matrices = self.value(state_space(system))
        a_entries, b_entries = np.split(matrices, [4 * n * n], axis=1)
        a_and_b = [a_entries.reshape(-1, 2 * n, 2 * n), b_entries.reshape(-1, 2 * n, n)]
        terms = np.concatenate(a_and_b, axis=-1)[:, n:] * np.delete(line, np.s_[2 * n : 3 * n])
        missed = (inertia @ (terms.sum(axis=-1) - pushed)[..., None])[..., 0]
        sizes = (np.abs(inertia) @ np.abs(terms).sum(axis=-1)[..., None])[..., 0] + slopes
        sizes = sizes[clear] / new_rows[clear, None] ** 2
        yield rounded(
            "derivatives: A and B of the linearization along a line = AD of forward dynamics", missed[clear], sizes
        )

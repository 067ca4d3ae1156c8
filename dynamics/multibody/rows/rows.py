"""Rows: equations of motion of a robot as loops over a table of its bodies, ready at once and after every change."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

import cgraph as cg
from cgraph import Compiled
from cgraph._shared import Array, cache_choice, kept_by_first, memo, real_array, require_kind, thread_count, write_batch
from cgraph.extend import Builder, Runner, Statement, program_vjp, runner

from ...equations.linearization.inverse_dynamics_derivatives import state_slopes
from ...systems.kinematics import Kinematics, numbered_graph
from ...systems.model import Model
from ...systems.system import System
from ..bodies.body import Body, MechanismError
from ..bodies.joint_coordinates import coordinate_names, quasi_velocities, velocity_names
from ..joints import TYPES, JointType
from ..sweeps.links import motion_axes
from ..trees.mechanism import Mechanism, require_mechanism
from ..trees.structure import Subtree
from . import passes
from .blocks import FREEDOM, MOST, STRIDE, WIDE
from .passes import Joints
from .table import FIXED, Table, table_of

LEAST = 16  # rows and coordinates that there is room for, at least


class Quantity(NamedTuple):
    """A quantity that rows give: its statements, and the register that it is in."""

    statements: Callable[[Joints, bool], list[Statement]]
    result: str


QUANTITIES = {
    "inverse": Quantity(passes.inverse, "tau"),
    "forward": Quantity(passes.forward, "a"),
    "slopes": Quantity(passes.slopes, "slopes"),
    "frames": Quantity(passes.frames, "place"),
    "energies": Quantity(passes.energies, "energy"),
}


Columns = Callable[[Array, Array], None]


class Bound(NamedTuple):
    """A quantity on memory of its own, which holds a table."""

    table: Table
    run: Runner
    x: Array
    registers: dict[str, Array]
    call: Callable[[], None]
    result: Array
    inputs: tuple[Array, ...]  # coordinates, velocities, and accelerations or torques, in x


class Rows:
    """A robot as a table with a row for each body: dynamics at once, also after a change of its structure.

    Nothing is derived or compiled for a robot: there is a kernel for each kind of joint, and a loop over the rows. A
    graph, such as `cg.compile(dyn.inverse_dynamics(model))`, knows the numbers of all bodies and is quicker to call up
    to some tens of bodies.

    Parameters
    ----------
    model : Mechanism, or a scene of one
        Of parameters it takes the values. Accelerations are those of a tree without loops.
    cache : bool or path, optional
        Keep the machine code of kernels on disk for the next process, as of `cg.compile`: it serves all robots.

    Attributes
    ----------
    n, nq : int
        How many velocities and coordinates there are; their names are `velocities` and `coordinates`.

    Raises
    ------
    MechanismError
        For a model without bodies.

    Examples
    --------
    >>> import dynamics as dyn
    >>> arm = dyn.Rows(dyn.planar_arm([1.0], [1.0], gravity=10.0))
    >>> arm.inverse([0.0], [0.0], [3.0]).round(12).tolist()
    [1.0]
    >>> arm.attach(dyn.Body("load", dyn.Joint("fixed"), mass=2.0, center=(0.0, 0.0, -1.0)), to="link 1")
    >>> arm.inverse([0.0], [0.0], [3.0]).round(12).tolist()
    [7.0]
    """

    ode, parameters = None, MappingProxyType[str, float]({})  # as of a `Model`

    def __init__(self, model: Model, *, cache: bool | str = False) -> None:
        self._cache, self._capacity, self._bound = cache_choice(cache), 0, dict[str, Bound]()
        self._kinds: dict[str, int] = {}  # of the joints so far, in the order of their kernels
        self._columns = dict[str, tuple[Table, int, Columns]]()
        self._set(table_of(require_mechanism(model, "Rows").bind()))

    def _set(self, table: Table) -> None:
        """Take another table; what is bound takes it over when it is called."""
        self._table, (self._q_at, self._u_at) = table, table.places()
        self.nq, self.n = self._q_at[-1], self._u_at[-1]
        need = max(len(table.bodies), self.nq)
        if need > self._capacity:  # a power of two, for robots of about one size to have one code, with room to grow
            self._capacity = max(LEAST, 1 << (3 * need // 2).bit_length())
        if not self._kinds.keys() >= (kinds := {FIXED.kind, *[kind.kind for kind in table.types]}):
            self._kinds = {kind: k for k, kind in enumerate(sorted({*self._kinds, *kinds}))}

    def __repr__(self) -> str:
        return f"<Rows of {len(self._table.bodies)} bodies, {self.nq} coordinate(s)>"

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism of these rows."""
        return self._table.mechanism

    @property
    def system(self) -> System:
        """The Lagrangian system of the mechanism, whose motions are stepped by rows."""
        system = self.mechanism.bind().system
        if system.coordinates != self.coordinates or system.body_terms is None:
            raise MechanismError("coordinates stand otherwise than in rows.mechanism: move Rows(rows.mechanism)")
        terms = replace(system.body_terms, bodies=self._table, linearized=self._linearized)
        return system.changed(body_terms=terms, extra_inputs=system.extra_inputs)

    def _linearized(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike) -> tuple[Array, Array]:
        """A and B, see `linearize`."""
        n, kinematics, turned = self.n, self.mechanism.system.kinematics, np.zeros((self.n, self.n))
        by_q, by_qd, by_tau = self.forward_derivatives(q, qd, np.broadcast_to(tau, n))
        if kinematics.quasi is not None:
            brackets = numbered_graph(kinematics.u, [each for row in kinematics.brackets(Builder()) for each in row])
            turned[:] = cg.compile(brackets, "python")(qd).reshape(n, n)
        return np.block([[turned, np.eye(n)], [by_q, by_qd]]), np.vstack([np.zeros((n, n)), by_tau])

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return coordinate_names(self._table.moving)

    @property
    def velocities(self) -> tuple[str, ...]:
        """Names of the velocities."""
        return velocity_names(self._table.moving)

    def inverse(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, *, threads: int | None = 1) -> Array:
        """Torques of a motion, by the recursive Newton-Euler equations.

        Parameters
        ----------
        q : array_like, (nq,) or (N, nq)
            Coordinates, or those of N states [rad or m].
        qd, qdd : array_like, (n,) or (N, n)
            Velocities and accelerations.
        threads : int or None, optional
            How many may share N states, as of `Compiled.batch`.

        Returns
        -------
        ndarray, (n,) or (N, n)
            tau [N m or N]; applied forces of the model are taken off.

        Raises
        ------
        ValueError
            For another shape.

        Examples
        --------
        >>> import dynamics as dyn
        >>> dyn.Rows(dyn.tree([-1, 0])).inverse([[0.0, 0.0]] * 3, [[0.0, 0.0]] * 3, [[0.0, 0.0]] * 3).shape
        (3, 2)
        """
        tau = self._at("inverse", {"q": q, "qd": qd, "qdd": qdd}, threads)[..., : self.n]
        return tau if self._forces is None else tau - self._applied(q, qd)

    def forward(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, *, threads: int | None = 1) -> Array:
        """Accelerations, by articulated inertias: qdd (n,) or (N, n) [rad/s^2 or m/s^2]; see `inverse`.

        Raises MechanismError where loops close chains: use `forward_dynamics` of the mechanism.
        """
        self._require_tree("accelerations")
        if self._forces is not None:
            tau = real_array("tau", tau) + self._applied(q, qd)
        return self._at("forward", {"q": q, "qd": qd, "tau": tau}, threads)[..., : self.n]

    def inverse_derivatives(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> tuple[Array, Array, Array]:
        """dtau/dq, dtau/dqd and M = dtau/dqdd, each (n, n) or (N, n, n), see `inverse_dynamics_derivatives`.

        Raises MechanismError for gravity compensation, and for joints whose directions change in the body's axes.
        """
        turning = [kind.kind for kind in self._table.types if not kind.turns_with_body]
        unknown = f"changing directions, as of joints of the kind {turning[0]!r}" if turning else ""
        unknown = "gravity compensation" if self._table.numbers[:, 27:].any() else unknown
        if unknown:
            raise MechanismError(f"derivatives by rows know no {unknown}: use inverse_dynamics_derivatives")
        by_q, by_qd, mass = self._slopes(q, qd, qdd)
        if self._forces is not None:
            n, slopes = self.n, self._applied(q, qd, slopes=True).reshape(*mass.shape[:-1], 2 * self.n)
            by_q, by_qd = by_q - slopes[..., :n], by_qd - slopes[..., n:]
        return by_q, by_qd, mass

    def _slopes(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Array:
        n = self.n
        entries = self._at("slopes", {"q": q, "qd": qd, "qdd": qdd})[..., : 3 * n * n]
        return np.moveaxis(entries.reshape(*entries.shape[:-1], n, n, 3), -1, 0)

    def forward_derivatives(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike) -> tuple[Array, Array, Array]:
        """dqdd/dq, dqdd/dqd and dqdd/dtau, the inverse of M, each (n, n) or (N, n, n); by displacements as dtau/dq."""
        by_q, by_qd, mass = self.inverse_derivatives(q, qd, self.forward(q, qd, tau))
        ones = np.broadcast_to(np.eye(self.n), mass.shape)
        found = np.linalg.solve(mass, np.concatenate([-by_q, -by_qd, ones], axis=-1))
        return found[..., : self.n], found[..., self.n : 2 * self.n], found[..., 2 * self.n :]

    def inertial_gradient(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, tau_bar: ArrayLike) -> Array:
        """Slopes of tau_bar . tau by the inertial parameters of every body: Y^T tau_bar of `regressor`, without Y.

        By the transposed loops, in a time that grows as the number of bodies. Of N states it is the sum.

        Parameters
        ----------
        q, qd, qdd : array_like
            As of `inverse`.
        tau_bar : array_like, (n,) or (N, n)
            Weights of the torques.

        Returns
        -------
        ndarray, (bodies, 10)
            In the order of `bodies`, and of `inertial_parameters`: mass, first moment and inertia about the joint.

        Raises
        ------
        ValueError
            For another shape.

        Examples
        --------
        >>> import dynamics as dyn
        >>> arm = dyn.Rows(dyn.planar_arm([1.0], [1.0], gravity=10.0))
        >>> arm.inertial_gradient([0.0], [0.0], [3.0], [1.0])[0, [0, 6]].round(12).tolist()
        [0.0, 3.0]
        """
        self.inverse(q, qd, qdd)  # which looks at them
        states = [np.atleast_2d(real_array("state", each)) for each in (q, qd, qdd)]
        seeds, n, capacity = np.atleast_2d(real_array("tau_bar", tau_bar)), self.n, self._capacity
        if seeds.shape != (len(states[0]), n):
            raise ValueError(f"tau_bar must have shape ({n},) or (N, {n}), a weight each, got {np.shape(tau_bar)}")
        run = self._runner("inverse")
        values = {name: np.zeros(length) for name, length in run.program.registers.items() if name != "tau"}
        contents = self._contents(world=True, pairs=False, places=(0, capacity, 2 * capacity))
        for name, numbers in contents.items():
            if name in values:
                values[name][: len(numbers)] = numbers
        total, x = np.zeros((len(self._table.bodies), WIDE)), values["x"].reshape(3, capacity)
        for *state, seed in zip(*states, seeds, strict=True):
            for row, numbers in zip(x, state, strict=True):
                row[: len(numbers)] = numbers
            _, bars = _pullback(run)(values, 1, {"tau": np.pad(seed, (0, capacity - n))})
            total += bars["numbers"].reshape(-1, WIDE)[1 : len(total) + 1]
        axes = np.array([motion_axes(body.joint) for body in self._table.bodies])
        first, second = np.tril_indices(3)  # of the inertia, whose products stand twice in it
        often = np.where(first == second, 1.0, 2.0)
        inertia = np.zeros((len(total), 3, 3))
        inertia[:, first, second] = inertia[:, second, first] = total[:, 17:23] / often
        inertia = axes @ inertia @ np.swapaxes(axes, 1, 2)
        moment = np.einsum("bij,bj->bi", axes, total[:, 14:17])
        return np.column_stack([total[:, 13], moment, often * inertia[:, first, second]])

    def mass_matrix(self, q: ArrayLike) -> Array:
        """M, (n, n) or (N, n, n)."""
        still = np.zeros((*np.shape(q)[:-1], self.n))
        return self._slopes(q, still, still)[2]  # type: ignore[no-any-return]

    def energy(self, q: ArrayLike, qd: ArrayLike) -> tuple[Any, Any]:
        """Kinetic and potential energy [J], each a float, or (N,)."""
        kinetic, potential = np.moveaxis(self._at("energies", {"q": q, "qd": qd}), -1, 0)
        return kinetic[()], potential[()]

    def frames(self, q: ArrayLike) -> tuple[Array, Array]:
        """Positions of bodies in the world, (bodies, 3) [m], and their axes as columns, (bodies, 3, 3); or of N states.

        In the order of `bodies`.
        """
        places = self._at("frames", {"q": q})
        rows = places.reshape(*places.shape[:-1], -1, STRIDE)[..., 1 : len(self._table.bodies) + 1, :]
        turned = np.swapaxes(rows[..., :9].reshape(*rows.shape[:-1], 3, 3), -1, -2)
        return rows[..., 9:12], turned @ np.array([motion_axes(body.joint).T for body in self._table.bodies])

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the bodies that have rows."""
        return tuple([body.name for body in self._table.bodies])

    def _at(self, what: str, given: dict[str, ArrayLike], threads: int | None = 1) -> Array:
        count, bound = thread_count(threads), self._bound.get(what)
        if bound is None or bound.table is not self._table:
            bound = self._bind(what)
        values = [real_array(name, value) for name, value in given.items()]
        leading = values[0].shape[:-1]
        for (name, value), array, buffer in zip(given.items(), values, bound.inputs, strict=False):
            if array.shape != (*leading, len(buffer)) or len(leading) > 1:
                wanted = f"({len(buffer)},) or (N, {len(buffer)})"
                raise ValueError(f"{name} must have shape {wanted}, a number for each, got {np.shape(value)}")
            if not leading:
                buffer[:] = array
        if not leading:
            bound.call()
            return bound.result.copy()
        return self._batch(what, values, count)

    def _runner(self, what: str) -> Runner:
        lifted = bool(np.count_nonzero(self._table.numbers[:, 27:]))
        return _runner(what, tuple([TYPES[kind] for kind in self._kinds]), lifted, self._capacity, self._cache)

    def _bind(self, what: str) -> Bound:
        """The quantity, with the table of now in its memory."""
        run, bound, capacity = self._runner(what), self._bound.get(what), self._capacity
        new, (_, result) = bound is None or bound.run is not run, QUANTITIES[what]
        if bound is None or new:
            x, y = np.zeros(3 * capacity), np.zeros(run.program.registers[result])
            call, registers = run.bind_pass(("x", x), (result, y))
            bound = Bound(self._table, run, x, {**registers, result: y}, call, y, ())
        registers, x = bound.registers, bound.x
        if what == "slopes":
            bound.result[:] = 0.0  # entries of other freedoms
        table, before = self._table, bound.table
        if new or table.types is not before.types or table.parents is not before.parents:
            contents = self._contents(world=new, pairs=what == "slopes", places=(0, capacity, 2 * capacity))
            for name, numbers in contents.items():
                if name in registers:
                    registers[name][: len(numbers)] = numbers
        else:
            registers["numbers"].reshape(-1, WIDE)[1 : len(table.moved) + 1, : table.moved.shape[1]] = table.moved
        inputs = x[: self.nq], x[capacity : capacity + self.n], x[2 * capacity : 2 * capacity + self.n]
        self._bound[what] = bound = Bound(table, *bound[1:-1], inputs)
        return bound

    def _batch(self, what: str, values: Sequence[Array], threads: int) -> Array:
        run, count, width = self._runner(what), len(values[0]), self.nq + 2 * self.n
        # What is behind a row of these, the next one or zeros, no sweep reads.
        flat, longest = np.zeros(count * width + 3 * self._capacity), 3 * self._capacity
        np.concatenate(
            values, axis=1, out=flat[: count * width].reshape(count, width)[:, : sum([v.shape[1] for v in values])]
        )
        points = np.lib.stride_tricks.as_strided(flat, (count, longest), (width * flat.itemsize, flat.itemsize))
        columns = self._columns.get(what)
        if columns is None or columns[0] is not self._table:
            known, places = run.program.registers, (0, self.nq, self.nq + self.n)
            contents = self._contents(world=True, pairs=what == "slopes", places=places)
            start = {name: np.asarray(numbers, dtype=float) for name, numbers in contents.items() if name in known}
            columns = self._columns[what] = self._table, *run.columns_from("x", lambda: start)
        found = np.zeros((count, run.program.registers[QUANTITIES[what].result]))
        write_batch(columns[1], columns[2], points.T, found.T, threads)
        return found

    def _contents(self, *, world: bool, pairs: bool, places: tuple[int, ...]) -> dict[str, Any]:
        """Tables before a pass.  world: with what never changes, and what the world is.  pairs: of freedoms, too.

        places: of coordinates, velocities, and accelerations or torques in x.
        """
        table, n, capacity, count = self._table, self.n, self._capacity, len(self._table.bodies)
        found: dict[str, Any] = {"count": (count,), "kind": [self._kinds[kind.kind] for kind in table.types]}
        parents, q, u = np.array((table.parents, self._q_at[:-1], self._u_at[:-1]), dtype=np.float64)
        parents = STRIDE * (parents + 1.0)
        found |= {"parent": parents, "wide parent": 2.0 * parents, "q": q}
        wide = np.zeros((count + 1, WIDE))
        wide[1:, : table.moved.shape[1]] = table.moved
        found |= {"numbers": wide.ravel(), "result": u, "u": places[1] + u, "v": places[2] + u}
        found["gain"] = 7 * u
        if world:
            up, still = -np.asarray(table.base.gravity, dtype=np.float64), np.zeros(9)
            own = STRIDE * np.arange(1.0, capacity + 1)
            found |= {"motion": [*still[:6], *up], "moving": [*still, *up], "height": [*still[:6], *up]}
            found |= {"vertical": up, "place": [*np.eye(3).ravel(), *still[:6]], "own": own, "wide": 2.0 * own}
        if pairs:
            found |= {"freedom": FREEDOM * u} | {f"entries {k}": 3 * (n * (u + k) + u) for k in range(MOST)}
            chains = [np.empty((2, 0), int)]  # of each row the freedoms between it and the world, with their rows
            inner, outer = [np.empty(0, int)], [np.empty((2, 0), int)]
            for row, parent in enumerate(table.parents):
                own, chain = np.arange(self._u_at[row], self._u_at[row + 1]), chains[parent + 1]
                outer.append(np.tile(chain, len(own)))
                inner.append(np.repeat(own, chain.shape[1]))
                chains.append(np.hstack([chain, [own, np.full(len(own), row + 1)]]))
            (k, at), j = np.hstack(outer), np.concatenate(inner)
            found |= {"pairs": [len(j)], "outer": FREEDOM * k, "inner": FREEDOM * j, "outer row": STRIDE * at}
            found |= {"outer inner": 3 * (n * k + j), "inner outer": 3 * (n * j + k)}
        return found

    @property
    def _forces(self) -> tuple[Compiled, Compiled] | None:
        """The applied forces of (q, qd), and their slopes, as functions."""
        return _applied_forces(self._table.base) if self._table.base.forces else None

    def _applied(self, q: ArrayLike, qd: ArrayLike, *, slopes: bool = False) -> Array:
        state = np.concatenate([real_array("q", q), real_array("qd", qd)], axis=-1)
        assert self._forces is not None, "asked for"
        function = self._forces[slopes]
        return function(state) if state.ndim == 1 else function.batch(state.T).T

    def _require_tree(self, what: str) -> None:
        if loops := self._table.base.loops:
            raise MechanismError(f"{what} by rows are those of a tree, and {loops[0].label} closes a loop")

    def attach(self, subtree: Subtree | Body | Iterable[Body], to: str | None = None) -> None:
        """Hang bodies on these rows, as `Mechanism.attach` does: their coordinates come behind the others."""
        self._change("attach", subtree, to)

    def detach(self, body: str) -> None:
        """Take off a body and all that it carries, as `Mechanism.detach` does."""
        self._change("detach", body)

    def lock(self, body: str, at: float | ArrayLike | None = None) -> None:
        """Let a joint stand still, as `Mechanism.lock` does."""
        self._change("lock", body, at)

    def unlock(self, body: str) -> None:
        """Let a locked joint move again, as `Mechanism.unlock` does."""
        self._change("unlock", body)

    def with_body(self, body: Body) -> None:
        """Put another body in place of the one of its name, such as a load of another mass."""
        self._change("with_body", require_kind("body", body, Body))

    def _change(self, method: str, *arguments: Any) -> None:
        """Change the rows if that is all; or else the mechanism, which says what cannot be."""
        base = self._table.base
        quick = None if base.forces or base.loops else getattr(self._table, method)(*arguments)
        self._set(quick or table_of(getattr(self.mechanism, method)(*arguments).bind()))


@kept_by_first
def _applied_forces(mechanism: Mechanism) -> tuple[Compiled, Compiled]:
    """The applied forces of (q, qd), and their slopes, as graphs of their own."""
    kinematics = Kinematics(mechanism.coordinates, quasi_velocities(mechanism.moving))
    known = {name: cg.constant(value) for name, value in mechanism.parameter_values.items()}
    forces = mechanism.generalized_forces(kinematics.q, kinematics.u, cg.variable("t"), known)
    slopes = [each for row in state_slopes(kinematics, forces, Builder()) for each in row]
    made = [cg.compile(numbered_graph([*kinematics.q, *kinematics.u], nodes)) for nodes in (forces, slopes)]
    return made[0], made[1]


@kept_by_first
def _pullback(run: Runner) -> Callable[..., tuple[dict[str, Array], dict[str, Array]]]:
    """Cotangents of the numbers of rows, by those of torques."""
    return program_vjp(run.program, ["tau"], ["numbers"])


@memo(64)
def _runner(what: str, types: tuple[JointType, ...], lifted: bool, capacity: int, cache: bool | str) -> Runner:
    """The runner of a quantity, for robots of joints of these types."""
    statements, result = QUANTITIES[what]
    return runner(passes.program(statements(types, lifted), capacity, result), cache=cache)

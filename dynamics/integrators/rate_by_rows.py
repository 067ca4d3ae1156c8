"""Rates of a state, and the energy in it, as loops over the rows of a robot where else a graph would be."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

import cgraph as cg
from cgraph import Graph
from cgraph._shared import with_names
from cgraph.extend import Call, Statement, copied, effects

from ..multibody.joints import JointType
from ..multibody.rows import kernels, passes
from ..multibody.rows.blocks import Block
from ..multibody.rows.passes import sweep
from ..multibody.rows.rows import Rows
from ..multibody.trees.structure import used_names
from ..systems.evaluation import ByRows, Evaluation
from ..systems.system import System

PREFIX = "rows."  # before the names of registers, so that no method has to keep clear of them
PLACES = {"rate": Block("slope", "q"), "a": Block("slope", "u"), "tau": Block("tau", "result")}


def rows_of(system: System, values: Mapping[str, float]) -> Rows | None:
    """The rows by which a system of bodies moves; None where only a graph can do.  values: of known parameters."""
    terms = system.body_terms
    assert terms is not None, "of bodies"
    if terms.linearized is not None:  # given as rows
        rows = Rows(terms.bodies.mechanism)
        rows._require_tree("motions")
        return rows
    given = terms.bodies
    own, names = given.system, used_names(given.bodies, given.gravity, ()).keys()
    same = own.partial_lagrangians is system.partial_lagrangians and own.damping is system.damping
    if not (same and terms.surely_regular and names <= values.keys()) or len(system.constraints):
        return None
    return Rows(given.bind({name: value for name, value in values.items() if name in given.parameter_values}))


def rate_by_rows(rows: Rows, forces: Graph, straight: Callable[[], Graph]) -> ByRows:
    """The rate of q and u, over the inputs of the graph of forces."""
    kinds, m = _kinds(rows), rows.nq + rows.n
    loops = passes.forward(kinds, bool(rows._table.numbers[:, 27:].any()), PLACES)
    loops.append(sweep(kernels.coordinate_rates, kinds, elsewhere=PLACES))
    made = _evaluation(rows, forces, [Call(forces, ("x", "t", "p"), ("tau",)), *loops])
    return ByRows(forces.input_names, (m, m), made, straight)


def energy_by_rows(rows: Rows, names: Sequence[str], straight: Callable[[], Graph]) -> ByRows:
    """The energy E of q and u."""
    parts = cg.variables("kinetic potential")
    energy = Graph(parts, {"E": parts[0] + parts[1]})
    loops = [*passes.energies(_kinds(rows), False), Call(energy, ("energy",), ("slope",))]
    return ByRows(names, (rows.nq + rows.n, 1), _evaluation(rows, energy, loops), straight)


def _kinds(rows: Rows) -> list[JointType]:
    """The types of the joints."""
    return list({kind.kind: kind for kind in rows._table.types}.values())


def _evaluation(rows: Rows, called: Graph, statements: Sequence[Statement]) -> Evaluation:
    contents, count = rows._contents(world=True, pairs=False, places=(0, rows.nq, 0)), len(rows.bodies)
    kinds = [kind.kind for kind in _kinds(rows)]
    contents["kind"] = [kinds.index(kind.kind) for kind in rows._table.types]
    lengths = passes.used_registers(statements, max(count, rows.nq)) | {"tau": rows.n}
    begun = [name for name in effects(statements)[1] if name in contents]  # with the motion of the ground
    statements = [*[copied(f"{name} at rest", name) for name in begun], *statements]
    lengths |= {f"{name} at rest": lengths[name] for name in begun}
    known = {name: contents.get(name.removesuffix(" at rest")) for name in lengths if name not in begun}
    tables = {  # what lies behind the rows is not read
        f"{PREFIX}{name}": np.resize(np.asarray(each, dtype=np.float64), lengths[name])
        for name, each in known.items()
        if each is not None
    }
    named = tuple(
        [with_names(each, lambda name: f"{PREFIX}{name}" if name in lengths else name) for each in statements]
    )
    return Evaluation(called, named, {f"{PREFIX}{name}": length for name, length in lengths.items()}, tables)

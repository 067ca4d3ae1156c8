"""Conserved quantities: momenta of cyclic coordinates, and the energy or Jacobi's integral, as the graph shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import columns, shortened
from cgraph.extend import Builder, as_node, building, cotangents, folded, hessian_nodes, topological

from ...systems.energies import signed_terms, split_by_motion
from ...systems.kinematics import ONE, ZERO, dot
from ...systems.model import Model, as_system
from ...systems.system import System
from ..equation import called, documented, entries
from ..equations_of_motion import energy, momentum
from .hamiltonian import momentum_slopes

ENERGY, JACOBI = "energy", "Jacobi's integral"


@dataclass(frozen=True)
class Conserved:
    """What stays constant in every motion on which no tau acts; see `conserved`.

    Parameters
    ----------
    quantities : mapping of str to Graph
        {"p.<velocity>", "energy" or "Jacobi's integral": its value}, of q0.., qd0.., t if needed and parameters; the
        output is p0.., E or h.
    missing : mapping of str to str
        {another momentum or the energy: why it is not known to be constant}.

    Examples
    --------
    >>> import dynamics as dyn
    >>> print(dyn.conserved(dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2, ["x"], damping=0.1)))
    Not known to be constant, as damping acts on it: p.x.
    Not known to be constant, as a force or damping does work: energy.
    """

    quantities: Mapping[str, Graph]
    missing: Mapping[str, str]

    def __str__(self) -> str:
        """Sentence on what is conserved, and one for each reason why something is not."""
        lines = [f"Constant while no tau acts: {', '.join(self.quantities)}."] if self.quantities else []
        for why in dict.fromkeys(self.missing.values()):
            names = [name for name, reason in self.missing.items() if reason == why]
            lines.append(f"Not known to be constant, as {why}: {', '.join(names)}.")
        return "\n".join(lines)


@documented
def conserved(model: Model) -> Conserved:
    """Momenta p = dL/dqd of cyclic coordinates (Noether), and the energy or Jacobi's integral h = qd dL/dqd - L.

    Proven by structure, so at every state and for all values of the parameters. A momentum is constant where its rate
    dL/dq + forces - damping * qd, of quasi-velocities G^T dL/dq - ad(u; p) in place of dL/dq, folds to the constant 0,
    L does not jump along it, and no constraint pulls there. h is constant where L has no t in it and does not jump, the
    power of forces and damping folds to 0, and rows of constraints vanish at rest: constraints that move do work.

    h is the energy T + V where T is quadratic in qd and vanishes at rest. It is called Jacobi's integral where L is not
    quadratic in the velocities, or has a sum of squares without them, as T has in a frame that is turned: that of a
    bead on a hoop is R^2 (qd^2 + w^2 sin(q)^2) / 2. A potential -k q^2 / 2, which drives away, reads like
    that, too, unless it has the tag "potential".

    Momenta are those of the coordinates that the model has, and not of others: that a planet in x and y keeps its
    angular momentum is not found, and what is not named may be constant all the same.

    Returns
    -------
    Conserved

    Examples
    --------
    A planet in polar coordinates: its angular momentum and its energy.

    >>> import dynamics as dyn
    >>> def planet(q, qd, t):
    ...     return 0.5 * (qd[0] ** 2 + (q[0] * qd[1]) ** 2) + 1.0 / q[0]
    >>> found = dyn.conserved(dyn.System(planet, "r phi"))
    >>> print(found)
    Constant while no tau acts: p.phi, energy.
    Not known to be constant, as L depends on it: p.r.
    >>> found.quantities["p.phi"].evaluate({"q0": 2.0, "q1": 0.0, "qd0": 0.0, "qd1": 3.0})
    {'p1': 12.0}
    """
    system = as_system(model)
    forms = [form for form in (system, system.shortened) if form is not None]
    name = JACOBI if system.body_terms is None and _moving_frame(system) else ENERGY
    found = [_reasons(form, name) for form in forms]
    why = {key: min([" and ".join(reasons[key]) for reasons in found], key=len) for key in found[0]}
    total, momenta = energy(model), momentum(model)
    outputs = {f"p.{velocity}": {f"p{i}": momenta.outputs[f"p{i}"]} for i, velocity in enumerate(system.velocities)}
    letter = "h" if name is JACOBI else "E"
    outputs[name] = {letter + "_" * (letter in system.parameters): total.outputs["E"]}
    graphs = {key: called(cg.simplify(Graph(total.inputs, outputs[key])), model) for key in why if not why[key]}
    return Conserved(graphs, {key.replace(JACOBI, ENERGY): reason for key, reason in why.items() if reason})


def _reasons(form: System, energy_name: str) -> dict[str, list[str]]:
    """{name: why it is not constant}, of momenta and the energy; nothing where it is."""
    build, names = Builder(), form.constraints.names
    (lagrangian,) = folded([form.lagrangian], build)
    jumping = _jumping(form, lagrangian, build)
    momenta = cotangents({lagrangian: ONE}, form.qd, build)
    slopes = folded(momentum_slopes(form, lagrangian, momenta, build), build)
    braking = form.braking(build)
    with building(build):
        pushes = [force - brake for force, brake in zip(form.forces, braking, strict=True)]
        rates = [slope + push for slope, push in zip(slopes, pushes, strict=True)]
        power = dot(pushes, form.qd)
    rates = shortened(folded(rates, build))
    pulls = [cotangents({rate: ONE}, form.qd, build) for rate in form.constraints.rates]
    found = {}
    for i, velocity in enumerate(form.velocities):
        parts = {"L depends": slopes[i], "a force acts": form.forces[i], "damping acts": braking[i]}
        causes = [f"{part} on it" for part, node in parts.items() if rates[i].value != 0.0 and node.value != 0.0]
        causes += [
            f"constraint {name!r} acts on it" for name, row in zip(names, pulls, strict=True) if row[i].value != 0.0
        ]
        found[f"p.{velocity}"] = causes + ["L jumps along it"] * (i in jumping)
    at_rest = shortened(folded(form.constraints.rates, build, dict.fromkeys(form.qd, ZERO)))
    found[energy_name] = [
        *["L depends on t"] * (form.t in topological([lagrangian])),
        *["L jumps"] * bool(jumping),
        *["a force or damping does work"] * (shortened(folded([power], build))[0].value != 0.0),
        *[f"constraint {name!r} moves" for name, rate in zip(names, at_rest, strict=True) if rate.value != 0.0],
    ]
    return found


def _moving_frame(system: System) -> bool:
    """Whether L is not quadratic in the velocities, or a term of it at rest is a sum of squares with weights."""
    build, state = Builder(), {*system.q, system.t}
    (lagrangian,) = folded([system.lagrangian], build)
    if set(system.qd) & set(topological(entries(hessian_nodes(lagrangian, system.qd, build)))):
        return True
    moving, _ = split_by_motion(lagrangian, system.qd)
    rest, own = folded([lagrangian, moving], build, dict.fromkeys(system.qd, ZERO))
    terms = [node for sign, node in signed_terms(rest) if sign > 0 and "potential" not in node.tags]
    odd: dict[Node, frozenset[Node]] = {}  # factors of the state that stand in a product an odd number of times
    fixed: set[Node] = set()
    for node in topological([*terms, own]):
        name, args = node.op.name, node.args
        odd[node] = frozenset({node})
        if node not in state and fixed.issuperset(args):
            fixed.add(node)
            odd[node] = frozenset() if node.value is None or node.value >= 0.0 else odd[node]
        elif name == "mul" or (name == "div" and args[1] in fixed):
            odd[node] = odd[args[0]] ^ odd[args[1]]
        elif (name == "pow" and args[1].value in (2.0, 4.0)) or (name == "add" and not odd[args[0]] | odd[args[1]]):
            odd[node] = frozenset()
    return (own.value != 0.0 and not odd[own]) or any([not odd[node] and node not in fixed for node in terms])


def _jumping(system: System, lagrangian: Node, build: Builder) -> set[int]:
    """The velocities along which L jumps, as `floor` and the condition of `where` do: beside a jump its slope is 0."""
    moving: set[int] = set()
    for node in topological([lagrangian]):
        with building(build):
            partials = map(as_node, node.op.partials(node, *node.args)) if node.args else ()
        for arg, partial in zip(node.args, partials, strict=True):
            if columns(node.op).jumps or partial.value == 0.0:
                slopes = system.kinematics.slopes(cotangents({arg: ONE}, system.q, build), [ZERO] * system.n, build)
                moving |= {i for i, slope in enumerate(slopes) if slope.value != 0.0}
    return moving

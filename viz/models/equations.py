"""The equations of a model in the order and the form in which a textbook writes them: blocks of statements."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import cgraph as cg
import dynamics as dyn
from cgraph import Graph, Node, variable
from cgraph._shared import Side, counted, ink, is_letter, reading_form
from cgraph.extend import Builder, cotangents
from dynamics.equations.constraints.constraints import Rows, constraint_rows
from dynamics.equations.formulations.lagrange_terms import Embedding
from dynamics.systems.kinematics import ONE, ZERO

from ..pages.mathml import ranks

EXPLICIT, BRIEF = 130.0, 45.0  # symbols of an equation that is written out, of up to two and of more velocities
LARGEST, FEW_INPUTS = 120, 16  # nodes of a graph that is written out, of so few inputs; of more inputs a third
MATRICES = 4  # velocities up to which M is shown as a matrix
MOST_PARTS = 8  # partial Lagrangians whose sum is shown
# The first that is no parameter is taken.
LETTERS = {"M": "MHA", "c": "cbC", "g": "gnG", "d": "dD", "Q": "QFu", "J": "JWB", "r": "rhs"}
WORDS = {"M": "inertia", "c": "velocities", "g": "weight and springs", "d": "damping", "Q": "applied forces"}
WORDS |= {"J": "constraints, a row each", "r": "what J q̈ has to be"}
PARTS = ("c", "g", "d", "Q")  # of the torque, beside M qdd
TAU, QDD, TRANSPOSED = cg.variables("tau qdd T")
# Formulations with Euler's step: what is differentiated through it, and how the torque is said to be had.
EMBEDDED = {"by_definition": ("L", "by definition"), "kinetic_only": ("K", "by the kinetic energy alone")}


@dataclass(frozen=True)
class Block:
    """Statements below a title.

    statements: sides that are equal, each a node in reading form or a matrix.  about: a sentence on them.  wrong:
    whether they say what is wrong.
    """

    title: str
    statements: Sequence[tuple[Side, ...]]
    about: str = ""
    wrong: bool = False


@dataclass(frozen=True)
class Equations:
    """The blocks of a model.  names: {variable in them: what a person calls it}.

    indices: {index in a formula: the name that it stands for}, where names differ in their last number alone.
    """

    blocks: Sequence[Block]
    names: Mapping[str, str]
    indices: Mapping[str, str] = field(default_factory=dict)

    @property
    def legend(self) -> str:
        """Sentence on the indices; empty where names stand in the formulas."""
        said = [f"{index} is {name}" for index, name in self.indices.items()]
        return f"Indices: {', '.join(said[:8])}{', ..' * (len(said) > 8)}." if said else ""


def model_equations(
    scene: dyn.Scene, *, of: str = "torque", formulation: str = "chain_rule", compare: Sequence[str] = ()
) -> Equations:
    """The equations of a scene: Lagrangian, momenta, what is conserved, and the torque or what else is asked for.

    of: "torque", "accelerations", with the multipliers of constraints, or "momenta", Hamilton's equations.
    formulation: of the torque.  compare: formulations of which a block says what they have too much, where they
    differ from the chain rule; beside `formulation`.

    A system of first order has its state equation alone. Of a mechanism the Lagrangian is that of the whole tree.
    Raises for momenta of what has none.
    """
    if scene.ode is not None:  # which has no momenta, as `hamilton_equations` says
        graph = dyn.hamilton_equations(scene) if of == "momenta" else dyn.state_equation(scene)
        first = dict.fromkeys(scene.parameters, 0) | dict.fromkeys(scene.coordinates, 1)
        return Equations([Block("State equation", _statements(graph, first))], {})
    system, (names, indices) = scene.system, _short_names(scene)
    lagrangian, parts = _lagrangian(scene, indices)
    blocks = [lagrangian, Block("Momenta, p = ∂L/∂q̇", _statements(dyn.momentum(scene))), *_conserved(scene)]
    if of == "momenta":
        blocks.append(Block("Hamilton's equations", _statements(dyn.hamilton_equations(scene))))
    else:
        rows = constraint_rows(system, system.constraints.rates)
        if len(system.constraints):
            blocks.append(_constraints(system, rows))
        blocks += _accelerations(scene, rows) if of == "accelerations" else _torque(scene, formulation, rows)
        chosen = dict.fromkeys([each for each in (formulation, *compare) if each in EMBEDDED])
        blocks += [block for each in chosen for block in _spurious(scene, each)]
    more = {f"tau_def{i}": f"tau_def.{names[f'tau{i}'].partition('.')[2]}" for i in range(system.n)}
    more |= {f"∂q{i}": f"∂{names[f'q{i}']}" for i in range(system.nq)}
    more |= {f"M_{i}_{j}": f"M_{i + 1}_{j + 1}" for i in range(system.n) for j in range(system.n)}
    more |= {f"z{k}": f"z.{name}" for k, name in enumerate(system.constraints.names)}
    return Equations(blocks, {**names, **more, **parts}, indices)


def _short_names(scene: dyn.Scene) -> tuple[dict[str, str], dict[str, str]]:
    """Display names, and what indices stand for: of names alike but for a number at their end, the number."""
    names, called = dyn.display_names(scene), dict.fromkeys((*scene.coordinates, *scene.velocities))
    matches = {name: re.fullmatch(r"(.*[^0-9])([0-9]+)", name) for name in called}
    stems = {match.group(1) if match else None for match in matches.values()}
    stem = stems.pop() if len(stems) == 1 else None
    if stem is None or is_letter(stem) or len(called) == 1:
        return names, {}
    index = {name: match.group(2) for name, match in matches.items() if match}
    split = {key: text.partition(".") for key, text in names.items()}
    short = {key: f"{kind}.{index.get(name, name)}" for key, (kind, _, name) in split.items()}
    return short, {number: name for name, number in index.items()}


def _statements(graph: Graph, order: Mapping[str, int] | None = None) -> list[tuple[Node, Node]]:
    """Each output of a graph and what it is.  order: ranks of the inputs, see `reading_form`."""
    largest = LARGEST if len(graph.input_names) <= FEW_INPUTS else LARGEST // 3
    rights = reading_form(list(graph.outputs.values()), order or ranks(graph.input_names), largest)
    return [(variable(name), right) for name, right in zip(graph.outputs, rights, strict=True)]


def _lagrangian(scene: dyn.Scene, indices: Mapping[str, str]) -> tuple[Block, dict[str, str]]:
    """L, a long one as the sum of its partial Lagrangians; and {variable that stands for one: what it is called}."""
    system = scene.system
    graph = cg.simplify(system.graph({"L": system.lagrangian}, system.q, system.qd))
    whole, parts = _statements(graph), system.partial_lagrangians
    if ink(whole[0][1]) <= EXPLICIT or len(parts) < 2:
        return Block("Lagrangian", whole), {}
    bodies = [] if scene.mechanism is None else [body.name for body in scene.mechanism.moving]
    called = bodies if len(bodies) == len(parts) else [str(k + 1) for k in range(len(parts))]
    index = {name: number for number, name in indices.items()}
    labels = cg.variables([f"L_{k}" for k in range(len(parts))])
    outputs = {str(label.name): part for label, part in zip(labels, parts, strict=True)}
    of_parts = cg.simplify(system.graph(outputs, system.q, system.qd))
    said = f"The sum of {counted(len(parts), 'partial Lagrangian')}{', one for each body' * bool(bodies)}."
    names = {name: f"L.{index.get(body, body)}" for name, body in zip(outputs, called, strict=True)}
    total = [(variable("L"), sum(labels[1:], start=labels[0]))] if len(labels) <= MOST_PARTS else []
    return Block("Lagrangian", [*total, *_statements(of_parts)], said), names


def _conserved(scene: dyn.Scene) -> list[Block]:
    """What is constant in every motion without tau; no block where nothing is known to be."""
    quantities = dyn.conserved(scene).quantities
    held = [statement for graph in quantities.values() for statement in _statements(graph)]
    if held and not [*quantities][-1].startswith("p.") and ink(held[-1][1]) > EXPLICIT:
        held[-1] = held[-1][0], variable("qd") * variable("p") - variable("L")
    said = f"Constant while no τ acts: {', '.join(quantities)}. Of momenta, those of cyclic coordinates only."
    return [Block("Conserved", held, said)] if held else []


def _constraints(system: dyn.System, rows: Rows) -> Block:
    """The rows that hold the system, each with its multiplier in the equations of motion."""
    known, names = system.constraints, system.constraints.names
    nodes = [(*known.positions, *known.velocities)[k] for k in rows.kept]
    outputs = {f"z{k}": node for k, node in zip(rows.kept, nodes, strict=True)}
    held = [(*each, ZERO) for each in _statements(cg.simplify(system.graph(outputs, system.q, system.qd)))]
    left = [name for k, name in enumerate(names) if k not in rows.kept]
    said = f" Those that follow from them have no force: {', '.join(left)}." if left else ""
    return Block("Constraints", held, f"Their forces are Jᵀλ, J the slopes of their rates by velocities.{said}")


def _torque(scene: dyn.Scene, formulation: str, rows: Rows) -> list[Block]:
    """The torque: written out where that is short, else by its matrices if these are small, else as in the graph."""
    system, graph = scene.system, dyn.inverse_dynamics(scene, formulation)
    chain_rule, title = formulation == "chain_rule", f"Torque, {formulation.replace('_', ' ')}"
    if rows.kept:
        pulls = cotangents(dict(zip(rows.rates, rows.multipliers, strict=True)), system.qd)
        if "q0_old" in graph.input_names:
            pulls = Embedding(system).embed(*pulls)
        torques = {name: tau - pull for (name, tau), pull in zip(graph.outputs.items(), pulls, strict=True)}
        graph = cg.simplify(Graph([*graph.inputs, *rows.multipliers], torques))
    explicit = _statements(graph)
    title = f"{'Torque, τ = dp/dt − ∂L/∂q' if chain_rule else title}{' − Jᵀλ' * bool(rows.kept)}"
    short = all(ink(right) <= (EXPLICIT if system.n <= 2 else BRIEF) for _, right in explicit)
    small = chain_rule and 2 <= system.n <= MATRICES
    blocks = [Block(title, explicit)] * (short or not small)
    return [*blocks, _by_matrices(system, rows)] if small else blocks


def _accelerations(scene: dyn.Scene, rows: Rows) -> list[Block]:
    """Accelerations and multipliers written out where that is short; else, or of few, the system that they solve."""
    explicit = _statements(dyn.forward_dynamics(scene))
    short = all(ink(right) <= EXPLICIT for _, right in explicit)
    said = "" if short else "The accelerations written out are too long to print; they are what solves this. "
    by_matrices = [_by_matrices(scene.system, rows, said)] if scene.system.n > 1 or not short else []
    return [*[Block("Accelerations", explicit)] * short, *by_matrices]


def _letters(system: dyn.System) -> dict[str, Node]:
    """{part of the torque: its letter}, none that is a parameter."""
    taken = {str(node.name) for node in system.extra_inputs}
    return {
        name: variable(next(each for each in (*some, f"{name}_{name}") if each not in taken))
        for name, some in LETTERS.items()
    }


def _by_matrices(system: dyn.System, rows: Rows, said: str | None = None) -> Block:
    """tau = M qdd + c + g + d - Q - J^T lambda: inertia, Coriolis force, gravity and springs, damping, forces, pulls.

    said: of M qdd = tau - .. and J qdd = r, which accelerations solve; None for the torque.
    """
    n, forces = system.n, dyn.bias(system)
    gravity = list(dyn.gravity_force(system).outputs.values())
    coriolis = [whole - part for whole, part in zip(forces.outputs.values(), gravity, strict=True)]
    slopes = [cotangents({z: ONE}, system.qd) for z in rows.rates]
    nodes = [
        *dyn.mass_matrix(system).outputs.values(),
        *coriolis,
        *gravity,
        *dyn.damping_force(system).outputs.values(),
        *system.forces,
        *[slope for row in slopes for slope in row],
        *[-rate for rate in system.constraints.rate_changes(rows.rates, Builder())],
    ]
    entries = reading_form(nodes, ranks(forces.input_names))
    found = [entries[i * n : (i + 1) * n] for i in range(n + len(PARTS) + len(slopes))]
    matrix, columns = found[:n], zip(PARTS, found[n : n + len(PARTS)], strict=True)
    kept = {name: column for name, column in columns if any(each.value != 0.0 for each in column)}
    letters = _letters(system)
    wide = max([sum([ink(entry) for entry in row]) for row in matrix]) > EXPLICIT / 2
    held: list[tuple[Side, ...]] = [(letters["M"], matrix)]
    if wide:  # the lower triangle entry by entry
        held = [(variable(f"M_{i}_{j}"), matrix[i][j]) for i in range(n) for j in range(i + 1)]
    held += [(letters[name], [[entry] for entry in column]) for name, column in kept.items()]
    solved, inertia = said is not None, letters["M"] * QDD
    total = TAU if solved else inertia
    for name in kept:
        total = total + letters[name] if (name == "Q") == solved else total - letters[name]
    told = ["M", *kept, *["J"] * bool(slopes), *["r"] * (bool(slopes) and solved)]
    if slopes:
        pull = letters["J"] ** TRANSPOSED * variable("lambda")
        total = total + pull if solved else total - pull
        held.append((letters["J"], found[n + len(PARTS) :]))
    held.insert(0, (inertia, total) if solved else (TAU, total))
    if slopes and solved:
        held.insert(1, (letters["J"] * QDD, letters["r"]))
        held.append((letters["r"], [[entry] for entry in entries[-len(slopes) :]]))
    about = "; ".join([f"{letters[name].name}: {WORDS[name]}{', symmetric' * (wide and name == 'M')}" for name in told])
    return Block(f"{'Accelerations' if solved else 'Torque'} by matrices", held, f"{said or ''}{about}.")


def _spurious(scene: dyn.Scene, formulation: str) -> list[Block]:
    """What a formulation with Euler's step has too much, where it has."""
    verdict, system = dyn.formulation_verdict(scene, formulation), scene.system
    quasi = system.kinematics.quasi is not None
    if not verdict.differs or verdict.terms is None or not verdict.excess:
        return []
    terms = {name: node for name, node in verdict.terms.outputs.items() if node.value != 0.0}
    known = _statements(Graph(verdict.terms.inputs, terms))
    held: list[tuple[Side, ...]] = []
    energy, had = EMBEDDED[formulation]
    for name, (_, right) in zip(terms, known, strict=True):
        if right.value == 0.0:
            continue
        i = name.removeprefix("tau")
        left = variable(f"tau_def{i}") - variable(name)
        slope = variable(f"∂{energy}") / variable(f"∂q{i}")
        held.append((left, right) if quasi else (left, slope, right))
    if system.n > MATRICES or quasi:
        slope = variable(f"∂{energy}") / variable("∂q")
        held.insert(0, (variable("tau_def") - variable("tau"), variable("G") ** TRANSPOSED * slope if quasi else slope))
    about = (
        f"What the torque {had}, τ_def, has too much, however small the time step dt is: q = q̇ dt + q_old makes the "
        "momentum depend on q̇ through q as well. A further part, dt times the rate of this one, tends to 0 with dt. "
        f"{verdict.taken}"
    ).strip()
    return [Block(f"Spurious term, {formulation.replace('_', ' ')}", held, about, wrong=True)]

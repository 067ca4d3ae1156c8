"""The equations of a model in the order and the form in which a textbook writes them: blocks of statements."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import cgraph as cg
from cgraph import Graph, Node, variable
from cgraph._shared import Side, counted, ink, is_letter, reading_form
from dynamics.equations.equations_of_motion import bias, damping_force, gravity_force, mass_matrix, momentum
from dynamics.equations.formulations.formulations import inverse_dynamics
from dynamics.equations.formulations.verdict import formulation_verdict
from dynamics.equations.momentum.hamiltonian import hamilton_equations
from dynamics.equations.state_equation import state_equation
from dynamics.scenes import Scene
from dynamics.systems.model import display_names
from dynamics.systems.system import System

from ..pages.mathml import ranks

EXPLICIT, BRIEF = 130.0, 45.0  # symbols of an equation that is written out, of up to two and of more velocities
LARGEST, FEW_INPUTS = 120, 16  # nodes of a graph that is written out, of so few inputs; of more inputs a third
MATRICES = 4  # velocities up to which M is shown as a matrix
MOST_PARTS = 8  # partial Lagrangians whose sum is shown
LETTERS = {"M": "MHA", "c": "cbC", "g": "gnG", "d": "dD", "Q": "QFu"}  # the first that is no parameter is taken
WORDS = {"M": "inertia", "c": "velocities", "g": "weight and springs", "d": "damping", "Q": "applied forces"}
PARTS = ("c", "g", "d", "Q")  # of the torque, beside M qdd
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
    scene: Scene, *, formulation: str = "chain_rule", momenta: bool = False, compare: Sequence[str] = ()
) -> Equations:
    """The equations of a scene: Lagrangian, momenta, and the torque or Hamilton's equations.

    formulation: of the torque.  momenta: Hamilton's equations in place of it.  compare: formulations of which a block
    says what they have too much, where they differ from the chain rule; beside `formulation`.

    A system of first order has its state equation alone. Of a mechanism the Lagrangian is that of the whole tree.
    Raises for momenta of what has none.
    """
    if scene.ode is not None:  # which has no momenta, as `hamilton_equations` says
        graph = hamilton_equations(scene) if momenta else state_equation(scene)
        first = dict.fromkeys(scene.parameters, 0) | dict.fromkeys(scene.coordinates, 1)
        return Equations([Block("State equation", _statements(graph, first))], {})
    system, (names, indices) = scene.system, _short_names(scene)
    lagrangian, parts = _lagrangian(scene, indices)
    blocks = [lagrangian, Block("Momenta, p = ∂L/∂q̇", _statements(momentum(scene)))]
    if momenta:
        blocks.append(Block("Hamilton's equations", _statements(hamilton_equations(scene))))
    else:
        blocks += _torque(scene, formulation)
        chosen = dict.fromkeys([each for each in (formulation, *compare) if each in EMBEDDED])
        blocks += [block for each in chosen for block in _spurious(scene, each)]
    more = {f"tau_def{i}": f"tau_def.{names[f'tau{i}'].partition('.')[2]}" for i in range(system.n)}
    more |= {f"∂q{i}": f"∂{names[f'q{i}']}" for i in range(system.nq)}
    more |= {f"M_{i}_{j}": f"M_{i + 1}_{j + 1}" for i in range(system.n) for j in range(system.n)}
    return Equations(blocks, {**names, **more, **parts}, indices)


def _short_names(scene: Scene) -> tuple[dict[str, str], dict[str, str]]:
    """Display names, and what indices stand for: of names alike but for a number at their end, the number."""
    names, called = display_names(scene), dict.fromkeys((*scene.coordinates, *scene.velocities))
    matches = {name: re.fullmatch(r"(.*[^0-9])([0-9]+)", name) for name in called}
    stems = {match.group(1) if match else None for match in matches.values()}
    stem = stems.pop() if len(stems) == 1 else None
    if stem is None or is_letter(stem) or len(called) == 1:
        return names, {}
    index = {name: match.group(2) for name, match in matches.items() if match}
    split = {key: text.partition(".") for key, text in names.items()}
    short = {key: f"{kind}.{index.get(name, name)}" for key, (kind, _, name) in split.items()}
    return short, {number: name for name, number in index.items()}


def _statements(graph: Graph, order: Mapping[str, int] | None = None) -> list[tuple[Side, ...]]:
    """Each output of a graph and what it is.  order: ranks of the inputs, see `reading_form`."""
    largest = LARGEST if len(graph.input_names) <= FEW_INPUTS else LARGEST // 3
    rights = reading_form(list(graph.outputs.values()), order or ranks(graph.input_names), largest)
    return [(variable(name), right) for name, right in zip(graph.outputs, rights, strict=True)]


def _lagrangian(scene: Scene, indices: Mapping[str, str]) -> tuple[Block, dict[str, str]]:
    """L, a long one as the sum of its partial Lagrangians; and {variable that stands for one: what it is called}."""
    system = scene.system
    graph = cg.simplify(system.graph({"L": system.lagrangian}, system.q, system.qd))
    whole, parts = _statements(graph), system.partial_lagrangians
    if ink(_right(whole[0])) <= EXPLICIT or len(parts) < 2:
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


def _right(statement: tuple[Side, ...]) -> Node:
    right = statement[-1]
    assert isinstance(right, Node)
    return right


def _torque(scene: Scene, formulation: str) -> list[Block]:
    """The torque: written out where that is short, else by its matrices if these are small, else as in the graph."""
    system, graph = scene.system, inverse_dynamics(scene, formulation)
    title = f"Torque, {formulation.replace('_', ' ')}"
    explicit = _statements(graph)
    if formulation != "chain_rule":
        return [Block(title, explicit)]
    title = "Torque, τ = dp/dt − ∂L/∂q"
    short = all(ink(_right(each)) <= (EXPLICIT if system.n <= 2 else BRIEF) for each in explicit)
    blocks = [Block(title, explicit)] if short else []
    if 2 <= system.n <= MATRICES:
        blocks.append(_by_matrices(system))
    if blocks:
        return blocks
    damped = any(node.value != 0.0 for node in damping_force(system).outputs.values())
    driven = any(node.value != 0.0 for node in system.forces)
    return [_in_general(title, _letters(system), ["c", "g", *["d"] * damped, *["Q"] * driven], explicit)]


def _letters(system: System) -> dict[str, Node]:
    """{part of the torque: its letter}, none that is a parameter."""
    taken = {str(node.name) for node in system.extra_inputs}
    return {
        name: variable(next(each for each in (*some, f"{name}_{name}") if each not in taken))
        for name, some in LETTERS.items()
    }


def _in_general(
    title: str, letters: Mapping[str, Node], parts: Sequence[str], held: Sequence[tuple[Side, ...]], more: str = ""
) -> Block:
    """tau = M qdd + c + g + d - Q, of the parts that there are, then what is held.  more: on M."""
    total = letters["M"] * variable("qdd")
    for name in parts:
        total = total - letters[name] if name == "Q" else total + letters[name]
    about = "; ".join([f"{letters[name].name}: {WORDS[name]}{more * (name == 'M')}" for name in ("M", *parts)])
    return Block(title, [(variable("tau"), total), *held], f"{about}.")


def _by_matrices(system: System) -> Block:
    """tau = M qdd + c + g + d - Q: inertia, Coriolis and centrifugal force, gravity and springs, damping, forces."""
    n, forces = system.n, bias(system)
    gravity = list(gravity_force(system).outputs.values())
    coriolis = [whole - part for whole, part in zip(forces.outputs.values(), gravity, strict=True)]
    nodes = [
        *mass_matrix(system).outputs.values(),
        *coriolis,
        *gravity,
        *damping_force(system).outputs.values(),
        *system.forces,
    ]
    entries = reading_form(nodes, ranks(forces.input_names))
    rows = [entries[i * n : (i + 1) * n] for i in range(n + len(PARTS))]
    matrix, columns = rows[:n], zip(PARTS, rows[n:], strict=True)
    kept = {name: column for name, column in columns if any(each.value != 0.0 for each in column)}
    letters = _letters(system)
    wide = max([sum([ink(entry) for entry in row]) for row in matrix]) > EXPLICIT / 2
    held: list[tuple[Side, ...]] = [(letters["M"], matrix)]
    if wide:  # the lower triangle entry by entry
        held = [(variable(f"M_{i}_{j}"), matrix[i][j]) for i in range(n) for j in range(i + 1)]
    held += [(letters[name], [[entry] for entry in column]) for name, column in kept.items()]
    return _in_general("Torque by matrices", letters, list(kept), held, ", symmetric" * wide)


def _spurious(scene: Scene, formulation: str) -> list[Block]:
    """What a formulation with Euler's step has too much, where it has."""
    verdict, system = formulation_verdict(scene, formulation), scene.system
    quasi = system.kinematics.quasi is not None
    if not verdict.differs or verdict.terms is None or not verdict.excess:
        return []
    terms = {name: node for name, node in verdict.terms.outputs.items() if node.value != 0.0}
    rights = map(_right, _statements(Graph(verdict.terms.inputs, terms)))
    held: list[tuple[Side, ...]] = []
    energy, had = EMBEDDED[formulation]
    for name, right in zip(terms, rights, strict=True):
        if right.value == 0.0:
            continue
        i = name.removeprefix("tau")
        left = variable(f"tau_def{i}") - variable(name)
        slope = variable(f"∂{energy}") / variable(f"∂q{i}")
        held.append((left, right) if quasi else (left, slope, right))
    if system.n > MATRICES or quasi:
        slope = variable(f"∂{energy}") / variable("∂q")
        held.insert(0, (variable("tau_def") - variable("tau"), variable("Gᵀ") * slope if quasi else slope))
    about = (
        f"What the torque {had}, τ_def, has too much, however small the time step dt is: q = q̇ dt + q_old makes the "
        "momentum depend on q̇ through q as well. A further part, dt times the rate of this one, tends to 0 with dt. "
        f"{verdict.taken}"
    ).strip()
    return [Block(f"Spurious term, {formulation.replace('_', ' ')}", held, about, wrong=True)]

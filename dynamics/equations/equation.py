"""An equation of motion is a row: the inputs and outputs of its graph, their shapes and units, and their derivation."""

from __future__ import annotations

import re
import string
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import update_wrapper
from inspect import cleandoc, signature
from itertools import product
from types import FunctionType
from typing import ParamSpec, Protocol, TypeVar

import cgraph as cg
from cgraph import Graph, Node, _shared

from ..systems.model import Model, as_system, display_names
from ..systems.system import System

LARGEST_REWRITTEN = 200  # nodes of a graph whose outputs are written anew
SIZES = ("n", "2n", "nq")  # of a system, in the shape of an output
VARIABLES = ("q", "qd", "qdd", "tau")
WIDTH = 116  # letters of a line in a docstring
COMMON = {  # parameters that mean the same in every function that has them
    "model": "model : Model\n    A system, a mechanism or a scene, with nq coordinates and n velocities.",
    "q": "q : array_like, (nq,)\n    Coordinates [rad or m].",
    "qd": "qd : array_like, (n,)\n    Velocities [rad/s or m/s].",
    "tau": "tau : array_like, (n,)\n    Applied forces [N m or N], by default 0.",
    "form": 'form : {"velocity", "momentum"}\n    Of x, as of `simulate`.',
    "t": "t : float\n    Time [s], for a model that depends on it.",
    "parameters": "parameters : mapping of str to float, optional\n    Values in place of the model's own.",
}
NO_MODEL = "TypeError\n    For what is no model, or has no Lagrangian."
SECTIONS = ("Parameters", "Returns", "Warns", "Raises", "Examples")

Derivation = Callable[[System], Iterable[Sequence[Node]]]
Documented = TypeVar("Documented", bound=Callable[..., object])
More = ParamSpec("More")


class GraphOfModel(Protocol[More]):
    """A public function from a model, and more, to a graph."""

    def __call__(self, model: Model, *more: More.args, **named: More.kwargs) -> Graph:
        """The graph of the model."""


EQUATIONS: dict[str, Equation] = {}
"""Rows by the name of their public function, of the files that are imported."""


@dataclass(frozen=True)
class Output:
    """A number, a vector or a matrix among the outputs of an equation.

    names: with a place for each index, as "E", "tau{}", "M_{}_{}".  shape: of "n", "2n", "nq" and numbers as "3".
    unit: in SI.
    """

    names: str
    shape: tuple[str, ...] = ()
    unit: str = ""

    def __post_init__(self) -> None:
        """Raise ValueError unless each index has a place: outputs of one name would be one, the last."""
        places = sum(field is not None for _, field, _, _ in string.Formatter().parse(self.names))
        if places != len(self.shape):
            raise ValueError(
                f"output {self.names!r} of shape {self.shape} needs a place {{}} for each index, {len(self.shape)} in "
                f"all, got {places}: as 'tau{{}}' of ('n',)"
            )
        for each in self.shape:
            if each not in SIZES and not (isinstance(each, str) and each.isdecimal()):
                raise ValueError(
                    f"a size of output {self.names!r} is one of {', '.join(SIZES)} or a number as '3', got {each!r}"
                )

    def of(self, system: System) -> list[str]:
        """The names of its entries, row by row."""
        sizes = dict(zip(SIZES, (system.n, 2 * system.n, system.nq), strict=True))
        counts = [sizes[each] if each in sizes else int(each) for each in self.shape]
        return [self.names.format(*index) for index in product(*map(range, counts))]

    def __str__(self) -> str:
        first, unit = self.names.format(*[0] * len(self.shape)), f" [{self.unit}]" if self.unit else ""
        if not self.shape:
            return f"{first}{unit}"
        if len(self.shape) == 1:
            return f"{first}.., ({self.shape[0]},){unit}"
        return f"{first}, {self.names.format(0, 1)}, .. row by row, ({', '.join(self.shape)}){unit}"


class Equation:
    """The row of an equation: what its graph takes and gives.

    It decorates a derivation, which yields the nodes of all outputs in one or more forms: the smallest graph counts.
    `describes` decorates a function that makes its graph itself. Both write the tables of the docstring.
    inputs: kinds of variables, as "q qd tau"; t and parameters follow.  rewritten: whether `shortened` is asked.
    """

    def __init__(self, inputs: str, *outputs: Output, rewritten: bool = True) -> None:
        self.inputs, self.outputs, self.rewritten = tuple(inputs.split()), outputs, rewritten
        if unknown := [kind for kind in self.inputs if kind not in (*VARIABLES, "p")]:
            raise ValueError(f"inputs of an equation are among {', '.join(VARIABLES)}, p, got {unknown[0]!r}")

    def __call__(self, derivation: Derivation) -> GraphOfModel[[]]:
        """The public function of a derivation."""

        def smallest(system: System) -> Graph:
            return min([cg.simplify(self.graph(system, nodes)) for nodes in derivation(system)], key=_size)

        def graph(model: Model) -> Graph:
            system = as_system(model)
            return called(shortened(system, smallest) if self.rewritten else smallest(system), model)

        update_wrapper(graph, derivation, ("__module__", "__name__", "__qualname__", "__doc__"))
        graph.__signature__ = signature(graph, follow_wrapped=False)  # type: ignore[attr-defined]
        graph.__annotations__ = {"model": Model, "return": Graph}  # not the derivation's, whose source is shown
        return self.describes(graph)

    def graph(self, system: System, nodes: Sequence[Node]) -> Graph:
        """The graph of the outputs of a system, given row by row, not simplified."""
        names = [name for output in self.outputs for name in output.of(system)]
        if len(nodes) != len(names):
            raise ValueError(f"a derivation must give a node for each of {len(names)} outputs, gave {len(nodes)}")
        variables = dict(zip(VARIABLES, (system.q, system.qd, system.qdd, system.tau), strict=True))
        return system.graph(dict(zip(names, nodes, strict=True)), *[variables[kind] for kind in self.inputs])

    def describes(self, function: Documented) -> Documented:
        """The function, with the tables of this equation in its docstring."""
        EQUATIONS[function.__name__] = self
        return documented(function, self.returns)

    def returns(self, more: str) -> str:
        """Section Returns: inputs, outputs, and more of them."""
        inputs = ", ".join([f"{kind}0.." for kind in self.inputs])
        outputs = f"output{'s' * (len(self.outputs) > 1 or bool(self.outputs[0].shape))}"
        text = f"Inputs {inputs}, t if needed, parameters; {outputs} {'; '.join(map(str, self.outputs))}. {more}"
        return f"Graph\n{textwrap.indent(textwrap.fill(' '.join(text.split()), WIDTH), '    ')}"


def called(graph: Graph, model: Model) -> Graph:
    """The graph, which a notebook draws with the names that a person calls its inputs and outputs by."""
    return _shared.remarked(graph, lambda _: _shared.Remarks(display_names(model)))


def documented(
    function: Documented,
    returns: Callable[[str], str] = str,
    known: Mapping[str, str] = COMMON,
    refused: str = NO_MODEL,
) -> Documented:
    """The function, with what its docstring leaves out: parameters that mean the same everywhere, and what is no model.

    returns: what stands under Returns, from what is said there.  known: parameters.  refused: what stands under Raises,
    unless its first error does.
    """
    assert isinstance(function, FunctionType)
    if function.__doc__ is None:  # python -OO
        return function
    head, *found = re.split(r"^(\w+)\n-+\n", cleandoc(function.__doc__), flags=re.MULTILINE)
    sections = dict(zip(found[::2], map(str.strip, found[1::2]), strict=True))
    told: dict[str, str] = {}
    for entry in filter(None, re.split(r"\n(?=\S)", sections.get("Parameters", ""))):
        told |= {name.strip(): entry for name in entry.partition("\n")[0].partition(" : ")[0].split(",")}
    parameters = [told.get(name) or known[name] for name in signature(function).parameters]
    raised = sections.get("Raises", "")
    sections["Parameters"] = "\n".join(dict.fromkeys(parameters))
    sections["Returns"] = returns(sections.get("Returns", ""))
    sections["Raises"] = raised if refused.split(maxsplit=1)[0] in raised else f"{raised}\n{refused}".strip()
    tables = [f"{name}\n{'-' * len(name)}\n{sections[name]}\n" for name in SECTIONS if name in sections]
    function.__doc__ = "\n".join([f"{head.strip()}\n", *tables])
    return function


@_shared.without_collection()
def shortened(system: System, derive: Callable[[System], Graph], *, mirrored: bool = False) -> Graph:
    """derive(system), or of the system's energies written anew by identities, or its outputs so, if that is smaller.

    mirrored: whether outputs are the same up to their sign, which to be to the last bit they must not be written anew.
    """
    if system.body_terms is not None:  # they write their energy as short as it is
        return derive(system)
    graphs = sorted([derive(form) for form in (system, system.shortened) if form is not None], key=_size)
    best = graphs[0]
    for graph in graphs:
        if not mirrored and len(graph.nodes) <= LARGEST_REWRITTEN:
            below = None if graph is graphs[0] else len(best.nodes)
            outputs = dict(zip(graph.outputs, _shared.shortened(list(graph.outputs.values()), below), strict=True))
            best = min(best, cg.simplify(Graph(graph.inputs, outputs)), key=_size)
    return best


def _size(graph: Graph) -> int:
    return len(graph.nodes)


def entries(rows: Sequence[Sequence[Node]]) -> list[Node]:
    """The entries of a matrix, row by row."""
    return [entry for row in rows for entry in row]


def mirrored(lower: Sequence[Sequence[Node]]) -> list[list[Node]]:
    """The symmetric matrix of its lower triangle."""
    n = len(lower)
    return [[lower[max(i, j)][min(i, j)] for j in range(n)] for i in range(n)]

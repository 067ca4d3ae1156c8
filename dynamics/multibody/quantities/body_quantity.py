"""A quantity of bodies is a row: the inputs and outputs of its graph, and their derivation from a mechanism."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial, update_wrapper
from inspect import signature
from typing import Concatenate

import cgraph as cg
from cgraph import Graph, Node

from ...equations.equation import Equation, GraphOfModel, More, documented
from ...systems.model import Model
from ..trees.mechanism import Mechanism, require_mechanism

MECHANISM = {"model": "model : Model\n    A mechanism, or a scene of one."}
NO_BODIES = "MechanismError\n    For a model without bodies."

of_bodies = partial(documented, known=MECHANISM, refused=NO_BODIES)
"""As `documented`, of a function whose model needs bodies."""


def body_quantity(
    row: Equation, known: Mapping[str, str] = MECHANISM, refused: str = NO_BODIES
) -> Callable[[Callable[Concatenate[Mechanism, More], Iterable[Node]]], GraphOfModel[More]]:
    """The decorator of a derivation, the nodes of all outputs of a mechanism: it makes the public function of a model.

    known, refused: as of `documented`.
    """

    def decorate(derivation: Callable[Concatenate[Mechanism, More], Iterable[Node]]) -> GraphOfModel[More]:
        def graph(model: Model, *more: More.args, **named: More.kwargs) -> Graph:
            mechanism = require_mechanism(model, derivation.__name__)
            return cg.simplify(row.graph(mechanism.system, [*derivation(mechanism, *more, **named)]))

        update_wrapper(graph, derivation)
        first, *others = signature(derivation).parameters.values()
        taken = [first.replace(name="model", annotation="Model"), *others]
        graph.__signature__ = signature(derivation).replace(parameters=taken, return_annotation="Graph")  # type: ignore[attr-defined]
        graph.__annotations__ = {each.name: each.annotation for each in taken} | {"return": "Graph"}
        return documented(graph, row.returns, known, refused)

    return decorate

"""Graph values: a graph evaluated over decimal numbers."""

from collections.abc import Callable, Mapping, Sequence
from decimal import Decimal

from cgraph import Graph, Node
from cgraph._shared import columns
from cgraph.extend import topological

from .decimal_numbers import mpmath_context, number, value, working

Entry = tuple[int, Callable[..., Decimal], list[int]]  # where the result goes, of which function, of the numbers where


class GraphValues:
    """A graph over decimal numbers; what its constants alone decide is computed once.

    constants: {name of an input: number}; the other inputs are given in calls.  value_of: the function of a node.
    """

    def __init__(
        self,
        graph: Graph,
        constants: Mapping[str, object],
        value_of: Callable[[Node], Callable[..., Decimal]],
    ) -> None:
        self._numbers: list[Decimal] = []
        self._steps: list[Entry] = []
        places: dict[Node, int] = {}
        moving: set[int] = set()
        for node in (*graph.inputs, *topological(graph.outputs.values())):
            if node in places:
                continue
            k = places[node] = len(self._numbers)
            args = [places[arg] for arg in node.args]
            known = Decimal(0)  # until a call
            if node.value is not None:
                known = number(node.value)
            elif node.name in constants and not args:
                known = number(constants[str(node.name)])
            elif args and moving.isdisjoint(args):
                known = value_of(node)(*[self._numbers[arg] for arg in args])
            else:
                moving.add(k)
                self._steps += [(k, value_of(node), args)] if args else []
            self._numbers.append(known)
        self._inputs = [places[node] for node in graph.inputs if node.name not in constants]
        self._outputs = [places[node] for node in graph.outputs.values()]

    def __call__(self, inputs: Sequence[Decimal]) -> list[Decimal]:
        """The outputs, in their order."""
        numbers = self._numbers
        for k, each in zip(self._inputs, inputs, strict=True):
            numbers[k] = each
        for k, function, args in self._steps:
            numbers[k] = function(*[numbers[arg] for arg in args])
        return [numbers[k] for k in self._outputs]


def values_in_digits(graph: Graph, inputs: Sequence[float], digits: int) -> list[Decimal]:
    """The outputs, computed with so many digits. Raises ImportError without mpmath."""
    mp = mpmath_context(digits)
    with working(digits):
        return GraphValues(graph, {}, lambda node: value(columns(node.op), mp))([number(x) for x in inputs])

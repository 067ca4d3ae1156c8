"""Call, Map, Sum: a graph once, for every element of registers, and summed over them."""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ...codegen.schedule import products_of
from ...core.checks import GraphError
from ...core.evaluation import Array
from ...core.graph import Graph
from ...core.node import Node
from ...writing.naming import variables
from ..statement import Execution, Lengths, Names, Statement, require_length

if TYPE_CHECKING:
    from ..writer import Writer

State = dict[str, list[float]]


@dataclass(frozen=True)
class Call(Statement):
    """outputs = graph(inputs), where registers end to end are the graph's inputs and outputs in order.

    exact: whether products are rounded by themselves in machine code too, so that what cancels is 0.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call
    >>> a, b = cg.variables("a b")
    >>> swap = Call(cg.Graph([a, b], {"first": b, "second": a}), ("pair",), ("pair",))
    """

    graph: Graph
    inputs: Names
    outputs: Names
    products: Mapping[Node, Node] | None = field(default=None, compare=False)  # of a fused one, see `products_in`
    exact: bool = field(default=False, kw_only=True)


@dataclass(frozen=True)
class Map(Statement):
    """outputs[i] = graph(shared, inputs[i]) for every element i.

    inputs, outputs: registers which, end to end, are the inputs and outputs of the graph, each with the numbers of all
    n elements: its number k of element i is at k n + i. An input of length 1 has the same value for every element.
    shared: registers which, end to end, are the graph's first inputs, the same for every element.
    asked: a register that says how many elements matter, the first ones and at least one; others may be left out.

    >>> import cgraph as cg
    >>> from cgraph.extend import Map
    >>> x, h = cg.variables("x h")
    >>> scale = Map(cg.Graph([x, h], {"y": x * h}), ("values", "step"), ("values",))
    """

    graph: Graph
    inputs: Names
    outputs: Names
    shared: Names = ()
    asked: Names = ()


@dataclass(frozen=True)
class Sum(Statement):
    """outputs = sum over i of graph(shared, inputs[i]), from the first element to the last.

    inputs, shared: as of `Map`.  outputs: registers which, end to end, are the sums of the graph's outputs.

    >>> import cgraph as cg
    >>> from cgraph.extend import Sum
    >>> x = cg.variable("x")
    >>> norm = Sum(cg.Graph([x], {"square": x * x}), ("values",), ("total",))
    """

    graph: Graph
    inputs: Names
    outputs: Names
    shared: Names = ()


def products_in(call: Call) -> Mapping[Node, Node]:
    """{sum or difference: its argument, a product that it is rounded with}, where arithmetic fuses them."""
    return products_of(call.graph) if call.products is None else call.products


def elements(statement: Map | Sum, lengths: Lengths) -> int:
    """The number of elements that a statement runs over."""
    if isinstance(statement, Map):
        results = len(statement.graph.outputs)
        return _total(lengths, statement.outputs) // results if results else 1
    wide = [lengths[name] for name in statement.inputs if lengths[name] != 1]
    single = len(statement.inputs) - len(wide) + _total(lengths, statement.shared)
    return sum(wide) // max(1, len(statement.graph.inputs) - single) if wide else 1


def sizes(statement: Map | Sum, lengths: Lengths, names: Names) -> tuple[int, ...]:
    """The numbers that an element has in each of some registers."""
    count = max(1, elements(statement, lengths))
    return tuple([max(1, lengths[name] // count) for name in names])


def several(statement: Map | Sum, lengths: Lengths) -> bool:
    """Whether an element has several numbers in a register."""
    fewer = len(statement.inputs) + _total(lengths, statement.shared) < len(statement.graph.inputs)
    return fewer or (isinstance(statement, Map) and len(statement.outputs) < len(statement.graph.outputs))


def _total(lengths: Lengths, names: Names) -> int:
    return sum([lengths[name] for name in names])


def copied(source: str | None, target: str) -> Map:
    """Statement target = source, of registers of one length; target = 0 where the source is None.

    >>> from cgraph.extend import copied
    >>> copied("x_new", "x").outputs
    ('x',)
    """
    return Map(_ZERO, (target,), (target,)) if source is None else Map(_SAME, (source,), (target,))


def added(total: str, term: str, result: str) -> Map:
    """Statement result = total + term, of registers of one length.

    >>> from cgraph.extend import added
    >>> added("x", "change", "x").inputs
    ('x', 'change')
    """
    return Map(_ADDED, (total, term), (result,))


_A, _B = variables("a b")
_SAME = Graph([_A], {"a": _A})
_ZERO = Graph([_A], {"zero": 0.0})
_ADDED = Graph([_A, _B], {"sum": _A + _B})


def _text(statement: Call | Map | Sum) -> str:
    """The statement as an error calls it."""
    inputs, outputs = statement.graph.input_names[:4], list(statement.graph.outputs)[:4]
    return f"{type(statement).__name__} of a graph {', '.join(inputs)} -> {', '.join(outputs)}"


def check_call(call: Call, lengths: Lengths) -> None:
    """Raises GraphError if the registers do not hold as many numbers as the graph has inputs and outputs."""
    _require_total(call, lengths, "inputs", call.inputs, len(call.graph.inputs))
    _require_total(call, lengths, "outputs", call.outputs, len(call.graph.outputs))


def check_elements(statement: Map | Sum, lengths: Lengths) -> None:
    """Raises GraphError if registers have neither one length nor length 1, or are too many or too few."""
    where, graph, outputs = _text(statement), statement.graph, statement.outputs
    if (known := _total(lengths, statement.shared)) > len(graph.inputs):
        raise GraphError(f"{where} has {len(graph.inputs)} inputs, the shared registers hold {known}")
    registers = [(statement.inputs, len(graph.inputs) - known)]
    if isinstance(statement, Map):
        registers.append((outputs, len(graph.outputs)))
        for name in statement.asked:
            require_length(lengths, where, name, 1)
    else:
        _require_total(statement, lengths, "outputs", outputs, len(graph.outputs))
    count = elements(statement, lengths)
    for names, wanted in registers:
        of_each = sizes(statement, lengths, names)
        if sum(of_each) != wanted:
            raise GraphError(f"{where} needs {wanted} registers, got {sum(of_each)}: {', '.join(names)}")
        for name, size in zip(names, of_each, strict=True):
            if lengths[name] != count * size and (lengths[name] != 1 or names is outputs):
                raise GraphError(f"{where}: register {name!r} needs length {count} or 1, got {lengths[name]}")


def _require_total(statement: Call | Sum, lengths: Lengths, what: str, names: Names, wanted: int) -> None:
    if (total := _total(lengths, names)) != wanted:
        raise GraphError(f"{_text(statement)} needs {wanted} {what}, the registers {', '.join(names)} hold {total}")


def run_call(call: Call, state: State, execution: Execution) -> None:
    """Run in Python."""
    spread(list(execution.values(call.graph, _joined(state, call.inputs))), call.outputs, state)


def run_map(statement: Map, state: State, execution: Execution) -> None:
    """Run in Python, element by element; as one batch where registers are arrays, or hold several numbers of each."""
    lengths, at = execution.lengths, 0
    if not several(statement, lengths) and isinstance(state[statement.outputs[0]], list):
        columns = zip(*_rows(statement, state, execution), strict=True)
        state.update(zip(statement.outputs, map(list, columns), strict=False))
        return
    count = elements(statement, lengths)
    for name in statement.asked:
        count = int(min(max(1.0, state[name][0]), count))
    results = _at_once(statement, state, (count,), execution)
    for name, size in zip(statement.outputs, sizes(statement, lengths, statement.outputs), strict=True):
        numbers = np.asarray(state[name], dtype=np.float64).reshape(size, -1)
        numbers[:, :count] = results[at : at + size]
        if isinstance(state[name], list):  # an array has them already
            state[name] = numbers.ravel().tolist()
        at += size


def run_sum(statement: Sum, state: State, execution: Execution) -> None:
    """Run in Python, added up in order."""
    rows = _rows(statement, state, execution)
    columns = zip(*rows, strict=True) if rows else [()] * len(statement.graph.outputs)
    totals = [functools.reduce(operator.add, terms, 0.0) for terms in columns]  # sum() compensates
    spread(totals, statement.outputs, state)


def _rows(statement: Map | Sum, state: State, execution: Execution) -> list[Sequence[float]]:
    """The outputs for every element."""
    count = elements(statement, execution.lengths)
    inputs = [[value] * count for value in _joined(state, statement.shared)]
    for name in statement.inputs:
        numbers = state[name]
        one_for_all = len(numbers) == 1
        inputs += [numbers * count] if one_for_all else [numbers[k : k + count] for k in range(0, len(numbers), count)]
    points = zip(*inputs, strict=True) if inputs else [()] * count
    return [execution.values(statement.graph, values) for values in points]


def _joined(state: Mapping[str, list[float]], names: Sequence[str]) -> list[float]:
    return state[names[0]] if len(names) == 1 else [value for name in names for value in state[name]]


def spread(values: Any, names: Sequence[str], state: dict[str, Any]) -> None:
    """Put numbers, a list or rows of an array, end to end into registers."""
    at = 0
    for name in names:
        length = len(state[name])
        state[name] = values[at : at + length]
        at += length


def call_beside(call: Call, state: dict[str, Array], execution: Execution) -> None:
    """Run many memories: a batch."""
    points = np.concatenate([state[name] for name in call.inputs]) if call.inputs else np.empty((0, execution.many))
    spread(execution.batch(call.graph, points), call.outputs, state)


def elements_beside(statement: Map | Sum, state: dict[str, Array], execution: Execution) -> None:
    """Run many memories: all elements as one batch."""
    count, many = elements(statement, execution.lengths), execution.many
    results = _at_once(statement, state, (count, many), execution)
    if isinstance(statement, Map):
        results = results.reshape(len(results) * count, many)
    else:
        results = np.add.accumulate(results, axis=1)[:, -1] if count else np.zeros((len(results), many))
    spread(results, statement.outputs, state)


def _at_once(statement: Map | Sum, state: dict[str, Any], shape: tuple[int, ...], execution: Execution) -> Array:
    """The outputs for the first elements, of one memory or of many, (outputs, elements, ..), as one batch."""
    rows = [np.broadcast_to(value, shape) for name in statement.shared for value in state[name]]
    for name, size in zip(statement.inputs, sizes(statement, execution.lengths, statement.inputs), strict=True):
        numbers = np.asarray(state[name])
        numbers = numbers.reshape(size, len(numbers) // size, *shape[1:])[:, : shape[0]]
        rows += [np.broadcast_to(row, shape) for row in numbers]
    points = np.array(rows).reshape(len(rows), math.prod(shape))
    return execution.batch(statement.graph, points).reshape(len(statement.graph.outputs), *shape)


def call_text(call: Call, writer: Writer) -> None:
    """Write as machine code."""
    registers = list(dict.fromkeys((*call.inputs, *call.outputs)))
    reads, writes = (tuple([registers.index(name) for name in names]) for names in (call.inputs, call.outputs))
    in_memory = id(call.graph) in writer.alone and all(name in writer.offsets for name in registers)
    begins = tuple([writer.offsets[name] for name in registers]) if in_memory else ()
    how, lengths = (call.products, call.exact, begins), writer.lengths(registers)
    name = writer.functions.call(call.graph, lengths, reads, writes, *how)
    writer.call(name, ["%memory"] if begins else [writer.pointer(register) for register in registers])


def map_text(statement: Map, writer: Writer) -> None:
    """Write as machine code, in vectors of elements."""
    if elements(statement, writer.registers):
        inputs = (*statement.shared, *statement.inputs, *statement.asked)
        name = _of_elements(statement, writer.lengths(statement.outputs), writer)
        writer.calls(name, inputs, statement.outputs)


def sum_text(statement: Sum, writer: Writer) -> None:
    """Write as machine code: all terms, in vectors of elements, then added up in order."""
    count = elements(statement, writer.registers)
    terms = [writer.beside(count) for _ in statement.graph.outputs]
    if count:
        inputs = [writer.pointer(name) for name in (*statement.shared, *statement.inputs)]
        writer.call(_of_elements(statement, (count,) * len(terms), writer), [*inputs, *terms])
    totals = [writer.place(name, k) for name in statement.outputs for k in range(writer.registers[name])]
    for term, total in zip(terms, totals, strict=True):
        writer.call(writer.functions.total(count), [term, total])


def _of_elements(statement: Map | Sum, outputs: tuple[int, ...], writer: Writer) -> str:
    """The function that runs the graph for every element, where results have these lengths."""
    before, of, count = writer.before, writer.lengths, elements(statement, writer.registers)
    apart = tuple([name in before.outputs for name in statement.inputs]) if isinstance(before, Call) else ()
    asked = isinstance(statement, Map) and bool(statement.asked)
    lengths = of(statement.shared), of(statement.inputs), outputs
    return writer.functions.map(statement.graph, *lengths, count, apart, asked)

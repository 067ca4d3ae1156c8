"""WebAssembly: a graph as a module, by instructions straight from its nodes."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

from ...core.graph import Graph
from ...operations.operation import columns
from ...util.require import require_graph, require_sequence
from ..explicit_method import Tableau, checked_methods
from . import instructions as ins
from .elementary_functions import ROOM
from .evaluation import evaluation
from .functions import HOST, WAVE_TABLE, called, library, text_of
from .instructions import F64, I32
from .steps import Layout, chosen_steps, equal_steps
from .translate import Body, Signature, types_of

PAGE = 65536  # bytes of memory
Kind = tuple[tuple[int, ...], tuple[int, ...]]  # of a function: parameters and results
EVALUATE: Kind = (I32, I32), ()


def to_wasm(
    graph: Graph, methods: Mapping[str, Tableau] | None = None, *, time: str = "t", host: Collection[str] = ()
) -> bytes:
    r"""A WebAssembly module that computes the graph, and steps of integration; the same bytes on every machine.

    It exports

    memory
        Doubles, little-endian: inputs belong at byte 0 and outputs behind them, at 8 N_IN, both in the graph's order.
        What follows is the module's; room for more comes from `memory.grow`.
    evaluate(x, y)
        Outputs at byte y of inputs at byte x.
    name(x, h, n), of each method
        n steps of size h from the inputs at x, where the state and the time are those at the end afterwards.
    name_to(x, span, h, rtol, atol, most), of each method with one estimate of its error
        Over the span by steps that the estimate chooses, the first h: its root mean square over the state, each by
        atol + rtol size, is at most 1. Returns the step to go on with, and NaN where `most` trials were not enough.

    Arithmetic is that of `evaluate`, in the same order and without fused multiply-add: where no function of the C
    library intervenes, to the last bit. sin, cos, exp, log and the others are the module's own, the same bits on every
    machine, and within an ulp or so, erfc 8, of exact values; those of a C library differ from them now and then in
    the last bit. An operation that was added without a text of known functions in its column `python` is imported,
    from `math`, by its name.

    Parameters
    ----------
    graph : Graph
        What is computed. With methods, a state equation such as `dynamics.state_equation(model)`: its first inputs are
        the state, and output k is the rate of input k.
    methods : mapping of str to Tableau, optional
        {name of the export: explicit Runge-Kutta method}, such as `dynamics.integrators.TABLEAUS`.
    time : str
        The input that is the time, if there is one of this name, which steps move.
    host : collection of str
        Functions to import from `math` in place of the module's own, such as ("sin", "cos"), which a page gets as
        `{math: Math}`: a smaller module, whose last bits are those of the browser.

    Returns
    -------
    bytes
        The module.

    Raises
    ------
    GraphError
        With methods, for a graph that has more outputs than inputs.
    TypeError
        For what is no Graph, methods that are no mapping to tableaus, or a time that is no name.
    ValueError
        For a method called evaluate or memory, a function of the host that the module has not, or an operation whose
        column `python` has more than `Op` says.

    Examples
    --------
    >>> import cgraph as cg
    >>> x = cg.variable("x")
    >>> module = cg.to_wasm(cg.Graph([x], {"y": x * x + 1.0}))
    >>> module[:4], len(module)
    (b'\x00asm', 75)
    """
    require_graph("to_wasm", graph)
    host = require_sequence("host", host, "names of functions", str)
    chosen = checked_methods(methods, graph, time)
    inputs, states = len(graph.inputs), len(graph.outputs)
    _check(chosen, host)
    place = 8 * (inputs + states)
    texts = {op: text_of(columns(op), host) for op in dict.fromkeys([node.op for node in graph.nodes if node.args])}
    needed = called(texts.values(), place)
    imported = [name for name in needed if name.startswith(HOST)]
    own = [text for name, text in library(place).items() if name in needed]
    data = WAVE_TABLE if "wave" in needed else b""
    free = place + (ROOM + 7) // 8 * 8 * bool(data)
    at = graph.input_names.index(time) if time in graph.input_names else None
    layout = Layout(inputs, states, at, free)
    stepping = {name: equal_steps(f"steps {name}", each, layout) for name, each in chosen.items()}
    embedded = {name: each for name, each in chosen.items() if len(getattr(each, "error", ())) == 1}
    stepping |= {f"{name}_to": chosen_steps(f"steps {name}_to", each, layout) for name, each in embedded.items()}
    own += stepping.values()
    end = layout.slope(1 + max([len(each.b) for each in chosen.values()])) if chosen else free

    kinds = [*[((F64,) * needed[name], (F64,)) for name in imported], EVALUATE, *[types_of(text) for text in own]]
    names = [*imported, "evaluate", *[text.name for text in own]]
    signatures = {name: Signature(k, *kind) for k, (name, kind) in enumerate(zip(names, kinds, strict=True))}
    codes = [evaluation(graph, texts, signatures)]
    for text in own:
        parameters = [(each.arg, kind) for each, kind in zip(text.args.args, types_of(text)[0], strict=True)]
        codes.append(Body(signatures, parameters).function(text))
    exported = {"evaluate": len(imported)}
    exported |= {name: signatures[text.name].number for name, text in stepping.items()}
    return _module(kinds, [name.removeprefix(HOST) for name in imported], codes, exported, end, (place, data))


def _check(methods: Collection[str], host: Collection[str]) -> None:
    """Raise what is wrong about names that are asked for."""
    for name in methods:
        if not isinstance(name, str) or name in ("evaluate", "memory"):
            raise ValueError(f"a method must not be called {name}, which is exported already or no text")
    if unknown := [name for name in host if name not in library(0)]:
        raise ValueError(f"a module has no function {unknown[0]!s:.60} of its own to leave to the host")


def _module(
    kinds: Sequence[Kind],
    imported: Sequence[str],
    codes: list[bytes],
    exported: Mapping[str, int],
    end: int,
    data: tuple[int, bytes],
) -> bytes:
    """The sections of a module, around the code."""
    types = list(dict.fromkeys(kinds))
    of = [ins.unsigned(types.index(kind)) for kind in kinds]
    exports = [ins.sized(name.encode()) + b"\x00" + ins.unsigned(index) for name, index in exported.items()]
    sections = {
        1: [b"\x60" + ins.sized(bytes(parameters)) + ins.sized(bytes(results)) for parameters, results in types],
        2: [b"\x04math" + ins.sized(name.encode()) + b"\x00" + of[k] for k, name in enumerate(imported)],
        3: of[len(imported) :],
        5: [b"\x00" + ins.unsigned(-(-end // PAGE))],
        7: [b"\x06memory\x02\x00", *exports],
        10: codes,
        11: [b"\x00\x41" + ins.signed(data[0]) + ins.END + ins.sized(data[1])] if data[1] else [],
    }
    parts = [bytes([number]) + ins.sized(ins.counted(items)) for number, items in sections.items() if items]
    return b"\x00asm\x01\x00\x00\x00" + b"".join(parts)

"""LLVM's text for a graph: straight lines, an instruction or a few for each node, over floats or over vector lanes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from ..core.graph import Graph
from ..core.node import CONSTANT, Node
from ..operations.operation import OPS, columns
from ..operations.texts import LLVM_ONE_OR_ZERO, LLVM_WHERE
from .function_writer import REGISTERS, Arithmetic, FunctionWriter, bits, words_of
from .schedule import STEPS, Joined, Merged, Parts, joined_calls, products_of, schedule
from .vector_math import POLYNOMIAL, helpers
from .vector_sums import Sums, Vectors, vector_sums

TOGETHER = 4  # arguments in a joined call at one point: a vector of them is one register or two on every processor

# Lines that compute, under a name, the address of row k of the inputs ("x") or outputs ("y"): (base, name, k) -> lines
Address = Callable[[str, str, int], list[str]]


def libm_functions(graph: Graph) -> dict[str, int]:
    """The functions of the C library that the graph calls, and how many arguments each takes."""
    calls = {
        columns(node.op).library: node.op.arity for node in graph.nodes if node.args and columns(node.op).calls_library
    }
    return dict(sorted(calls.items()))


def point_arithmetic(flags: str, registers: int = REGISTERS) -> Arithmetic:
    """Arithmetic for one point at a time."""
    return Arithmetic(flags, registers=registers, together=TOGETHER)


def scalar_ir(graph: Graph, flags: str = "", registers: int = REGISTERS) -> str:
    """A module with `void point(double *x, double *y, double *)`: the outputs y at the inputs x."""
    arithmetic = point_arithmetic(flags, registers)
    ir = FunctionWriter(arithmetic)
    places = {"x": [f"double, ptr %x, i64 {k}" for k in range(len(graph.inputs))]}
    places["y"] = [f"double, ptr %y, i64 {k}" for k in range(len(graph.outputs))]
    definitions = write_graph(ir, "point", graph, places, ["%x", "%y"])
    point = ir.function("void @point(ptr noalias %x, ptr noalias %y, ptr) nounwind")
    return "\n".join([*preamble([graph], arithmetic), *definitions, *point, ""])


def preamble(graphs: Iterable[Graph], arithmetic: Arithmetic) -> list[str]:
    """Declarations before the bodies of these graphs: functions of the C library, and those on vectors."""
    libm: dict[str, int] = {}
    called: dict[str, int] = {}
    for graph in graphs:
        libm |= libm_functions(graph)
        calls = _joined_calls(graph, arithmetic)
        called |= {"".join(call.names): 1 for call in calls.values()}
        if arithmetic.lanes > 1:
            alone = {columns(node.op).library for node in graph.nodes if node not in calls}
            called |= {name: arity for name, arity in libm_functions(graph).items() if name in alone}
    vector = _vector(arithmetic)
    # nobuiltin: LLVM would make pow(x, 2) into x * x, which differs in the last bit. Nobody reads errno.
    declarations = [
        f"declare double @{name}({', '.join(['double'] * arity)}) nounwind willreturn memory(none) nobuiltin"
        for name, arity in libm.items()
    ]
    return [*declarations, *helpers(called, vector.lanes, vector.flags, polynomials=vector.polynomials)]


def _joined_calls(graph: Graph, arithmetic: Arithmetic) -> dict[Node, Joined]:
    joined = arithmetic.polynomials and _vector(arithmetic).lanes > 1
    return joined_calls(graph, arithmetic.together) if joined else {}


def _of_libm(graph: Graph, arithmetic: Arithmetic) -> set[Node]:
    """The nodes that have no company in a call at one point, whose bits lanes have to have."""
    if not arithmetic.alike or not arithmetic.polynomials:
        return set()
    joined = joined_calls(graph, TOGETHER)
    return {node for node in graph.nodes if node.args and columns(node.op).library in POLYNOMIAL and node not in joined}


def write_graph(
    ir: FunctionWriter,
    name: str,
    graph: Graph,
    places: Mapping[str, Sequence[str]],
    pointers: Sequence[str],
    **how: Any,
) -> list[str]:
    """Write what computes a graph into the function of that name, in functions of their own if it is long.

    places: where the inputs, "x", and outputs, "y", are: type, pointer, index.  pointers: all of these.  how: see
    `instructions`.  Returns the definitions that the module needs besides: of those functions, and of constants.
    """

    def address(base: str, value: str, row: int) -> list[str]:
        return [f"  {value} = getelementptr {places[base][row]}"]

    of_inputs = set(places["x"])  # an output may lie where an input does
    last = {row for row, place in enumerate(places["y"]) if place in of_inputs}
    code = instructions(graph, ir.arithmetic, address, name, last=last, **how)
    if code.places:
        ir.scratch.append(f"  %w = alloca [{code.places} x {ir.type}], align 64")
    if len(code.parts) == 1:
        ir.scratch += code.start
        ir.lines += code.parts[0]
        return code.definitions
    values = [*pointers, "%w"] if code.places else pointers
    parameters = ", ".join([f"ptr noalias {each}" for each in values])
    definitions = list(code.definitions)
    for number, lines in enumerate(code.parts):
        part = f"@{name}.part{number}"
        ir.line(f"call void {part}({', '.join([f'ptr {each}' for each in values])})")
        definitions += [f"define internal void {part}({parameters}) nounwind noinline {{", "start:"]
        definitions += [*code.start, *lines, "  ret void", "}"]
    return definitions


class Code(NamedTuple):
    """The instructions that compute a graph, part by part.

    start: what stands at the start of every function with a part.  places: how many values pass between parts, in %w.
    definitions: of constants, for the module.
    """

    parts: list[list[str]]
    start: list[str]
    places: int
    definitions: list[str]


def instructions(
    graph: Graph,
    arithmetic: Arithmetic,
    address: Address,
    name: str,
    *,
    uniform: int = 0,
    products: Mapping[Node, Node] | None = None,
    last: Collection[int] = (),
) -> Code:
    """Every operation in the order of `schedule`; an output is stored as soon as it is known.

    uniform: so many inputs, the first, are single numbers in memory, the same for all lanes.  products: where sums may
    be rounded with one, {sum: its product}; by default `products_of` says.  last: rows of outputs that are stored when
    all inputs have been read, since they lie where these do.
    """
    t, words = arithmetic.type, words_of(arithmetic)
    constants = _Constants(graph, arithmetic, name)
    rows = {node: row for row, node in enumerate(graph.inputs)}

    def leaf(node: Node, r: str) -> tuple[str, list[str]]:
        if node.op is CONSTANT:
            return constants.read(node, r)
        if rows[node] < uniform and arithmetic.lanes > 1:
            one = f"  {r}.one = load double, ptr {r}.x, align 8"
            return r, [*address("x", f"{r}.x", rows[node]), one, *arithmetic.splat(r, f"{r}.one")]
        return r, [*address("x", f"{r}.x", rows[node]), f"  {r} = load {t}, ptr {r}.x, align 8"]

    outputs: dict[Node, list[int]] = {}
    for row, node in enumerate(graph.outputs.values()):
        if row not in last:
            outputs.setdefault(node, []).append(row)
    ends = {row: node for row, node in enumerate(graph.outputs.values()) if row in last}

    def store(places: Iterable[int], r: str) -> Iterator[str]:
        for row in places:
            yield from [*address("y", f"%y{row}", row), f"  store {t} {r}, ptr %y{row}, align 8"]

    if not arithmetic.fuses:
        products = {}
    elif products is None:
        products = products_of(graph)
    sums = vector_sums(graph, products) if arithmetic.lanes == 1 else {}  # of one point
    merged = Merged(_joined_calls(graph, arithmetic), products, _of_libm(graph, arithmetic), sums)
    vectors = Vectors(merged.sums)
    order = schedule(graph, merged).items()
    steps = {step: () if isinstance(step, Sums) else reads for step, reads in order if step not in merged.sums}
    end = Joined((), tuple(ends.values()))
    steps[end] = end.arguments
    parts = Parts(steps, merged.calls, t, 8 * arithmetic.lanes, arithmetic.registers, leaf, vectors)
    written: list[list[str]] = [[]]
    for number, (step, reads) in enumerate(steps.items()):
        if number in parts.starts:
            written[-1] += parts.forget()
            written.append([])
        if step is end:
            break
        if isinstance(step, Sums):
            written[-1] += vectors.lines(step, f"%v{number}")
            continue
        args, lines = parts.read(reads)
        if isinstance(step, Joined) or (step not in merged.calls and columns(step.op).calls_library):
            lines += parts.forget()
        r, more = _step(step, f"%v{number}", args, merged, arithmetic, words)
        places = outputs.get(step, []) if isinstance(step, Node) else []
        kept = vectors.store(step, r) if isinstance(step, Node) else []
        written[-1] += [*lines, *more, *kept, *parts.write(step, r), *store(places, r)]
    leaves = [(node, row) for node, places in outputs.items() if not node.args for row in places]
    for number, (node, row) in enumerate(leaves):
        if number % STEPS == STEPS // 2:  # the first of them go to the part that is there
            written[-1:] = [written[-1] + parts.forget(), []]
        r, lines = leaf(node, f"%leaf{row}")
        written[-1] += [*lines, *store([row], r)]
    written[-1] += _last_stores(ends, parts, store)
    return Code(written, constants.start(), parts.places, constants.definitions())


def _last_stores(
    ends: Mapping[int, Node], parts: Parts, store: Callable[[Iterable[int], str], Iterable[str]]
) -> list[str]:
    """The lines that store outputs, {row: node}, where inputs lie: these are read before any is overwritten."""
    lines: list[str] = []
    of_inputs: list[str] = []
    for row, node in sorted(ends.items(), key=lambda end: bool(end[1].args)):
        (r,), reads = parts.read([node])
        lines += reads
        (lines if node.args else of_inputs).extend(store([row], r))
    return lines + of_inputs


class _Constants:
    """A table of a graph's constants behind the code of a function, each once, read by way of its address.

    As an operand, a constant would need its own address, ten bytes where instructions have five to nine; the processor
    waits for the code of a long graph.

    name: of the function.
    """

    def __init__(self, graph: Graph, arithmetic: Arithmetic, name: str) -> None:
        self._arithmetic, self._name = arithmetic, name
        inside = {node.args[1] for node in graph.nodes if node.op is OPS["div"]}  # LLVM divides by 2 with a product
        self._rows: dict[Node, int] = {}
        for node in graph.nodes:
            if node.op is CONSTANT and node.value and node not in inside:
                self._rows[node] = len(self._rows)

    def definitions(self) -> list[str]:
        """The table, and its address in a variable: LLVM would put the address of each row into the instructions."""
        if not self._rows:
            return []
        numbers = ", ".join([f"double {bits(node.value or 0.0)}" for node in self._rows])
        return [
            f"@{self._name}.numbers = internal constant [{len(self._rows)} x double] [{numbers}], align 64",
            f"@{self._name}.constants = internal global ptr @{self._name}.numbers",
        ]

    def start(self) -> list[str]:
        """Lines at the start of a function that reads constants."""
        return [] if not self._rows else [f"  %constants = load ptr, ptr @{self._name}.constants, align 8"]

    def read(self, node: Node, name: str) -> tuple[str, list[str]]:
        """The name of a constant's value, and the lines that bring it there."""
        if node not in self._rows:
            assert node.value is not None
            return self._arithmetic.number(node.value), []
        one = name if self._arithmetic.lanes == 1 else f"{name}.one"
        lines = [
            f"  {name}.at = getelementptr double, ptr %constants, i64 {self._rows[node]}",
            f"  {one} = load double, ptr {name}.at, align 8, !invariant.load !{{}}",
        ]
        return name, lines + (self._arithmetic.splat(name, one) if self._arithmetic.lanes > 1 else [])


def _step(
    step: Node | Joined, r: str, args: list[str], merged: Merged, arithmetic: Arithmetic, words: Mapping[str, str]
) -> tuple[str, list[str]]:
    """The name of a step's value, r or the value that it is part of, and the lines that compute it.

    words: see `words_of`.
    """
    if isinstance(step, Joined):
        return r, _call(step, r, args, arithmetic)
    if step in merged.calls:
        return _result(step, merged.calls[step], r, args[0], arithmetic)
    if step in merged.products:
        return r, _product_and_sum(step, merged.products[step], r, args, arithmetic)
    t, op, kind = arithmetic.type, columns(step.op), "each" if step in merged.of_libm else "lanes"
    call = f"@{f'{kind}{arithmetic.lanes}.' if arithmetic.lanes > 1 else ''}{op.library}"
    condition = step.args[0]
    # The name of a value that is 1 or 0 by a comparison has that with ".is" beside it.
    if op.llvm == LLVM_WHERE and condition.args and columns(condition.op).llvm[-1:] == (LLVM_ONE_OR_ZERO,):
        known = args[0].startswith("%v")
        compared = [] if known else [f"  {r}.is = fcmp one {t} {args[0]}, {words['zero']}"]  # never NaN: one flag
        return r, [*compared, f"  {r} = select {words['b']} {args[0] if known else r}.is, {t} {args[1]}, {t} {args[2]}"]
    if op.llvm:
        return r, [f"  {line.format(*args, r=r, call=call, **words)}" for line in op.llvm]
    return r, [f"  {r} = call {t} {call}({', '.join(f'{t} {arg}' for arg in args)})"]


def _product_and_sum(node: Node, product: Node, r: str, args: list[str], arithmetic: Arithmetic) -> list[str]:
    """a * b + c, c + a * b, a * b - c or c - a * b, rounded once where the processor can."""
    t, lines = arithmetic.type, []
    first = node.args[0] is product
    a, b, c = args if first else [*args[1:], args[0]]
    if node.op is OPS["sub"]:
        lines.append(f"  {r}.minus = fneg {t} {c if first else a}")
        a, c = (a, f"{r}.minus") if first else (f"{r}.minus", c)
    return [*lines, f"  {r} = call {t} @llvm.fmuladd.{arithmetic.suffix}({t} {a}, {t} {b}, {t} {c})"]


def _vector(arithmetic: Arithmetic) -> Arithmetic:
    """Arithmetic of a joined call: the lanes there are, or a vector filled with arguments."""
    return arithmetic._replace(lanes=max(arithmetic.lanes, arithmetic.together))


def _call(call: Joined, r: str, args: list[str], arithmetic: Arithmetic) -> list[str]:
    """The call. Single numbers are gathered in a vector for it; a lane left over holds 1, which suits every one."""
    vector = _vector(arithmetic)
    t, lines, argument = vector.type, [], args[0]
    if arithmetic.lanes == 1:
        argument = vector.number(1.0)
        for lane, arg in enumerate(args):
            lines.append(f"  {r}.in{lane} = insertelement {t} {argument}, double {arg}, i32 {lane}")
            argument = f"{r}.in{lane}"
    kind = t if len(call.names) == 1 else f"{{{t}, {t}}}"
    return [*lines, f"  {r} = call {kind} @lanes{vector.lanes}.{''.join(call.names)}({t} {argument})"]


def _result(node: Node, call: Joined, r: str, called: str, arithmetic: Arithmetic) -> tuple[str, list[str]]:
    """One node out of the results of its call: the value's name, and the lines that make it."""
    t, lines = _vector(arithmetic).type, []
    if len(call.names) > 1:
        lines.append(f"  {r}.all = extractvalue {{{t}, {t}}} {called}, {call.names.index(columns(node.op).library)}")
        called = f"{r}.all"
    if arithmetic.lanes == 1:
        lines.append(f"  {r} = extractelement {t} {called}, i32 {call.arguments.index(node.args[0])}")
        called = r
    return called, lines

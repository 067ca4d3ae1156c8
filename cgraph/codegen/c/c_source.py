"""C source: the two files of a C99 function from an array of inputs to an array of outputs."""

from __future__ import annotations

import ctypes
import math
import os
import re
import unicodedata
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from ...core.graph import Graph
from ...core.node import VARIABLE
from ...operations.operation import columns
from ...util.atomic_write import atomic_write
from ...util.require import require_choice, require_flag, require_graph, require_path, require_texts
from ...util.version import __version__
from ...util.words import counted
from ...writing.structure_hash import structure_hash
from ..statements import Tableau, checked_methods, statements, weighted_sum
from .c_numbers import NUMBERS, POINTS, Box, CNumbers, Errors, checked_box, largest_errors

LONGEST_NAME = 63  # characters of a name that every C compiler looks at
_C = """auto break case char const continue default do double else enum extern float for goto if inline int long
    register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
    alignas alignof bool constexpr false nullptr static_assert thread_local true typeof typeof_unqual asm main"""
_CPP = """and and_eq bitand bitor catch char8_t char16_t char32_t class co_await co_return co_yield compl concept
    const_cast consteval constinit decltype delete dynamic_cast explicit export friend mutable namespace new noexcept
    not not_eq operator or or_eq private protected public reinterpret_cast requires static_cast template this throw
    try typeid typename using virtual wchar_t xor xor_eq"""
_HEADERS = """assert complex ctype errno fenv inttypes iso646 limits locale math setjmp signal stdarg stdbool stddef
    stdint stdio stdlib string tgmath time wchar wctype"""
_MACROS = re.compile(  # and types
    r"[A-Z0-9_]+|\w+_t|(atomic|va)_\w*|(PRI|SCN)\w*|is(finite|normal|unordered|less|greater)\w*|fpclassify|signbit"
)
_TAKEN = frozenset(f"{_C} {_CPP} {_HEADERS}".split())

_HEADER = """\
/* {name}: {counts}, written by cgraph. Units are those of the equations behind it. */
/* cgraph {version}, structure hash {hash}; {options}.
   cgraph claims no rights in this text and in its {name}.c: they are under no license of cgraph's. */
#ifndef {NAME}_H
#define {NAME}_H

#ifdef __cplusplus
extern "C" {{
#endif

/* Places in x, and their number.{ranges} */
enum {{
{inputs}
}};

/* Places in y, and their number.{errors} */
enum {{
{outputs}
}};

/* y[{NAME}_N_OUT] at x[{NAME}_N_IN]; the arrays must not overlap. Any number of threads may call it. */
void {name}(const {type} *x, {type} *y);
{steps}
#ifdef __cplusplus
}}
#endif

#endif
"""
_ERRORS = """
   Beside a place: how far rounding to float takes the output off its exact value. At most, by a bound to first order;
   and as seen where every operation was rounded. Both are the largest of {points} points of these inputs, half of them
   corners, with inputs and constants rounded, too."""
_RANGES = " Beside a place: the range for which errors are stated."

# C++ has no `restrict`, and its compilers a word of their own for it.
_RESTRICT = """\
#ifndef __cplusplus
#define {NAME}_RESTRICT restrict
#elif defined(__GNUC__) || defined(_MSC_VER)
#define {NAME}_RESTRICT __restrict
#else
#define {NAME}_RESTRICT
#endif
"""

# GCC does not know the standard's pragma and, unless told to be strict (-std=c99), fuses where the processor can. Where
# it can tell an argument, behind a comparison for one, it computes a function itself, and rounds otherwise than the
# library; not so under rounding-math.
_CONTRACT = """\
/* {} */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize ("fp-contract={}", "rounding-math")
#else
#pragma STDC FP_CONTRACT {}
#endif
"""
_ROUNDING = {  # {fma: meaning, word of GCC, word of the standard}
    False: ("Every product and every sum is rounded by itself: no fused multiply-add.", "off", "OFF"),
    True: ("A product and the sum that it goes into may be rounded once: fused multiply-add.", "fast", "ON"),
}

_STEPS = """\
void {name}_{method}({type} *{NAME}_RESTRICT x, {type} h, unsigned long n)
{{
    {type} at[{NAME}_N_IN], slope[{stages}][{NAME}_N_OUT];{start}
    unsigned long step;
    int stage, i;

    for (i = 0; i < {NAME}_N_IN; i++) {{
        at[i] = x[i];
    }}
    for (step = 1; step <= n; step++) {{
        for (stage = 0; stage < {stages}; stage++) {{
            switch (stage) {{
{cases}
            default:
                break;
            }}
            {name}(at, slope[stage]);
        }}
        for (i = 0; i < {NAME}_N_OUT; i++) {{
            x[i] = x[i] + h * ({ahead});
            at[i] = x[i];
        }}{end}
    }}
}}
"""
_CASE = """\
            case {stage}:
                for (i = 0; i < {NAME}_N_OUT; i++) {{
                    at[i] = x[i] + h * ({ahead});
                }}{clock}
                break;"""


class CSource(NamedTuple):
    """A C99 function `void name(const double *x, double *y)`, or of floats: the texts of name.c and name.h.

    Parameters
    ----------
    name : str
        Of the function, and of both files.
    source, header : str
        The texts of name.c and name.h.
    errors : dict of str to float
        In float, {output: the largest bound of its error}, as the header says it; empty in double.

    Examples
    --------
    >>> import cgraph as cg
    >>> text = cg.to_c(cg.Graph([cg.variable("x")], {"y": cg.variable("x") + 1.0}), "next")
    >>> [line for line in text.source.splitlines() if "v1" in line]
    ['    const double v1 = x[NEXT_IN_x] + 1.0;', '    y[NEXT_OUT_y] = v1;']
    """

    name: str
    source: str
    header: str
    errors: Mapping[str, float]

    def write(self, folder: str | Path) -> tuple[Path, Path]:
        """Write name.c and name.h into a folder, each by way of a temporary file; returns their paths.

        Raises OSError, with the path in its message, when the folder is missing or must not be written to.
        """
        place = require_path("folder", folder)
        header = atomic_write(place / f"{self.name}.h", self.header)
        return atomic_write(place / f"{self.name}.c", self.source), header


def to_c(
    graph: Graph,
    name: str = "function",
    methods: Mapping[str, Tableau] | None = None,
    *,
    dtype: str = "float64",
    box: Box | None = None,
    time: str = "t",
    fma: bool = False,
    names: Mapping[str, str] | None = None,
) -> CSource:
    """C99 source and header of `void name(const double *x, double *y)`; `.write(folder)` makes the two files.

    It needs the C library alone: no heap, no globals, no recursion. The header names the places of inputs in x and
    of outputs in y, for name "arm" as in `x[ARM_IN_q0]`, `y[ARM_OUT_tau0]`, and their numbers ARM_N_IN, ARM_N_OUT; it
    says the graph's structure hash, the version of cgraph and the options. The source is one of C++17, too.
    Values are those of `evaluate` to the last bit where both use the same C library (`hypot` to one unit of it),
    unless compiler options such as -ffast-math give that up.

    Parameters
    ----------
    graph : Graph
        What the function computes. With methods, a state equation such as `dynamics.state_equation(model)`: its first
        inputs are the state, and output k is the rate of input k.
    name : str
        Of the function, and of both files.
    methods : mapping of str to Tableau, optional
        {name: explicit Runge-Kutta method}, such as those of `dynamics.integrators.TABLEAUS`. Each becomes a function
        `void arm_rk4(double *x, double h, unsigned long n)`: n steps of size h from the inputs at x, whose state and
        time are those at the end afterwards. Its stages are a loop with one call of the rate, so that a compiler which
        writes the rate out there has one copy of it.
    dtype : "float64" or "float32"
        The numbers. In float32 all are `float`, functions (`sinf`) and constants included, and the header says beside
        each output how far rounding takes it off at most: the largest bound, to first order, at 1000 points of the box,
        and the largest error seen there.
        The bound is of one evaluation, and takes each comparison for decided as without rounding.
    box : mapping of str to (float, float) or float, optional
        {input: its range, or its value}, in which float32 is to be judged. Default -1 .. 1.
    time : str
        The input that is the time, if there is one of this name, which steps move.
    fma : bool
        Let the compiler round a product and the sum that it goes into once.
    names : mapping of str to str, optional
        {name of an input or output: what a person calls it}, such as `dynamics.display_names(model)`: the header says
        it beside the place.

    Returns
    -------
    CSource
        The two texts, and the bounds.

    Raises
    ------
    GraphError
        With methods, for a graph that has more outputs than inputs; for an input of the box that is none.
    TypeError
        For what is no Graph, and methods that are no mapping to tableaus.
    ValueError
        For a name that is no identifier of C, or a word of C, C++ or their library; an operation that was added
        without a text in C, where <math.h> has no such function; a constant beyond float32; a box without float32.

    Examples
    --------
    >>> import cgraph as cg
    >>> text = cg.to_c(cg.Graph([cg.variable("q0")], {"tau0": cg.sin(cg.variable("q0"))}), "arm")
    >>> "y[ARM_OUT_tau0] = v1;" in text.source, "ARM_N_IN = 1" in text.header
    (True, True)
    >>> x, y = cg.variables("x y")
    >>> small = cg.to_c(cg.Graph([x, y], {"f": x * y}), "area", dtype="float32", box={"x": (0.0, 10.0), "y": 0.5})
    >>> "float v1 = x[AREA_IN_x] * x[AREA_IN_y]" in small.source, f"{small.errors['f']:.1e}"
    (True, '8.9e-07')
    """
    require_graph("to_c", graph)
    check_function_name(name)
    numbers = NUMBERS[require_choice("dtype", dtype, NUMBERS)]
    chosen = checked_methods(methods, graph, time)
    outputs, input_names = graph.outputs, graph.input_names
    called = require_texts("names", names)
    single = numbers.dtype == "float32"
    if box is not None and not single:
        raise ValueError("box says for which inputs errors of dtype='float32' are stated, and dtype is 'float64'")
    ranges = checked_box(graph, box) if single else {}
    places = [f"{name.upper()}_IN_{word}" for word in distinct(input_names)]
    results = [f"{name.upper()}_OUT_{word}" for word in distinct(list(outputs))]
    contract = _CONTRACT.format(*_ROUNDING[require_flag("fma", fma)])
    text = functions(name, graph, places, results, numbers)
    clock = places[input_names.index(time)] if time in input_names else None
    for method, tableau in chosen.items():
        check_function_name(f"{name}_{method}")
        if any([f" {name}_{method}(" in part for part in text]):
            raise ValueError(
                f"a method must not be called {method}: {name}_{method} is a function of the source already"
            )
        text.append(steps(name, method, tableau, numbers, clock))
    errors = largest_errors(graph, ranges, numbers) if single else {}
    shown = {name: f"{low:g}" if low == high else f"{low:g} .. {high:g}" for name, (low, high) in ranges.items()}
    said = f"numbers are {numbers.type}, {'fused multiply-add is allowed' if fma else 'no fused multiply-add'}"
    header = _HEADER.format(
        name=name,
        NAME=name.upper(),
        counts=f"{counted(len(outputs), 'output')} of {counted(len(input_names), 'input')}",
        version=__version__,
        hash=structure_hash(graph),
        options=f"{said}, steps by {', '.join(chosen)}" if chosen else said,
        type=numbers.type,
        ranges=_RANGES * single,
        errors=_ERRORS.format(points=POINTS) * single,
        inputs=_enumerators(places, input_names, called, f"{name.upper()}_N_IN", shown),
        outputs=_enumerators(results, list(outputs), called, f"{name.upper()}_N_OUT", _said(errors)),
        steps="".join([declaration(name, method, numbers) for method in chosen]),
    )
    restrict = _RESTRICT.format(NAME=name.upper())
    source = "\n".join([f'#include "{name}.h"\n\n#include <math.h>\n', contract, restrict, *text])
    return CSource(name, source, header, {key: each.bound for key, each in errors.items()})


def _said(errors: Mapping[str, Errors]) -> dict[str, str]:
    return {
        name: "no bound"
        if math.isnan(bound)
        else f"to {_upwards(bound)}, seen {'overflow' if math.isnan(seen) else _upwards(seen)}"
        for name, (bound, seen) in errors.items()
    }


def _upwards(bound: float) -> str:
    """Two digits, not below the bound."""
    text = f"{bound:.1e}"
    return text if float(text) >= bound else f"{1.05 * bound:.1e}"


def _enumerators(
    places: Sequence[str], names: Sequence[str], called: Mapping[str, str], count: str, remarks: Mapping[str, str]
) -> str:
    lines = []
    for row, (place, name) in enumerate(zip(places, names, strict=True)):
        shown = called.get(name, name)
        said = [] if place.endswith(f"_{shown}") else [comment(shown)]
        said += [remarks[name]] if name in remarks else []
        lines.append(f"    {place} = {row}," + (f" /* {': '.join(said)} */" if said else ""))
    return "\n".join([*lines, f"    {count} = {len(places)}"])


def functions(name: str, graph: Graph, places: Sequence[str], results: Sequence[str], numbers: CNumbers) -> list[str]:
    """Text of the function `name`, after that of the functions it calls.

    places, results: of each input its place in x, and of each output in y. Raises ValueError for an operation that has
    no text in C, and for a constant beyond the numbers.
    """
    kind, keyword = numbers.type, f"{name.upper()}_RESTRICT"
    found = statements(
        graph,
        places,
        results,
        numbers.text,
        lambda op: numbers.operation(op).replace("{name}", name),
        f"const {kind}",
        lambda node: f" /* {comment(node.name)} */" if node.name else "",
    )
    texts = dict.fromkeys([numbers.adapted(columns(op).c_helper) for op in found.ops])
    helpers = [text.format(name=name) for text in texts if text]
    body = found.direct
    if len(found.parts) > 1:
        called = [f"{name}_part_{k}" for k in range(1, len(found.parts) + 1)]
        body = [f"{kind} w[{max(found.size, 1)}];", *body, *[f"{function}(x, w, y);" for function in called]]
        arrays = f"const {kind} *{keyword} x, {kind} *{keyword} w, {kind} *{keyword} y"
        unused = ["(void)x, (void)w, (void)y;"]  # a part need not touch all three
        helpers += [
            _function(f"static void {function}({arrays})", unused + part)
            for function, part in zip(called, found.parts, strict=True)
        ]
    else:
        body += [line for part in found.parts for line in part]
        if not any([node.op is VARIABLE for node in graph.nodes]):
            body.insert(0, "(void)x;")
    return [*helpers, _function(f"void {name}(const {kind} *{keyword} x, {kind} *{keyword} y)", body)]


def _function(signature: str, body: Sequence[str]) -> str:
    return "\n".join([signature, "{", *[f"    {line}" for line in body], "}", ""])


def comment(text: str) -> str:
    """The text, as it may stand between /* and */."""
    printable = "".join([character if character.isprintable() else "?" for character in text])
    return printable.replace("*/", "* /").replace("/*", "/ *")


def declaration(name: str, method: str, numbers: CNumbers) -> str:
    """What the header says of the steps."""
    return (
        f"\n/* n steps of size h by {method} from x[{name.upper()}_N_IN], whose state and time are those at the end "
        f"afterwards. */\nvoid {name}_{method}({numbers.type} *x, {numbers.type} h, unsigned long n);\n"
    )


def steps(name: str, method: str, tableau: Tableau, numbers: CNumbers, time: str | None) -> str:
    """Text of the function of (x, h, n).  time: the place of the time in x."""
    cases = []
    for stage, (c, weights) in enumerate(zip(tableau.c, tableau.a, strict=True)):
        if stage:
            clock = f"\n                at[{time}] = x[{time}] + {numbers.text(float(c))} * h;" if time else ""
            cases.append(_CASE.format(NAME=name.upper(), stage=stage, ahead=_sum(weights, numbers), clock=clock))
    return _STEPS.format(
        name=name,
        NAME=name.upper(),
        method=method,
        type=numbers.type,
        stages=len(tableau.b),
        cases="\n".join(cases),
        ahead=_sum(tableau.b, numbers),
        start=f"\n    const {numbers.type} start = x[{time}];" if time else "",
        end=f"\n        x[{time}] = start + ({numbers.type})step * h;\n        at[{time}] = x[{time}];" if time else "",
    )


def _sum(weights: tuple[float, ...], numbers: CNumbers) -> str:
    return weighted_sum(weights, numbers.text, lambda k: f"slope[{k}][i]")


def check_function_name(name: str) -> None:
    """Raise ValueError unless C and C++ allow a function of this name, and a header called after it."""
    if not isinstance(name, str):
        raise TypeError(f"the name of a C function must be a string, got {type(name).__name__}: {name!r:.60}")
    if not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name):
        raise ValueError(f"the name of a C function must be a letter, then letters, digits and _, got {name!r:.60}")
    if len(name) > LONGEST_NAME:
        raise ValueError(f"the name of a C function may have {LONGEST_NAME} characters, got {len(name)}: {name:.60}")
    library = ctypes.CDLL("ucrtbase" if os.name == "nt" else None)  # the program would take its name in silence
    if name in _TAKEN or _MACROS.fullmatch(name) or hasattr(library, name):
        raise ValueError(f"the name of a C function must not be a word of C, C++ or their library, got {name!r}")


def distinct(names: Sequence[str]) -> list[str]:
    """Different words for different names, of ASCII letters, digits and _, to stand behind a prefix.

    A name that is such a word stays; Greek letters are spelled out; other characters become _, and its place follows
    where two names would become one.
    """
    words = ["".join([_letters(character) for character in unicodedata.normalize("NFKC", name)]) for name in names]
    taken = {name for name, word in zip(names, words, strict=True) if word == name}
    for i, name in enumerate(names):
        if words[i] != name:
            if words[i] in taken:
                words[i] += f"_{i}"
            while words[i] in taken:
                words[i] += "_"
            taken.add(words[i])
    return words


def _letters(character: str) -> str:
    if re.fullmatch("[A-Za-z0-9_]", character):
        return character
    greek = re.fullmatch(r"GREEK (SMALL|CAPITAL) LETTER (\w+)", unicodedata.name(character, ""))
    if greek is None:
        return "_"
    letter = greek[2].replace("LAMDA", "LAMBDA")  # Unicode leaves the b out
    return letter.lower() if greek[1] == "SMALL" else letter.title()

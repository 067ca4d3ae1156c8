"""C source: the two files of a C99 function from an array of inputs to an array of outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from ...core.graph import Graph
from ...util.atomic_write import atomic_write
from ...util.require import require_flag, require_graph, require_path, require_texts
from ...util.words import counted
from .c_identifiers import check_function_name, distinct
from .c_statements import comment, functions

_HEADER = """\
/* {name}: {counts}, written by cgraph. Units are those of the equations behind it. */
#ifndef {NAME}_H
#define {NAME}_H

#ifdef __cplusplus
extern "C" {{
#endif

/* Places in x, and their number. */
enum {{
{inputs}
}};

/* Places in y, and their number. */
enum {{
{outputs}
}};

/* y[{NAME}_N_OUT] at x[{NAME}_N_IN]; the arrays must not overlap. Any number of threads may call it. */
void {name}(const double *x, double *y);

#ifdef __cplusplus
}}
#endif

#endif
"""

# GCC does not know the standard's pragma and, unless told to be strict (-std=c99), fuses where the processor can. Where
# it can tell an argument, behind a comparison for one, it computes a function itself, and rounds otherwise than the
# library; not so under rounding-math.
_CONTRACT = """\
/* {meaning} */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize ("fp-contract={gcc}", "rounding-math")
#else
#pragma STDC FP_CONTRACT {standard}
#endif
"""
_ROUNDING = {
    False: {
        "meaning": "Every product and every sum is rounded by itself: no fused multiply-add.",
        "gcc": "off",
        "standard": "OFF",
    },
    True: {
        "meaning": "A product and the sum that it goes into may be rounded once: fused multiply-add.",
        "gcc": "fast",
        "standard": "ON",
    },
}


class CSource(NamedTuple):
    """A C99 function `void name(const double *x, double *y)`: the texts of name.c and name.h.

    Parameters
    ----------
    name : str
        Of the function, and of both files.
    source, header : str
        The texts of name.c and name.h.

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

    def write(self, folder: str | Path) -> tuple[Path, Path]:
        """Write name.c and name.h into a folder, each by way of a temporary file; returns their paths.

        Raises OSError, with the path in its message, when the folder is missing or must not be written to.
        """
        place = require_path("folder", folder)
        header = atomic_write(place / f"{self.name}.h", self.header)
        return atomic_write(place / f"{self.name}.c", self.source), header


def to_c(graph: Graph, name: str = "function", *, fma: bool = False, names: Mapping[str, str] | None = None) -> CSource:
    """C99 source and header of `void name(const double *x, double *y)`; `.write(folder)` makes the two files.

    It needs the C library alone: no heap, no globals, no recursion. The header names the places of inputs in x and
    of outputs in y, for name "arm" as in `x[ARM_IN_q0]`, `y[ARM_OUT_tau0]`, and their numbers ARM_N_IN, ARM_N_OUT.
    Values are those of `evaluate` to the last bit where both use the same C library (`hypot` to one unit of it),
    unless compiler options such as -ffast-math give that up.

    Parameters
    ----------
    graph : Graph
        What the function computes.
    name : str
        Of the function, and of both files.
    fma : bool
        Let the compiler round a product and the sum that it goes into once.
    names : mapping of str to str, optional
        {name of an input or output: what a person calls it}, such as `dynamics.display_names(model)`: the header says
        it beside the place.

    Returns
    -------
    CSource
        The two texts.

    Raises
    ------
    TypeError
        For what is no Graph.
    ValueError
        For a name that is no identifier of C, or a word of C, C++ or their library.

    Examples
    --------
    >>> import cgraph as cg
    >>> text = cg.to_c(cg.Graph([cg.variable("q0")], {"tau0": cg.sin(cg.variable("q0"))}), "arm")
    >>> "y[ARM_OUT_tau0] = v1;" in text.source, "ARM_N_IN = 1" in text.header
    (True, True)
    """
    require_graph("to_c", graph)
    check_function_name(name)
    inputs, outputs, input_names = graph.inputs, graph.outputs, graph.input_names
    called = require_texts("names", names)
    places = [f"{name.upper()}_IN_{word}" for word in distinct(input_names)]
    results = [f"{name.upper()}_OUT_{word}" for word in distinct(list(outputs))]
    header = _HEADER.format(
        name=name,
        NAME=name.upper(),
        counts=f"{counted(len(outputs), 'output')} of {counted(len(inputs), 'input')}",
        inputs=_enumerators(places, input_names, called, f"{name.upper()}_N_IN"),
        outputs=_enumerators(results, list(outputs), called, f"{name.upper()}_N_OUT"),
    )
    contract = _CONTRACT.format(**_ROUNDING[require_flag("fma", fma)])
    text = functions(
        name, graph.nodes, dict(zip(inputs, places, strict=True)), list(zip(results, outputs.values(), strict=True))
    )
    source = "\n".join([f'#include "{name}.h"\n\n#include <math.h>\n', contract, *text])
    return CSource(name, source, header)


def _enumerators(places: Sequence[str], names: Sequence[str], called: Mapping[str, str], count: str) -> str:
    shown = [called.get(name, name) for name in names]
    lines = [
        f"    {place} = {row}," + ("" if place.endswith(f"_{text}") else f" /* {comment(text)} */")
        for row, (place, text) in enumerate(zip(places, shown, strict=True))
    ]
    return "\n".join([*lines, f"    {count} = {len(places)}"])

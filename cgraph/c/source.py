"""C source: the two files of a C99 function from an array of inputs to an array of outputs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from ..files import write
from ..node import Node
from .body import comment, functions
from .names import check_function_name, distinct

_HEADER = """\
/* {name}: {n_out} outputs of {n_in} inputs, written by cgraph. Units are those of the equations behind it. */
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

# GCC does not know the standard's pragma and, unless told to be strict (-std=c99), fuses where the processor can.
_CONTRACT = """\
/* {meaning} */
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC optimize ("fp-contract={gcc}")
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
    """A C99 function `void name(const double *x, double *y)`: the texts of name.c and name.h."""

    name: str
    source: str
    header: str

    def write(self, folder: str | Path) -> tuple[Path, Path]:
        """Write name.c and name.h into a folder, each by way of a temporary file; returns their paths.

        Raises OSError, with the path in its message, when the folder is missing or must not be written to.
        """
        header = write(Path(folder) / f"{self.name}.h", self.header)
        return write(Path(folder) / f"{self.name}.c", self.source), header


def c_source(
    inputs: Sequence[Node], nodes: Sequence[Node], outputs: Mapping[str, Node], name: str, fma: bool
) -> CSource:
    """C source of `outputs` over `inputs`; `nodes` are all that the outputs reach, in order. See `Graph.to_c`."""
    check_function_name(name)
    input_names = [str(node.name) for node in inputs]
    places = [f"{name.upper()}_IN_{word}" for word in distinct(input_names)]
    results = [f"{name.upper()}_OUT_{word}" for word in distinct(list(outputs))]
    header = _HEADER.format(
        name=name,
        NAME=name.upper(),
        n_in=len(inputs),
        n_out=len(outputs),
        inputs=_enumerators(places, input_names, f"{name.upper()}_N_IN"),
        outputs=_enumerators(results, list(outputs), f"{name.upper()}_N_OUT"),
    )
    contract = _CONTRACT.format(**_ROUNDING[fma])
    text = functions(
        name, nodes, dict(zip(inputs, places, strict=True)), list(zip(results, outputs.values(), strict=True))
    )
    source = "\n".join([f'#include "{name}.h"\n\n#include <math.h>\n', contract, *text])
    return CSource(name, source, header)


def _enumerators(places: Sequence[str], names: Sequence[str], count: str) -> str:
    lines = [
        f"    {place} = {row}," + ("" if place.endswith(f"_{name}") else f" /* {comment(name)} */")
        for row, (place, name) in enumerate(zip(places, names, strict=True))
    ]
    return "\n".join([*lines, f"    {count} = {len(places)}"])

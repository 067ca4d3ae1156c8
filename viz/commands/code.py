"""`cgraph code`: the equations of a scene as C, in double or in float, as JavaScript or as Python."""

from __future__ import annotations

import argparse
import math
import re
from pathlib import Path
from typing import Any

import cgraph as cg
import dynamics as dyn
from cgraph import _shared

from . import library
from .arguments import answer, box, place, scene_of, takes_a_scene
from .command import Command, flag

EQUATIONS = ("forward_dynamics", "inverse_dynamics", "state_equation", "mass_matrix", "energy")  # of `dynamics`
SUFFIXES = {"c": ".c", "js": ".mjs", "python": ".py"}


def add(parser: Command) -> None:
    """The command's arguments."""
    takes_a_scene(parser)
    parser.names["tableaus"] = lambda: library.TABLEAUS
    language = parser.add_mutually_exclusive_group(required=True)
    stepped = "; of the state equation with steps of {tableaus}"
    languages = {"c": f"C99, with its header{stepped}", "js": f"a module of JavaScript{stepped}"}
    for name, about in (languages | {"python": "a Python function of a list"}).items():
        language.add_argument(f"--{name}", dest="language", action="store_const", const=name, help=about)
    parser.add_argument(
        "--what", choices=EQUATIONS, help="default: forward_dynamics; of a first-order system state_equation"
    )
    parser.add_argument(
        "--out", type=place, help="file to write, in place of standard output: .c (and .h), .mjs or .py"
    )
    flag(parser, "--float32", "C in float alone; the header says a bound of the rounding of each output")
    parser.add_argument(
        "--box",
        type=box,
        metavar="A=LOW:HIGH,...",
        help="inputs for which the bound of --float32 is stated, -1:1 if left out, parameters at their values",
    )


def run(options: argparse.Namespace) -> None:
    """Write or print the code."""
    out: Path | None = options.out
    suffix = SUFFIXES[options.language]
    if out is not None and out.suffix != suffix:
        raise ValueError(f"--out must end in {suffix} for --{options.language}, got {out}")
    if options.float32 and options.language != "c":
        raise ValueError("--float32 is for --c")
    if options.box is not None and not options.float32:
        raise ValueError("--box says where the bound of --float32 is stated")
    if out is not None:
        _shared.check_writable(out)
    scene = scene_of(options)
    what = options.what or ("forward_dynamics" if scene.ode is None else "state_equation")
    graph: cg.Graph = getattr(dyn, what)(scene)
    name = re.sub("[^A-Za-z0-9_]", "_", scene.name) if out is None else out.stem
    methods = library.TABLEAUS if what == "state_equation" else None
    if options.language == "js":
        files = {suffix: cg.to_js(graph, methods)}
    elif options.language == "python":
        files = {suffix: python_text(graph)}
    else:
        single: dict[str, Any] = {}
        if options.float32:  # parameters have their values unless the box has another range
            values = {name: value for name, value in scene.parameters.items() if name in graph.input_names}
            ranges = library.Names(graph, dyn.display_names(scene)).inputs_of("--box", options.box or {})
            single = {"dtype": "float32", "box": values | ranges}
        try:
            text = cg.to_c(graph, name, methods, names=dyn.display_names(scene), **single)
        except ValueError as error:
            raise ValueError(f"{out or scene.name} names the function: {error}") from None
        whole = text.source.replace(f'#include "{name}.h"\n', text.header)  # one text for standard output
        files = {suffix: whole} if out is None else {suffix: text.source, ".h": text.header}
    if out is None:
        answer(files[suffix].rstrip("\n"))
        return
    written = {out.with_suffix(end): content for end, content in files.items()}
    sizes = ", ".join(f"{path}: {len(content)} bytes" for path, content in written.items())
    answer(sizes, written)


def python_text(graph: cg.Graph) -> str:
    """The generated function, and before it the functions that it calls."""
    ops = sorted({_shared.columns(node.op) for node in graph.nodes if node.args}, key=lambda op: op.name)
    called = [op for op in ops if re.match(rf"{op.name}\(", op.python)]
    known = [op.name for op in called if op.raising is getattr(math, op.name, None)]
    others = [op.name for op in called if op.name not in known and op.name not in ("abs", "float")]
    lines = [f"from math import {', '.join(known)}"] if known else []
    lines += ["from cgraph.extend import OPS", ""] if others else []
    lines += [f'{name} = OPS["{name}"].scalar' for name in others]
    return "\n".join([*lines, "", "", cg.compile(graph, "python").source]).lstrip("\n")

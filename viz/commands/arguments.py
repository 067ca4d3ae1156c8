"""The arguments that several commands share: a scene, a start, a formulation, a point, a picture."""

from __future__ import annotations

import argparse
import json
import math
import webbrowser
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import cgraph as cg
import dynamics as dyn
from cgraph import _shared

from . import library
from .command import Command, flag, say

FORMULATIONS = (
    "by_definition",
    "chain_rule",
    "chain_rule_literal",
    "kinetic_only",
    "kinetic_only_exact",
    "newton_euler",
)
FORMER_NAMES = {"euler_embedded": "by_definition"}  # of formulations, as `dynamics` takes them, too
MOMENTUM_FORM = "Hamilton's equations, q_dot and p_dot of q and the momenta p"
READING = ("ignore", "floating", "limits", "friction", "actuators", "contacts")  # options of `scenes.of_file`
IN_PYTHON = "file.py:name, a model of a Python file, which is executed"


def takes_a_scene(command: Command, default: str | None = None) -> None:
    """The arguments that `scene_of` reads.  default: the scene where none is named."""
    command.names["scenes"] = lambda: dyn.scenes.names()
    command.add_argument(
        "scene",
        metavar="SCENE",
        nargs=None if default is None else "?",
        default=default,
        help=f"{{scenes}}, a model file, MJCF or URDF, or {IN_PYTHON}",
    )
    reads_files(command)


def reads_files(command: argparse.ArgumentParser) -> None:
    """The arguments that say how a model file is read, `READING`."""
    flag(command, "--ignore", "leave out and name what of a file cgraph cannot model")
    flag(command, "--floating", "let the root link of a URDF file move freely")
    command.add_argument(
        "--limits", type=_spring, metavar="K,D", help="take limits of joints as springs of this stiffness and damping"
    )
    command.add_argument(
        "--friction",
        type=from_zero,
        metavar="V",
        help="take friction loss, most of which acts from this velocity on; 0: it sticks",
    )
    flag(command, "--actuators", "take motors and servos of MJCF, with inputs at 0")
    command.add_argument(
        "--contacts",
        type=material,
        metavar="compliant | A=1,B=NAME",
        help="take contacts of spheres and capsules of a model file as forces: with the stiffness, dissipation, "
        "friction and velocity that follow from it, or numbers or names of parameters in their place",
    )


def reading(options: argparse.Namespace) -> dict[str, Any]:
    """Options that say how a model file is read, where they are given."""
    return {name: value for name in READING if (value := getattr(options, name))}


def scene_of(options: argparse.Namespace) -> dyn.scenes.Scene:
    """The scene that the arguments name; what of a file is left out is a warning, a line of standard error."""
    return dyn.scenes.load(options.scene, **reading(options))


def unless_json(options: argparse.Namespace, data: object, text: object) -> str:
    """Output of a command: its data where `--json` asks for it, else the text."""
    return json.dumps(data, indent=1) if options.json else str(text)


def writes_a_page(command: argparse.ArgumentParser) -> None:
    """The arguments `--out` and `--open`; `answer_page` writes and opens."""
    command.add_argument("--out", type=place, required=True, help="file to write: .html")
    may_open(command)


def may_open(command: argparse.ArgumentParser) -> None:
    """The argument `--open`, which shows a page."""
    flag(command, "--open", "open the page in the browser once it is written")


def answer_page(options: argparse.Namespace, text: str, page: str) -> None:
    """The end of a command that writes a page: its file, what it prints, and the browser if `--open` asks for it."""
    answer(text, {options.out: page}, show=options.out if options.open else None)


def answer(
    text: str, files: Mapping[Path, str | bytes] | None = None, *, folder: Path | None = None, show: Path | None = None
) -> None:
    """The end of a command: its files, all or none, and what it prints.

    folder: made for the files where it is missing.  show: the page to open in the browser.
    """
    places = {} if folder is None else {folder: None} | {path.parent: None for path in files or {}}
    missing = [each for place in places for each in (place, *place.parents) if not each.exists()]
    try:
        for place in places:
            place.mkdir(parents=True, exist_ok=True)
        _shared.write_files(files or {})
    except OSError:
        for place in sorted(missing, reverse=True):  # what is inside first
            with suppress(OSError):
                place.rmdir()
        raise
    if text:
        print(text)
    if show is not None and not webbrowser.open(show.resolve().as_uri()):
        say(f"warning: no browser was found that opens {show}")


def takes_equations(command: Command) -> None:
    """The arguments that `scene_of` and `equations_of` read, of which one may say what equations."""
    takes_a_scene(command)
    which = command.add_mutually_exclusive_group()
    which.add_argument(
        "--formulation",
        type=formulation,
        default="chain_rule",
        choices=FORMULATIONS,
        help="of inverse dynamics (chain_rule)",
    )
    flag(which, "--forward", "forward dynamics, with outputs such as qdd0")
    flag(which, "--momentum", f"{MOMENTUM_FORM}, with outputs such as p0_dot")


def verdict_of(options: argparse.Namespace, scene: dyn.scenes.Scene) -> dyn.Verdict | None:
    """The verdict on the formulation that the arguments choose; None of other equations than inverse dynamics."""
    other = scene.ode is not None or options.forward or options.momentum
    return None if other else dyn.formulation_verdict(scene, options.formulation)


def equations_of(options: argparse.Namespace, scene: dyn.scenes.Scene) -> tuple[cg.Graph, str, dyn.Verdict | None]:
    """The graph that the arguments choose, what it is, "inverse dynamics, chain rule", and the verdict of `verdict_of`.

    Of an OdeSystem it is the state equation. Raises for momenta of what has none.
    """
    if (verdict := verdict_of(options, scene)) is not None:
        return verdict.graph, f"inverse dynamics, {options.formulation.replace('_', ' ')}", verdict
    if options.momentum:
        return dyn.hamilton_equations(scene), "Hamilton's equations", None
    if scene.ode is not None:
        return dyn.state_equation(scene), "state equation", None
    return dyn.forward_dynamics(scene), "forward dynamics", None


def place(text: str) -> Path:
    """The path of a file or folder, for argparse."""
    if not text:
        raise argparse.ArgumentTypeError("expected the name of a file or folder, got ''")
    return Path(text)


def _spring(text: str) -> tuple[float, float]:
    """Stiffness and damping, for argparse."""
    stiffness, comma, damping = text.partition(",")
    if not comma:
        raise argparse.ArgumentTypeError(f"expected a stiffness and a damping, as 1000,10, got {text!r}")
    return number(stiffness), number(damping)


def formulation(text: str) -> str:
    """The name of a formulation, a former one as it is called now, for argparse."""
    return FORMER_NAMES.get(text, text)


def whole(text: str, least: int = 0) -> int:
    """A whole number, at least so large, for argparse."""
    if not (text.isascii() and text.isdecimal() and int(text) >= least):
        raise argparse.ArgumentTypeError(f"expected a whole number, at least {least}, got {text!r}")
    return int(text)


def counting(text: str) -> int:
    """A whole number, at least 1, for argparse."""
    return whole(text, 1)


def number(text: str) -> float:
    """A finite number, for argparse."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"expected a finite number, got {text!r}")
    return value


def positive(text: str) -> float:
    """A positive number, for argparse."""
    value = number(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"expected a positive number, got {text!r}")
    return value


def from_zero(text: str) -> float:
    """A number of at least 0, for argparse."""
    return 0.0 if number(text) == 0.0 else positive(text)


def may_draw_and_print(command: argparse.ArgumentParser) -> None:
    """The arguments `--json` and `--svg`; `draw` writes the picture."""
    flag(command, "--json", "print as JSON")
    command.add_argument("--svg", type=_svg_file, metavar="FILE", help="draw the graph, with the answer marked")


def check_picture(options: argparse.Namespace) -> None:
    """Raise what writing the picture would, before the work."""
    if options.svg:
        _shared.check_writable(options.svg)
        library.check_can_draw(png=False)


def answer_and_draw(
    options: argparse.Namespace, text: str, graph: cg.Graph, scene: dyn.scenes.Scene, **marks: Any
) -> None:
    """The end of a command, with the drawing that `--svg` asks for.  marks: as `to_dot` takes them."""
    if not options.svg:
        answer(text)
        return
    names = dyn.display_names(scene)
    collapse = [] if "only" in marks else collapsed(graph)
    drawing = library.to_dot(graph, collapse=collapse, names=names, **marks)
    answer(text, {options.svg: library.render_svg(drawing)})
    say(f"drawn in {options.svg}")


def collapsed(graph: cg.Graph) -> list[str]:
    """The tags to collapse so that the picture is made in seconds; it is said where there are any."""
    tags = library.tags_to_collapse(graph)
    if tags:
        say(f"{len(graph.nodes)} nodes are too many for one picture: those of a tag are one box")
    return tags


def state_names(graph: cg.Graph, scene: dyn.scenes.Scene, *, momentum: bool = False) -> tuple[list[str], list[str]]:
    """Names of the coordinates and of the velocities, or momenta, that the graph has, as inputs or as inner nodes."""
    if scene.ode is not None:
        return [], []
    known = {node.name for node in (*graph.inputs, *graph.nodes)}
    names = [node.name for node in scene.system.q], [f"{'p' if momentum else 'qd'}{i}" for i in range(scene.system.n)]
    q, rest = ([str(name) for name in each if name in known] for each in names)
    return q, rest


def _svg_file(text: str) -> Path:
    if not text.endswith(".svg"):
        raise argparse.ArgumentTypeError(f"the picture's file must end in .svg, got {text!r}")
    return Path(text)


def point(text: str) -> dict[str, float]:
    """`q0=0.1,qd0=2` as numbers by name, for argparse."""
    return {name: _number(name, value) for name, value in _pairs(text)}


def material(text: str) -> str | dict[str, float | str]:
    """`compliant`, or numbers and names of parameters such as `stiffness=1e5,friction=mu`, for argparse."""
    if "=" not in text:
        return text
    numbers = ("inf", "nan")
    return {
        name: value if value.isidentifier() and value not in numbers else _number(name, value)
        for name, value in _pairs(text)
    }


def box(text: str) -> dict[str, tuple[float, float]]:
    """`q0=-1:1,qd0=0:2` as intervals by name, for argparse."""
    intervals = {}
    for name, value in _pairs(text, "NAME=LOW:HIGH"):
        low, colon, high = value.partition(":")
        if not colon:
            raise argparse.ArgumentTypeError(f"{name} needs an interval such as -1:1, got {value!r}")
        intervals[name] = _number(name, low), _number(name, high)
        if intervals[name][0] > intervals[name][1]:
            raise argparse.ArgumentTypeError(f"{name} needs its lower end first, got {value!r}")
    return intervals


def takes_a_start(command: argparse.ArgumentParser) -> None:
    """The argument `--start`, which `started` reads."""
    command.add_argument(
        "--start",
        type=start,
        metavar="A=1,B=2",
        help="in place of the scene's start: what differs from it, by names such as q0, qd.knee or knee, all "
        "numbers of q and qd, or a keyframe of the file by name or number; without it, a scene that would only rest "
        "starts half a radian away",
    )


def start(text: str) -> library.Start:
    """`q0=0.3,qd.knee=1` as numbers by name, `0.3,0,0,1` as all of them, or a keyframe's name, for argparse."""
    if "=" in text:
        return point(text)
    try:
        return [number(each) for each in text.split(",")]
    except argparse.ArgumentTypeError as error:
        if "," not in text:
            return text
        said = f"{error}; a start is such as q0=0.5,qd0=1, or all numbers of q and qd, or a keyframe's name"
        raise argparse.ArgumentTypeError(said) from None


def started(options: argparse.Namespace, *, free: bool = True) -> tuple[dyn.scenes.Scene, str]:
    """The scene that the arguments name, from the start that they name or one that shows something, and then why.

    free: whether nothing drives it, so that it may rest for ever.
    """
    scene = scene_of(options)
    if options.start is not None:
        return library.with_start(scene, options.start), ""
    moving = library.moving_start(scene, free=free)
    if moving is scene:
        return scene, ""
    why = library.rest_text(scene, moving)
    say(f"{scene.name}: {why}; --start chooses another")
    return moving, why


def _pairs(text: str, form: str = "NAME=VALUE") -> list[tuple[str, str]]:
    pairs: dict[str, str] = {}
    for part in filter(None, text.split(",")):
        name, equals, value = part.partition("=")
        if not equals or not name.strip():
            raise argparse.ArgumentTypeError(f"expected {form}, separated by commas, got {part!r}")
        name = name.strip()
        if name in pairs:
            raise argparse.ArgumentTypeError(f"{name} is given twice, as {pairs[name]} and as {value}")
        pairs[name] = value
    return list(pairs.items())


def _number(name: str, text: str) -> float:
    try:
        return number(text)
    except argparse.ArgumentTypeError as error:
        raise argparse.ArgumentTypeError(f"{name}: {error}") from None

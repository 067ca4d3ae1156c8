"""Looks of everything: colors that color-blind people can tell apart, fonts, and names in mathematical letters."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

from cgraph import Node
from cgraph._shared import GREEK
from cgraph.extend import ADJOINT, PRIMAL, TANGENT

# The palette of Okabe and Ito (2008), https://jfly.uni-koeln.de/color/
BLACK, ORANGE, SKY_BLUE, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
YELLOW, BLUE, VERMILLION, PURPLE = "#F0E442", "#0072B2", "#D55E00", "#CC79A7"
WHITE, GRAY = "#FFFFFF", "#8C8C8C"

SPURIOUS = VERMILLION  # kept for what is wrong, so that it means one thing in every picture
LINKS = ("#7B3FA0", "#2A62C8", "#CC3333")  # the first, second and third link, as the paper paints them
TEXT, LINE = "#1A1A1A", "#4D4D4D"
DARK_TEXT, DARK_LINE, DARK_PAGE = "#E8E8E4", "#B4B4AE", "#17181A"
# A formulation has one color on every page; the one that is wrong everywhere has that of what is wrong.
FORMULATIONS = {
    "by_definition": SPURIOUS,
    "kinetic_only": ORANGE,
    "chain_rule": BLUE,
    "chain_rule_literal": PURPLE,
    "kinetic_only_exact": GREEN,
    "newton_euler": SKY_BLUE,
}
# So has an integrator, by its place: every page draws it by this number.
METHODS = (
    *("rk4", "dopri5", "dop853", "taylor", "radau", "rodas", "euler", "verlet", "midpoint", "gauss4", "gauss6"),
    *("symplectic_euler", "yoshida4", "yoshida6", "yoshida8", "mclachlan4", "mclachlan6", "kahan_li6", "kahan_li8"),
)
SERIES = (BLUE, ORANGE, GREEN, PURPLE, SKY_BLUE, BLACK, YELLOW)  # curves of a plot, and tags

FONT = "DejaVu Sans"  # its letter widths are known to the Graphviz that comes without fonts, and matplotlib carries it
FONT_FAMILIES = f"{FONT}, Verdana, Arial, sans-serif"  # what a browser without that font takes instead
FONT_SIZE, SMALL_FONT_SIZE = 14, 10  # points


def tint(color: str, strength: float) -> str:
    """The color mixed with white: 0 is white, 1 the color itself."""
    channels = (int(color[i : i + 2], 16) for i in (1, 3, 5))
    return "#" + "".join(f"{round(255 - strength * (255 - channel)):02X}" for channel in channels)


@dataclass(frozen=True)
class Paint:
    """The colors of one kind of node, and the words that a legend has for it."""

    words: str
    fill: str
    line: str


def _paint(words: str, color: str, strength: float) -> Paint:
    return Paint(words, tint(color, strength), color)


ROLES = {
    "input": Paint("input variable", tint(YELLOW, 0.55), LINE),  # a yellow line is hard to see on white
    "constant": Paint("constant", WHITE, GRAY),
    "primal": _paint("primal: as written", SKY_BLUE, 0.40),
    "adjoint": _paint("adjoint: reverse mode", ORANGE, 0.45),
    "tangent": _paint("tangent: forward mode", GREEN, 0.35),
    "several": _paint("several of these roles", PURPLE, 0.45),
}
MOTION_WORDS = {  # what roles are in equations of motion that are solved, of accelerations or momenta
    "primal": "primal: as written, or stated by bodies",
    "adjoint": "adjoint: derivatives of L, elimination from the tips inwards",
    "tangent": "tangent: accelerations, from the base outwards",
}
OUTPUT = Paint("output", WHITE, BLACK)
COLLAPSED = Paint("collapsed part", tint(GRAY, 0.25), LINE)
WRONG_OUTPUT = _paint("wrong result", SPURIOUS, 0.20)
MARKED = _paint("spurious", SPURIOUS, 0.60)
MARKS = (MARKED, _paint("marked", BLUE, 0.60))  # of several groups of marked nodes, the first and the second


def in_words(kinds: Iterable[Paint], words: Mapping[str, str]) -> list[Paint]:
    """The kinds of nodes, those of some roles with other words.  words: {role: what a legend says of it}."""
    chosen = {ROLES[role].words: text for role, text in words.items() if role in ROLES}
    return [replace(kind, words=chosen.get(kind.words, kind.words)) for kind in kinds]


def role_of(node: Node) -> str:
    """The one row of `ROLES` that paints a node."""
    if not node.args:
        return "input" if node.value is None else "constant"
    known = node.roles & {PRIMAL, ADJOINT, TANGENT}
    if len(known) > 1:
        return "several"
    return next(iter(known), PRIMAL)


def natural_order(text: str) -> tuple[tuple[bool, int, str], ...]:
    """Sorting key by which "link 2" comes before "link 10"."""
    return tuple((part.isdigit(), int(part) if part.isdigit() else 0, part) for part in re.split(r"([0-9]+)", text))


def font_folder() -> Path | None:
    """The folder of matplotlib's copy of `FONT`, or None without matplotlib."""
    spec = find_spec("matplotlib")
    folder = Path(spec.origin).parent / "mpl-data" / "fonts" / "ttf" if spec and spec.origin else None
    return folder if folder and folder.is_dir() else None


LETTERS = {word: letter for word, letter in GREEK.items() if word.islower() and word != "pi"}
LETTERS |= {"q": "q", "qd": "q\u0307", "qdd": "q\u0308"}  # the dots of a time derivative combine with q
# The paper's letters for one joint: angular velocity, angular acceleration, torque.
ONE_JOINT = {
    "q0": "θ",
    "qd0": "ω",
    "qdd0": "α",
    "q0_old": "θ old",
    "qd0_old": "ω old",
    "p0": "p = ∂L/∂ω",
    "p0_dot": "dp/dt",  # the inertial term; the torque is τ = dp/dt − ∂L/∂θ
    "tau0": "τ",
}
_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_RATE = re.compile(r"(?<![A-Za-z0-9_])((?:q|qd|p)[0-9]*)_dot(?![A-Za-z0-9_])")  # a rate of the state, by its name
_WORD = re.compile(r"(?<![A-Za-z0-9])([A-Za-z]+)([0-9]*)(?![A-Za-z0-9])")


def pretty(name: str) -> str:
    """A name in mathematical letters: q0 is q₀, qdd1 is q̈₁, tau2 is τ₂, dL/dqd0 is dL/dq̇₀, and p0_dot is dp₀/dt."""
    return _WORD.sub(_pretty_word, _RATE.sub(r"d\1/dt", name))


def _pretty_word(match: re.Match[str]) -> str:
    word, digits = match.groups()
    if word in LETTERS:
        word = LETTERS[word]
    elif word[0] == "d" and word[1:] in LETTERS:
        word = "d" + LETTERS[word[1:]]
    return word + digits.translate(_SUBSCRIPTS)

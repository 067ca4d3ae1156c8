"""Symbols: what a name is in mathematical letters, in parts that LaTeX and MathML put together."""

from __future__ import annotations

import re
from typing import NamedTuple

GREEK = dict(
    zip(
        "alpha beta gamma delta epsilon zeta eta theta kappa lambda mu nu xi pi rho sigma tau phi chi psi omega "
        "Gamma Delta Theta Lambda Xi Pi Sigma Phi Psi Omega".split(),
        "αβγδεζηθκλμνξπρστφχψωΓΔΘΛΞΠΣΦΨΩ",
        strict=True,
    )
)
_RATES = {"qd": ("q", "dot"), "qdd": ("q", "ddot")}  # as the graphs of mechanics call the rates of a coordinate q
_ACCENTS = ("dot", "ddot", "bar")  # of a rate, as well of a tangent, of a second rate, and of a cotangent
_WORD = re.compile(r"([A-Za-z]+)(\d*)((?:_[A-Za-z0-9]+)*)")


class Symbol(NamedTuple):
    """A letter or a word with what is above and below it.

    word: a letter, the English name of a Greek one, or a word.  accent: "dot", "ddot", "bar" or none.
    below: indices, of which words are upright.  before: "∂" of the sign of a partial derivative.

    >>> symbol("qd.theta")
    Symbol(word='theta', accent='dot', below=(), before='')
    """

    word: str
    accent: str = ""
    below: tuple[str, ...] = ()
    before: str = ""


def symbol(name: str) -> Symbol | None:
    """The symbol of a name; None of one that is no word with indices.

    q0 is q with index 0, qd.knee q with a dot and the index knee, M_0_1 M with two, p0_dot p with a dot. A coordinate
    that is a letter is that letter: qd.theta is theta with a dot, q.x2 is x with index 2.
    """
    if name.startswith("∂"):
        found = symbol(name[1:])
        return found and found._replace(before="∂")
    kind, dot, called = name.partition(".")
    if not dot:
        return _of_word(name)
    of_kind, of_coordinate = _of_word(kind), _of_word(called)
    if of_kind is None or not re.fullmatch(r"[A-Za-z]+(_[A-Za-z]+)*", kind) or not called:
        return None
    if of_kind.word == "q" and of_coordinate and is_letter(of_coordinate.word) and not of_coordinate.accent:
        return of_coordinate._replace(accent=of_kind.accent, below=of_coordinate.below + of_kind.below)
    return of_kind._replace(below=(*of_kind.below, called))


def is_letter(word: str) -> bool:
    """Whether a word is one letter, or the name of a Greek one."""
    return len(word) == 1 or word in GREEK


def _of_word(name: str) -> Symbol | None:
    match = _WORD.fullmatch(name)
    if match is None:
        return None
    word, digits, rest = match.groups()
    word, accent = _RATES.get(word, (word, ""))
    below = [digits] if digits else []
    for part in rest.split("_")[1:]:
        if part in _ACCENTS:
            accent = "ddot" if (accent, part) == ("dot", "dot") else part
        else:
            below.append(part)
    return Symbol(word, accent, tuple(below))

"""Formulas of the paper's page as MathML, from short texts: words apart by blanks, `a/b` a fraction, `a_b` and `a^b` indices."""

import re
from collections.abc import Mapping
from html import escape

from cgraph._shared import Polynomial

LETTERS = {"q0": "θ", "qd0": "ω", "qdd0": "α", "q0_old": "θ_old"}  # those of the paper's captions, by names in a graph
ORDER = ("I", "k", "α", "ω", "θ", "θ_old", "dt")  # of the factors of a term
_OPERATOR = re.compile(r"[=+−·×→,()½]")


def typeset(text: str) -> str:
    """The text as an element of MathML."""
    return f"<math>{row(text)}</math>"


def row(text: str) -> str:
    """The words of a text side by side, without the element around them."""
    words = text.split()
    parts = [_word(word) for word in words]
    for i in range(len(words) - 1, 0, -1):  # factors a little apart
        if not any(_OPERATOR.fullmatch(word) for word in words[i - 1 : i + 1]):
            parts.insert(i, '<mspace width="0.15em"/>')
    return f"<mrow>{''.join(parts)}</mrow>"


def _word(word: str) -> str:
    for sign, element in (("/", "mfrac"), ("^", "msup"), ("_", "msub")):
        if sign in word:
            left, right = word.split(sign, 1)
            return f"<{element}>{_word(left)}{_word(right)}</{element}>"
    if _OPERATOR.fullmatch(word):
        return f"<mn>{word}</mn>" if word == "½" else f'<mo stretchy="false">{word}</mo>'
    if word[0].isdigit():
        return f"<mn>{word}</mn>"
    if word[0] in "d∂" and len(word) > 1:  # a differential: its letters are two
        return f"<mrow><mi>{word[0]}</mi>{_word(word[1:])}</mrow>"
    return f"<mtext>{escape(word)}</mtext>" if word == "old" else f"<mi>{escape(word)}</mi>"


def terms(polynomial: Polynomial, right: Polynomial, letters: Mapping[str, str] = LETTERS) -> str:
    """A sum of terms, those that `right` has not marked as wrong; "0" without any.

    polynomial, right: as of `cgraph._shared.expand`.
    """
    parts = list[str]()
    for monomial, coefficient in sorted(polynomial.items(), key=lambda item: (sum(p for _, p in item[0]), item[0])):
        named = sorted(
            [(letters.get(name, name), power) for name, power in monomial], key=lambda each: ORDER.index(each[0])
        )
        size = abs(coefficient)
        factors = [f"{size:g}"] * (size != 1.0 or not named)
        factors += [name if power == 1 else f"{name}^{power}" for name, power in named]
        sign = "−" if coefficient < 0.0 else "+" * bool(parts)
        sign = f'<mo form="{"infix" if parts else "prefix"}">{sign}</mo>' * bool(sign)
        kind = "" if right.get(monomial) == coefficient else ' class="wrong"'
        parts.append(f"<mrow{kind}>{sign}{row(' '.join(factors))}</mrow>")
    return f"<math><mrow>{''.join(parts) or '<mn>0</mn>'}</mrow></math>"

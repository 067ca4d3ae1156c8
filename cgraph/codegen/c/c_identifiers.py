"""Names in C: of a function, checked; of places in its arrays, made from the names of inputs and outputs."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

from .c_reserved import is_reserved

LONGEST = 63  # characters of a name that every C compiler looks at


def check_function_name(name: str) -> None:
    """Raise ValueError unless C and C++ allow a function of this name, and a header called after it."""
    if not isinstance(name, str):
        raise TypeError(f"the name of a C function must be a string, got {type(name).__name__}: {name!r:.60}")
    if not re.fullmatch("[A-Za-z][A-Za-z0-9_]*", name):
        raise ValueError(f"the name of a C function must be a letter, then letters, digits and _, got {name!r:.60}")
    if len(name) > LONGEST:
        raise ValueError(f"the name of a C function may have {LONGEST} characters, got {len(name)}: {name:.60}")
    if is_reserved(name):
        raise ValueError(f"the name of a C function must not be a word of C, C++ or their library, got {name!r}")


def distinct(names: Sequence[str]) -> list[str]:
    """For each of these different names a different word of ASCII letters, digits and _, to stand behind a prefix.

    A name that is such a word stays; Greek letters are spelled out; other characters become _, and its place follows
    where two names would become one.
    """
    words = [_word(name) for name in names]
    taken = {name for name, word in zip(names, words, strict=True) if word == name}
    for i, name in enumerate(names):
        if words[i] != name:
            if words[i] in taken:
                words[i] += f"_{i}"
            while words[i] in taken:
                words[i] += "_"
            taken.add(words[i])
    return words


def _word(name: str) -> str:
    return "".join([_letters(character) for character in unicodedata.normalize("NFKC", name)])


def _letters(character: str) -> str:
    if re.fullmatch("[A-Za-z0-9_]", character):
        return character
    greek = re.fullmatch(r"GREEK (SMALL|CAPITAL) LETTER (\w+)", unicodedata.name(character, ""))
    if greek is None:
        return "_"
    letter = greek[2].replace("LAMDA", "LAMBDA")  # Unicode leaves the b out
    return letter.lower() if greek[1] == "SMALL" else letter.title()

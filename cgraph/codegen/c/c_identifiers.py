"""Names in C: of a function, checked; of places in its arrays, made from the names of inputs and outputs."""

import ctypes
import os
import re
import unicodedata
from collections.abc import Sequence

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

"""Arithmetic: what the instructions of a function may do, and on how many numbers at once."""

from __future__ import annotations

import struct
from typing import NamedTuple

REGISTERS = 13  # values that fit in the registers of any processor at once, some registers left over


class Arithmetic(NamedTuple):
    """Liberties of the instructions of a function, and the numbers that they work on at once."""

    flags: str = ""  # fast-math flags: none is strict IEEE
    lanes: int = 1  # doubles in a vector
    registers: int = REGISTERS  # values that are in registers at once
    together: int = 1  # at most so many arguments go into one call of a vector function, where lanes is 1
    alike: bool = False  # whether each lane has the bits of one point: libm's where a function has no company there

    @property
    def polynomials(self) -> bool:
        """Whether vectors have sines, exponentials, .. from polynomials; strict IEEE has libm's bits everywhere."""
        return bool(self.flags)

    @property
    def fuses(self) -> bool:
        """Whether a product and its sum are one instruction: which ones is said, so that it is the same everywhere."""
        return self.flags == "contract"

    @property
    def unfused(self) -> Arithmetic:
        """The same, but that products are rounded by themselves, so that what cancels is 0."""
        return self._replace(flags="nsz") if self.fuses else self

    @property
    def type(self) -> str:
        """The type of a value."""
        return "double" if self.lanes == 1 else f"<{self.lanes} x double>"

    @property
    def suffix(self) -> str:
        """The type of a value in names of intrinsic functions."""
        return "f64" if self.lanes == 1 else f"v{self.lanes}f64"

    def number(self, value: float) -> str:
        """The constant, to the last bit."""
        return bits(value) if self.lanes == 1 else f"splat (double {bits(value)})"

    def splat(self, name: str, value: str) -> list[str]:
        """The vector `name` of equal numbers."""
        t, same = self.type, f"<{self.lanes} x i32> zeroinitializer"
        return [
            f"  {name}.first = insertelement {t} poison, double {value}, i32 0",
            f"  {name} = shufflevector {t} {name}.first, {t} poison, {same}",
        ]


def words_of(arithmetic: Arithmetic) -> dict[str, str]:
    """Words that the column `llvm` of the operation table names."""
    return {
        "t": arithmetic.type,
        "b": "i1" if arithmetic.lanes == 1 else f"<{arithmetic.lanes} x i1>",
        "s": arithmetic.suffix,
        "f": f"{arithmetic.flags} " if arithmetic.flags and not arithmetic.fuses else "",
        "zero": arithmetic.number(0.0),
        "one": arithmetic.number(1.0),
        "minus": arithmetic.number(-1.0),
    }


def bits(value: float) -> str:
    """A double in LLVM's language."""
    return f"0x{struct.unpack('>Q', struct.pack('>d', value))[0]:016X}"

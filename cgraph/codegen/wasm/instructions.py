"""Instructions of WebAssembly: their numbers, and how integers and doubles are written between them."""

from __future__ import annotations

import ast
import math
import struct

F64, I64, I32 = 0x7C, 0x7E, 0x7F
TYPES = {"f64": (F64,), "i64": (I64,), "i32": (I32,), "pair": (F64, F64), "None": ()}

# fmt: off   (a table is read by columns)
OPERATORS: dict[type[ast.AST], dict[int, int]] = {
    ast.Add: {F64: 0xA0, I64: 0x7C, I32: 0x6A},
    ast.Sub: {F64: 0xA1, I64: 0x7D, I32: 0x6B},
    ast.Mult: {F64: 0xA2, I64: 0x7E, I32: 0x6C},
    ast.Div: {F64: 0xA3},
    ast.FloorDiv: {I64: 0x7F},  # of numbers that are not negative
    ast.BitAnd: {I64: 0x83, I32: 0x71},
    ast.BitOr: {I64: 0x84, I32: 0x72},
    ast.LShift: {I64: 0x86},
    ast.RShift: {I64: 0x87},
    ast.Eq: {F64: 0x61, I64: 0x51, I32: 0x46},
    ast.NotEq: {F64: 0x62, I64: 0x52, I32: 0x47},
    ast.Lt: {F64: 0x63, I64: 0x53, I32: 0x48},
    ast.Gt: {F64: 0x64, I64: 0x55, I32: 0x4A},
    ast.LtE: {F64: 0x65, I64: 0x57, I32: 0x4C},
    ast.GtE: {F64: 0x66, I64: 0x59, I32: 0x4E},
}
INTRINSICS: dict[str, tuple[bytes, int]] = {  # {function: its instruction, the type of its result}
    "abs": (b"\x99", F64),
    "ceil": (b"\x9b", F64),
    "floor": (b"\x9c", F64),
    "round": (b"\x9e", F64),
    "sqrt": (b"\x9f", F64),
    "min": (b"\xa4", F64),
    "max": (b"\xa5", F64),
    "copysign": (b"\xa6", F64),
    "bits": (b"\xbd", I64),
    "double": (b"\xbf", F64),  # the same 64 bits, as an integer and as a double
    "int": (b"\xfc\x06", I64),
    "float": (b"\xb9", F64),  # toward 0, and what does not fit to the last that does
}
# fmt: on
NEGATED, FROM_I32, SELECT, RETURN, IF, ELSE, END = b"\x9a", b"\xb7", b"\x1b", b"\x0f", b"\x04\x40", b"\x05", b"\x0b"
LOOP, LEAVE_UNLESS, REPEAT = b"\x02\x40\x03\x40", b"\x45\x0d\x01", b"\x0c\x00\x0b\x0b"
GET, SET, TEE, CALL = b"\x20", b"\x21", b"\x22", b"\x10"
LOAD, STORE, LOAD_WORD = b"\x2b\x03", b"\x39\x03", b"\x35\x00"  # a double, and 32 bits as an integer of 64


def unsigned(number: int) -> bytes:
    """LEB128: seven bits a byte, the lowest first."""
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*out, number])


def signed(number: int) -> bytes:
    """LEB128 in two's complement."""
    out = bytearray()
    while not -0x40 <= number < 0x40:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*out, number & 0x7F])


def double(value: float) -> bytes:
    """The instruction that brings a double, exactly, by the shortest of three: from an integer, from a single."""
    if abs(value) < 64.0 and value == int(value) and (value or math.copysign(1.0, value) > 0.0):
        return b"\x41" + signed(int(value)) + FROM_I32
    if abs(value) < 2.0**127 and struct.unpack("<f", struct.pack("<f", value))[0] == value:
        return b"\x43" + struct.pack("<f", value) + b"\xbb"
    return b"\x44" + struct.pack("<d", math.nan if value != value else value)


def counted(items: list[bytes]) -> bytes:
    """A vector: how many, then these."""
    return unsigned(len(items)) + b"".join(items)


def sized(content: bytes) -> bytes:
    """Number of bytes, then these."""
    return unsigned(len(content)) + content

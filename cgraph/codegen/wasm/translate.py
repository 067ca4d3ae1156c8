"""Functions in a small part of Python's grammar, as the instructions of a WebAssembly function.

Numbers are doubles, integers of 64 bits, and of 32 bits what compares and addresses. A parameter is a double unless its
annotation says otherwise; a variable has the type of what it is first set to. `a if c else b` computes both.
"""

from __future__ import annotations

import ast
from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import NamedTuple

from . import instructions as ins
from .instructions import F64, I32, I64


class Signature(NamedTuple):
    """Number and types of a function, for its calls."""

    number: int
    parameters: tuple[int, ...]
    results: tuple[int, ...]


def types_of(function: ast.FunctionDef) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """The types of a function's parameters and results."""
    parameters = [_type(argument.annotation) for argument in function.args.args]
    return tuple([kind for kinds in parameters for kind in kinds]), _type(function.returns)


def _type(annotation: ast.expr | None) -> tuple[int, ...]:
    return (F64,) if annotation is None else ins.TYPES[ast.unparse(annotation)]


class Body:
    """The instructions of a function while they are written.

    parts: bytes, and in the text of an operation integers: the place of an argument.
    """

    def __init__(self, signatures: Mapping[str, Signature], parameters: Sequence[tuple[str, int]] = ()) -> None:
        self.parts: list[bytes | int] = []
        self._signatures = signatures
        self._parameters = len(parameters)
        self._variables = {name: (index, kind) for index, (name, kind) in enumerate(parameters)}

    def function(self, definition: ast.FunctionDef) -> bytes:
        """The code of a definition: its locals, and the instructions."""
        self.statements(definition.body)
        if isinstance(definition.body[-1], ast.Return):
            self.parts.pop()  # the end returns, too
        kinds = [kind for _, kind in list(self._variables.values())[self._parameters :]]
        runs = [ins.unsigned(len([*same])) + bytes([kind]) for kind, same in groupby(kinds)]
        return ins.sized(
            ins.counted(runs) + b"".join([part for part in self.parts if isinstance(part, bytes)]) + ins.END
        )

    def statements(self, nodes: Sequence[ast.stmt]) -> None:
        """Instructions of statements, one after another."""
        for node in nodes:
            self.statement(node)

    def statement(self, node: ast.stmt) -> None:
        """Instructions of a statement."""
        match node:
            case ast.Assign([target], value):
                kinds = self._kinds(value)
                self.expression(value)
                names = target.elts if isinstance(target, ast.Tuple) else [target]
                for name, kind in reversed([*zip(names, kinds, strict=True)]):
                    at = self._variables.setdefault(ast.unparse(name), (len(self._variables), kind or I64))[0]
                    self.parts.append(ins.SET + ins.unsigned(at))
            case ast.If(test, inside, otherwise):
                self.condition(test)
                self.parts.append(ins.IF)
                self.statements(inside)
                self.parts += [ins.ELSE] if otherwise else []
                self.statements(otherwise)
                self.parts.append(ins.END)
            case ast.While(test, inside):
                self.parts.append(ins.LOOP)
                self.condition(test)
                self.parts.append(ins.LEAVE_UNLESS)
                self.statements(inside)
                self.parts.append(ins.REPEAT)
            case ast.Return(value) if value is not None:
                for each in value.elts if isinstance(value, ast.Tuple) else [value]:
                    self.expression(each, F64)
                self.parts.append(ins.RETURN)
            case ast.Expr(value):
                self.expression(value)
            case _:
                raise _untold(node)

    def condition(self, node: ast.expr) -> None:
        """Instructions that leave an integer of 32 bits, not 0 where the condition holds."""
        self.expression(node)
        kind = self._kinds(node)[0]
        if kind != I32:
            self.parts.append(
                (ins.double(0.0) if kind == F64 else b"\x42\x00") + bytes([ins.OPERATORS[ast.NotEq][kind]])
            )

    def expression(self, node: ast.expr, wanted: int = 0) -> None:
        """Instructions that leave its value. wanted: the type of an integer that is written as such."""
        match node:
            case ast.Constant(float(value)):
                self.parts.append(ins.double(value))
            case ast.Constant(int(value)) if wanted == F64:
                self.parts.append(ins.double(float(value)))
            case ast.Constant(int(value)):
                self.parts.append((b"\x41" if wanted == I32 else b"\x42") + ins.signed(value))
            case ast.Name(name) if name[0] == "_":  # an argument of an operation
                self.parts.append(int(name[1:]))
            case ast.Name(name):
                at = ins.unsigned(self._variables[name][0])
                if self.parts[-1:] == [ins.SET + at]:  # it is on the stack still
                    self.parts[-1] = ins.TEE + at
                else:
                    self.parts.append(ins.GET + at)
            case ast.BinOp(left, operator, right) | ast.Compare(left, [operator], [right]):
                kind = self._kinds(left)[0] or self._kinds(right)[0]
                self.expression(left, kind)
                self.expression(right, kind)
                self.parts.append(bytes([ins.OPERATORS[type(operator)][kind or wanted or I64]]))
            case ast.UnaryOp(ast.USub(), ast.Constant(value)):
                self.expression(ast.Constant(-value), wanted)  # type: ignore[operator]
            case ast.UnaryOp(ast.USub(), operand):
                self.expression(operand)
                self.parts.append(ins.NEGATED)
            case ast.BoolOp(operator, [first, *rest]):
                self.condition(first)
                for each in rest:
                    self.condition(each)
                    self.parts.append(b"\x71" if isinstance(operator, ast.And) else b"\x72")
            case ast.IfExp(test, body, orelse):
                kind = self._kinds(body)[0] or self._kinds(orelse)[0]
                self.expression(body, kind)
                self.expression(orelse, kind)
                self.condition(test)
                self.parts.append(ins.SELECT)
            case ast.Call(ast.Name(name), arguments):
                self._call(name, arguments)
            case _:
                raise _untold(node)

    def _call(self, name: str, arguments: list[ast.expr]) -> None:
        if name in ("load", "store", "word"):  # of an address and, at the end, its offset
            count = 1 + (name == "store")
            for argument, kind in zip(arguments[:count], (I32, F64), strict=False):
                self.expression(argument, kind)
            offset = ast.literal_eval(arguments[count]) if len(arguments) > count else 0
            instruction = {"load": ins.LOAD, "store": ins.STORE, "word": ins.LOAD_WORD}[name]
            self.parts.append(instruction + ins.unsigned(offset))
        elif name == "address":  # an integer of 64 bits as one
            self.expression(arguments[0])
            self.parts.append(b"\xa7")
        elif name in self._signatures:
            signature = self._signatures[name]
            for argument, kind in zip(arguments, signature.parameters, strict=True):
                self.expression(argument, kind)
            self.parts.append(ins.CALL + ins.unsigned(signature.number))
        else:
            for argument in arguments:
                self.expression(argument, I64 if name == "double" else F64)
            of_flag = name == "float" and self._kinds(arguments[0]) == (I32,)
            self.parts.append(ins.FROM_I32 if of_flag else ins.INTRINSICS[name][0])

    def _kinds(self, node: ast.expr) -> tuple[int, ...]:
        """The types of its values; 0 of an integer that is written as such, which is what it meets."""
        match node:
            case ast.Constant(float()):
                return (F64,)
            case ast.Name(name):
                return (self._variables[name][1] if name in self._variables else F64,)
            case ast.BinOp(left, _, right) | ast.IfExp(_, left, right):
                return (self._kinds(left)[0] or self._kinds(right)[0],)
            case ast.UnaryOp(_, operand):
                return self._kinds(operand)
            case ast.Compare() | ast.BoolOp():
                return (I32,)
            case ast.Call(ast.Name("word")):
                return (I64,)
            case ast.Call(ast.Name("address")):
                return (I32,)
            case ast.Call(ast.Name("load")):
                return (F64,)
            case ast.Call(ast.Name(name)) if name in self._signatures:
                return self._signatures[name].results
            case ast.Call(ast.Name(name)):
                return (ins.INTRINSICS[name][1],)
        return (0,)


def _untold(node: ast.AST) -> NotImplementedError:
    return NotImplementedError(f"no WebAssembly for this text of an operation: {ast.unparse(node):.60}")

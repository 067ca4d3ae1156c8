"""Tangent: forward mode over statements, from tangents of what they begin with to those of what they end with."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set

from ..statement import reads_and_writes, row_of
from ..statements.call import zeroed
from .products import Products
from .single_assignment import Assignment, Registers


class Tangent(Registers):
    """The statements that push tangents on through assignments.

    dots: {register: the one that has its tangent}; the rules extend it.  active: registers that depend on what moves.
    products: graphs of J x_dot.  values: whether the statements themselves are among `statements`, each before its
    tangents.
    """

    def __init__(
        self,
        dots: Mapping[str, str],
        active: Set[str],
        lengths: dict[str, int],
        products: Products,
        *,
        values: bool = False,
        own: str = "@",
    ) -> None:
        super().__init__(lengths, own)
        self.dots, self.active, self.products, self.values = dict(dots), active, products, values

    def inner(self, more: Mapping[str, str] | None = None, *, values: bool = False) -> Tangent:
        """Tangent of a body: what has tangents here has them there, and more registers."""
        dots = {**self.dots, **(more or {})}
        return Tangent(dots, self.active, self.lengths, self.products, values=self.values or values, own=self.own)

    def push(self, assignments: Sequence[Assignment]) -> None:
        """Through these assignments, the first first."""
        for assignment in assignments:
            row = row_of(assignment.statement)
            if row.jvp is None:
                raise TypeError(f"a {row.kind.__name__} has no tangents: its row has no `jvp`")
            if self.values and not row.reruns:
                self.add(*assignment.statements)
            row.jvp(assignment, self)
            for name in set(reads_and_writes(assignment.statement)[1]) - set(self.active):
                self.dots.pop(name, None)

    def dot(self, register: str) -> str:
        """A new register for the tangent of one."""
        dot = self.fresh(f"{register}_dot", self.lengths[register])
        self.dots[register] = dot
        return dot

    def dot_or_zero(self, register: str) -> str:
        """The tangent of a register; a register of zeros where it does not move."""
        if register in self.dots:
            return self.dots[register]
        zero = self.fresh(f"{register}_dot", self.lengths[register])
        self.add(zeroed(zero))
        return zero

    def moving(self, inputs: Sequence[str]) -> tuple[int, ...]:
        """Numbers of the registers that have tangents."""
        return tuple([k for k, name in enumerate(inputs) if name in self.dots and self.lengths[name]])

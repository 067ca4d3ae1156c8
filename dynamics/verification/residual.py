"""Residuals: equations that must hold, how far they are from it, and a certificate of all of them."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from cgraph._shared import Array, Json, html_lines, html_table


@dataclass(frozen=True)
class Bound:
    """Largest value of a residual, and its reason."""

    name: str
    value: float
    reason: str


ROUNDING = Bound("rounding", 1e-13, "the same terms summed in another order, some hundred roundings of the largest")
POSITIVE = Bound("positive", 0.0, "the smallest eigenvalue of M, scaled to rows of about 1, exceeds its rounding")
DIFFERENCES = Bound("differences", 1e-7, "what halving the step of fourth-order differences does not account for")
PEERS = Bound("peers", 1e-10, "the rounding of two programs, and inertias that pass through principal axes")
PROXIMAL = Bound("proximal", 1e-7, "a solver that iterates on regularized constraints until 1e-14 of them is left")


class UnavailableError(Exception):
    """Raised when a peer cannot do a task for a model."""


@dataclass(frozen=True)
class Residual:
    """An equation, and by how much the worst state misses it, relative to the terms of the equation."""

    equation: str
    value: float
    bound: Bound
    note: str = ""

    @property
    def passed(self) -> bool:
        """Whether the residual is within its bound; NaN is not."""
        return self.value <= self.bound.value


def rounded(equation: str, difference: Array, terms: Array) -> Residual:
    """An equation that holds but for rounding: the difference of its sides, and the terms that it is relative to."""
    return Residual(equation, worst(difference, terms), ROUNDING)


@dataclass(frozen=True)
class Certificate:
    """Equations of a model's graphs held at random states, as `certify` makes it.

    Parameters
    ----------
    states, seed : int
        How many random states, and the seed of their generator.
    residuals : tuple of Residual
        How far each equation is from holding, with its bound.
    left_out : tuple of str
        Equations that say nothing of this model and peers that are not there, a sentence each.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.certify(dyn.scenes.load("spring_mass"), states=2).passed
    True
    """

    states: int
    seed: int
    residuals: tuple[Residual, ...]
    left_out: tuple[str, ...]  # equations that say nothing of this model and peers that are not there: a sentence each

    @property
    def passed(self) -> bool:
        """Whether all residuals are within their bounds."""
        return all([each.passed for each in self.residuals])

    def __str__(self) -> str:
        """A line for each residual, then the bounds with their reasons, and what was left out."""
        wide = max([len(each.equation) for each in self.residuals])
        lines = [
            f"{'ok  ' if each.passed else 'FAIL'}  {each.equation:{wide}}  {each.value:8.1e}  {each.bound.name}"
            + (f"  ({each.note})" if each.note else "")
            for each in self.residuals
        ]
        return "\n".join(lines + self._remarks())

    def _repr_html_(self) -> str:
        rows = [
            ("ok" if each.passed else "FAIL", each.equation, each.note, each.bound.name, f"{each.value:.1e}")
            for each in self.residuals
        ]
        table = html_table(("", "equation", "", "bound", "residual"), rows, texts=4)
        return table + html_lines("\n".join(self._remarks()))

    def _remarks(self) -> list[str]:
        bounds = dict.fromkeys([each.bound for each in self.residuals])
        lines = [f"{self.states} random states, seed {self.seed}. Bounds:"]
        lines += [f"  {each.name}, {each.value:g}: {each.reason}" for each in bounds]
        return lines + [f"left out: {each}" for each in self.left_out]

    def to_dict(self) -> dict[str, Json]:
        """Dictionary for JSON."""
        return (
            {"passed": self.passed}
            | asdict(self)
            | {"residuals": [asdict(each) | {"passed": each.passed} for each in self.residuals]}
        )


def worst(difference: Array, terms: Array) -> float:
    """The largest difference relative to the largest term of its state; over all states. NaN stays."""
    flat = [np.abs(each).reshape(len(each), -1).max(axis=1) for each in (difference, terms)]
    return float(np.max(np.divide(flat[0], flat[1], out=np.array(flat[0]), where=flat[1] > 0.0)))

"""Cases: the rows of the stability table, models with a start, a horizon, what to watch and a bound to meet."""

from cgraph._shared import memo, or_nearest

from ...accuracy_task import RTOL, Criterion, StabilityCase
from . import chains, extremes, fields, rotation, stiff

__all__ = ["RTOL", "Criterion", "StabilityCase", "load", "names", "table"]


@memo(1)
def table() -> dict[str, StabilityCase]:
    """{name: case}, made when first asked for: to import the package need not build a chain of a thousand links."""
    return {case.name: case for rows in (stiff, chains, rotation, fields, extremes) for case in rows.cases()}


def names() -> list[str]:
    """Names of the cases.

    Returns
    -------
    list of str
        In the order of the table.

    Examples
    --------
    >>> import dynamics as dyn
    >>> dyn.cases.names()[:2]
    ['spring pendulum, k = 100', 'spring pendulum, k = 10000']
    """
    return list(table())


def load(name: str) -> StabilityCase:
    """The case of that name: a scene with its exact motion, and bounds to meet.

    Parameters
    ----------
    name : str
        One of `names()`.

    Returns
    -------
    StabilityCase
        With the fields of a Scene (`model`, `q`, `qd`, `t_end`), `criteria`, tolerances, and `solution(times)`.

    Raises
    ------
    ValueError
        For a name that is none of them.

    Examples
    --------
    >>> import dynamics as dyn
    >>> case = dyn.cases.load("exponential decay")
    >>> case.start, case.t_end, [criterion.quantity for criterion in case.criteria]
    ((1.0,), 50.0, ['error'])
    """
    if not isinstance(name, str) or name not in table():
        raise ValueError(f"there is no case {name!r:.80}; {or_nearest(str(name), [*table()])}")
    return table()[name]

"""A state as the arguments q and qd."""

from collections.abc import Sequence

from dynamics.systems.model import Model, as_ode


def split_state(model: Model, x: Sequence[float]) -> tuple[Sequence[float], Sequence[float] | None]:
    """A state (m,) as the arguments q and qd; of an OdeSystem the state and None."""
    nq = len(model.coordinates)
    return (x, None) if as_ode(model) is not None else (x[:nq], x[nq:])

"""Event: a quantity of a moving system that is watched for its zeros."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from cgraph import Node
from cgraph.extend import check_name

from ..systems.system import sequence


@dataclass(frozen=True)
class Event:
    """Where a quantity passes through zero.

    It is looked at sixteen times in each step. Of two crossings closer than that both may be missed: limit the steps by
    `dt` or `max_step` where a quantity changes faster than the motion does.

    Parameters
    ----------
    name : str
        By which `Trajectory.events` lists it.
    value : callable
        The quantity, value(q, qd, t) or value(q, qd, t, p) with nodes for arguments, in any unit; of an OdeSystem
        value(x, t) or value(x, t, p). p is {parameter name: node}.
    direction : int
        1 upwards only, -1 downwards only, 0 both.
    terminal : bool
        Whether the run ends there.

    Raises
    ------
    TypeError
        For a name that is no text, a value that is no function, a `terminal` that is neither True nor False.
    ValueError
        For another direction, and a name that is empty or cannot be printed.

    Examples
    --------
    >>> import dynamics as dyn
    >>> ball = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 9.81 * q[0], ["height"])
    >>> ground = dyn.Event("ground", lambda q, qd, t: q[0], direction=-1, terminal=True)
    >>> dyn.simulate(ball, [1.0], [0.0], 1.0, events=ground).stats.message
    "event 'ground' at t = 0.451524 s"
    """

    name: str
    value: Callable[..., Node]
    direction: int = 0
    terminal: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not callable(self.value) or not isinstance(self.terminal, bool):
            raise TypeError(
                "an event needs a name, a function, and True or False for `terminal`, got "
                f"{self.name!r:.40}, {self.value!r:.40} and {self.terminal!r:.40}"
            )
        check_name("an event", self.name)
        if self.direction not in (-1, 0, 1):
            raise ValueError(f"event {self.name!r}: direction must be 1, -1 or 0, got {self.direction!r}")


def as_events(events: Event | Iterable[Event]) -> tuple[Event, ...]:
    """One event or several, as a tuple. Raises TypeError for anything else, ValueError for two of one name."""
    several = (events,) if isinstance(events, Event) else tuple(sequence("events must be", events))
    names = set()
    for event in several:
        if not isinstance(event, Event):
            raise TypeError(f"events must be of the type Event, got {type(event).__name__}: {event!r:.60}")
        if event.name in names:
            raise ValueError(f"two events have the name {event.name!r}")
        names.add(event.name)
    return several

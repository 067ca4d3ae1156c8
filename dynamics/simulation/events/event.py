"""Event: a quantity of a moving system that is watched for its zeros."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cgraph import Node
from cgraph.extend import check_name

from ...systems.arguments import sequence


@dataclass(frozen=True)
class Event:
    """Event: a quantity that passes through zero, and what happens there.

    A quantity that touches zero and turns back counts too, with direction 0, where its extremum is zero to the rounding
    of its evaluation. One that stays zero for a while has one event, where it arrives; one that starts there has none
    before it comes back, but for one with a reset and a direction, a contact: it happens there if it closes. Of events
    at one instant those without a reset are first; then one reset follows another, the first in the list that is due
    after the last: what is zero and moves in its direction. What another reset has turned back is not; contacts that
    rest are, once another reset closes them. A jump by a reset is no crossing.

    Value and slope of the quantity are looked at sixteen times in each step, and as often more as it takes until the
    cubics between looks agree with them, at most 1024 times. Where that is too few, `Stats.warnings` says so: limit the
    steps by `max_step` or `dt`.

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
    reset : callable, optional
        The state from which the run goes on, reset(q, qd, t) or reset(q, qd, t, p) -> (q, qd) as nodes or numbers; of
        an OdeSystem reset(x, t) or reset(x, t, p) -> x. Quaternions in q are brought to length 1. Both states are rows
        of the trajectory, at the same instant, the first and the last of several resets there; at a time of `t_eval`,
        the one before is. Where they follow one another in no time, as the bounces of a ball that comes to rest do, the
        run stops and says so. Without a direction, a reset that starts at zero does not know its side: how it leaves
        from there by itself resets nothing, and a warning says so.

    Raises
    ------
    TypeError
        For a name that is no text, a value or a reset that is no function, a `terminal` that is neither True nor False.
    ValueError
        For another direction, an event that ends the run and resets the state, a name that is empty or not printable.

    Examples
    --------
    >>> import dynamics as dyn
    >>> ball = dyn.System(lambda q, qd, t: 0.5 * qd[0] ** 2 - 9.81 * q[0], ["height"])
    >>> ground = dyn.Event("ground", lambda q, qd, t: q[0], direction=-1, terminal=True)
    >>> dyn.simulate(ball, [1.0], [0.0], 1.0, events=ground).stats.message
    "event 'ground' at t = 0.451524 s"
    >>> bounce = dyn.Event("bounce", lambda q, qd, t: q[0], direction=-1, reset=lambda q, qd, t: (q, [-0.5 * qd[0]]))
    >>> dyn.simulate(ball, [1.0], [0.0], 1.2, events=bounce).events["bounce"].t.round(4)
    array([0.4515, 0.903 , 1.1288])
    """

    name: str
    value: Callable[..., Node]
    direction: int = 0
    terminal: bool = False
    reset: Callable[..., Any] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not _is_function(self.value) or not isinstance(self.terminal, bool):
            raise TypeError(
                "an event needs a name, a function, and True or False for `terminal`, got "
                f"{self.name!r:.40}, {self.value!r:.40} and {self.terminal!r:.40}"
            )
        check_name("an event", self.name)
        if not isinstance(self.direction, (int, np.integer)) or self.direction not in (-1, 0, 1):
            raise ValueError(f"event {self.name!r}: direction must be 1, -1 or 0, got {self.direction!r}")
        if self.reset is not None and not _is_function(self.reset):
            raise TypeError(f"event {self.name!r}: reset must be a function, got {self.reset!r:.40}")
        if self.reset is not None and self.terminal:
            raise ValueError(f"event {self.name!r}: a run that ends there goes on from no reset state; leave out one")


def _is_function(value: object) -> bool:
    return callable(value) and not isinstance(value, type)


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

"""What is said of momenta that are constant: cyclic coordinates."""

from __future__ import annotations


def constant_momentum(name: str) -> str:
    """A sentence for a velocity of `conserved_momenta`."""
    return f"The momentum of {name!r} is constant while no torque acts on it: neither L nor a force depends on it."

"""Elements of a file that a mechanism has not: refused, or left out and said; and loops that follow from others."""

import warnings
from collections.abc import Collection, Mapping, Sequence

from cgraph._shared import require_flag

from ..equations.constraints.constraint_rank import independent_rows
from ..multibody.trees.mechanism import Mechanism, MechanismError, MechanismWarning
from ..systems.constraints import ConstraintError


def present(what: Mapping[str, object]) -> list[str]:
    """The sentences of what is there."""
    return [sentence for sentence, is_there in what.items() if is_there]


def listed(names: Sequence[str]) -> str:
    """All of the names, or the first few of many, each on one line."""
    shown = [name if name.isprintable() else repr(name) for name in names[:5]]
    return ", ".join([*shown, *([f"{len(names) - 5} more"] if len(names) > 5 else [])])


def unused(name: str, names: Collection[str]) -> str:
    """The name, or with as many apostrophes as make it one that is not among the names."""
    return name if name not in names else unused(f"{name}'", names)


def follows_itself(name: str, leaders: Mapping[str, str]) -> bool:
    """Whether a joint mimics itself, by way of others."""
    at, seen = leaders[name], {name}
    while at in leaders and at not in seen:
        seen.add(at)
        at = leaders[at]
    return at == name


def refused_or_left_out(essential: Sequence[str], outside: Sequence[str], ignore: bool) -> tuple[str, ...]:
    """Sentences on what goes. Raises MechanismError for what belongs to the mechanism itself, unless `ignore`."""
    if not require_flag("ignore", ignore) and essential:
        raise MechanismError(f"a mechanism cannot have {'; '.join(essential)} (the option ignore leaves this out)")
    return (*essential, *outside)


def warned(mechanism: Mechanism, source: str) -> Mechanism:
    """The mechanism, once warnings have said what is left out of its source, and which loops follow from others.

    Raises MechanismError for loops that cannot be closed together.
    """
    if mechanism.left_out:
        text = f"{source}: left out {'; '.join(mechanism.left_out)}"
        warnings.warn(text, MechanismWarning, stacklevel=3)  # the caller of the public function
    if mechanism.loops and mechanism.moving:
        try:
            independent_rows(mechanism.system.constraints)
        except ConstraintError as error:
            raise MechanismError(f"{source}: {error}") from None
    return mechanism

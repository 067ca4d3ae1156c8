"""A sentence on a model: that inverse dynamics is that of its tree."""

from dynamics import scenes
from dynamics.equations.constraints.constraint_rank import independent_rows

SHOWN = 4  # names; more are counted


def tree_alone(scene: scenes.Scene) -> str:
    """A sentence: torques are those of the tree, without the forces of its constraints; empty where nothing is held."""
    if scene.ode is not None:
        return ""
    loops = scene.mechanism.loops if scene.mechanism is not None else ()
    if not loops:
        independent_rows(scene.system.constraints)  # raises for a condition that holds nothing
    held = list(dict.fromkeys([loop.label for loop in loops])) or list(scene.system.constraints.names)
    if not held:
        return ""
    more = f" and {len(held) - SHOWN} more" if len(held) > SHOWN else ""
    what = f"{'loop' if loops else 'constraint'}{'s' if len(held) > 1 else ''}"
    names = f"{', '.join(held[:SHOWN])}{more}"
    return f"Inverse dynamics is without the forces of the {what} {names}: forward dynamics has these."

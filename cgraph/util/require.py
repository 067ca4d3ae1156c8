"""Checks of plain arguments of public functions: flags, whole numbers, choices, sequences, mappings and paths.

what: what the value is, as the error begins.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Mapping
from numbers import Integral
from pathlib import Path
from typing import Any

import numpy as np

from ..core.graph import Graph
from ..core.node import Node


def require_flag(what: str, value: object) -> bool:
    """The value as a bool: True or False, also NumPy's. Raises TypeError for what Python only counts as one."""
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    raise TypeError(f"{what} must be True or False, got {value!r:.60}")


def require_whole(what: str, value: object, least: int = 0) -> int:
    """The value as an int, if it is a whole number from `least`, also NumPy's; no bool.

    Raises TypeError for what is no whole number, ValueError for one that is less, or does not fit 64 bits.
    """
    if isinstance(value, bool) or not isinstance(value, Integral):
        raise TypeError(f"{what} must be a whole number from {least}, got {type(value).__name__}: {value!r:.60}")
    number = int(value)
    if number < least:
        raise ValueError(f"{what} must be a whole number from {least}, got {value!r:.60}")
    if number >= 2**63:
        raise ValueError(f"{what} must be a whole number below 2**63, got {value!r:.20}...")
    return number


def require_choice(what: str, value: object, choices: Collection[str]) -> str:
    """The value, if it is one of the choices. Raises ValueError for any other."""
    if isinstance(value, str) and value in choices:
        return value
    raise ValueError(f"{what} must be one of {', '.join(choices)}, got {value!r:.60}")


def require_kind(what: str, value: Any, kind: Any, noun: str = "") -> Any:
    """The value, if it is of that class, in messages `noun`. Raises TypeError for anything else."""
    if isinstance(value, kind):
        return value
    raise TypeError(f"{what} must be {noun or f'a {kind.__name__}'}, got {type(value).__name__}: {value!r:.60}")


def is_function(value: object) -> bool:
    """Whether the value can be called and is no class."""
    return callable(value) and not isinstance(value, type)


def require_sequence(what: str, value: object, of: str, kind: type | tuple[type, ...] = object) -> tuple[Any, ...]:
    """The members of a sequence, each an instance of `kind`; an iterator is read once. Raises TypeError.

    of: what they are, in the plural.
    """
    if not isinstance(value, Iterable) or isinstance(value, type):
        raise TypeError(f"{what} must be a sequence of {of}, got {type(value).__name__}: {value!r:.60}")
    members = tuple(value)
    for member in members:
        if not isinstance(member, kind):
            raise TypeError(f"{what} must be a sequence of {of}, got {type(member).__name__} within: {member!r:.60}")
    return members


def require_mapping(what: str, value: object, of: str) -> Mapping[Any, Any]:
    """The value, if it is a mapping. Raises TypeError for anything else.

    of: from what to what, as "input: value".
    """
    found: Mapping[Any, Any] = require_kind(what, value, Mapping, f"a mapping {{{of}}}")
    return found


def require_texts(what: str, value: object) -> Mapping[str, str]:
    """The value, if it is a mapping of names to texts; an empty one for None. Raises TypeError for anything else."""
    texts: Mapping[str, Any] = {} if value is None else require_mapping(what, value, "name: text")
    for name, text in texts.items():
        if not isinstance(text, str):
            given = f"{type(text).__name__} for {name!r:.60}: {text!r:.60}"
            raise TypeError(f"{what} must be a mapping {{name: text}}, got {given}")
    return texts


def require_path(what: str, value: object) -> Path:
    """The value, a string or a path, as a path, a leading ~ read as the home. Raises TypeError for anything else."""
    if not isinstance(value, (str, os.PathLike)):
        raise TypeError(f"{what} must be a path, got {type(value).__name__}: {value!r:.60}")
    return Path(value).expanduser()


def require_graph(what: str, graph: object) -> None:
    """Raise TypeError, saying that the function `what` needs a graph, for anything else."""
    if isinstance(graph, Graph):
        return
    hint = "; write cg.Graph(inputs, {name: node})" if isinstance(graph, Node) else ""
    if hasattr(type(graph), "coordinates"):  # a model has graphs; see `dynamics.Model`
        hint = "; forward_dynamics(model) of the package dynamics is one"
    raise TypeError(f"{what} needs a cg.Graph, got {type(graph).__name__}: {graph!r:.60}{hint}")

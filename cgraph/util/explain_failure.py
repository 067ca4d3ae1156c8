"""A sentence for what Python says when it stumbles over a wrong argument, looked for once a call has failed."""

import inspect
from collections.abc import Callable, Collection, Mapping
from dataclasses import is_dataclass
from functools import wraps
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from ..core.evaluation import is_finite

T = TypeVar("T", bound=Callable[..., object])
# What Python raises; a subclass, such as GraphError, is a sentence already.
_STUMBLES = (TypeError, ValueError, AttributeError, KeyError, IndexError, AssertionError, OverflowError)


def explain_failure(called: T) -> T:
    """The function, or a class with its `__init__`, of which a wrong argument is told in a sentence.

    Arguments are held against their annotations after a call has failed. Where all fit, the error goes on as it is.
    """
    if not isinstance(called, type):
        return _explained(called, called.__name__)  # type: ignore[return-value]  # of the same signature
    setattr(called, "__init__", _explained(vars(called)["__init__"], called.__name__))  # noqa: B010 (for mypy)
    return called


def _explained(function: Callable[..., object], who: str) -> Callable[..., object]:
    @wraps(function)
    def call(*args: object, **named: Any) -> Any:
        try:
            return function(*args, **named)
        except Exception as error:
            if type(error) not in _STUMBLES:
                raise
            given = inspect.signature(function).bind_partial(*args, **named).arguments
            for name, kind in get_type_hints(function).items():
                for part in misfits(given[name], kind) if name in given else ():
                    got = f"{type(part).__name__}{'' if part is given[name] else ' within'}: {part!r:.60}"
                    raise TypeError(f"{name} of {who} must be {function.__annotations__[name]}, got {got}") from error
            raise

    return call


def misfits(value: Any, kind: Any) -> list[object]:
    """The parts of a value that are not what an annotation says; the value itself where it is another kind of thing."""
    origin, parts = get_origin(kind) or kind, get_args(kind)
    if origin in (Union, UnionType):
        found = [misfits(value, part) for part in parts]
        return next((each for each in found if each[0] is not value), [value]) if all(found) else []
    if origin is Literal:
        return [] if isinstance(value, str) and value in parts else [value]
    refused = type if origin is Callable else str if parts and parts[0] is not str else ()
    if kind is Any or not isinstance(origin, type):  # or a variable of types
        return []
    fits = isinstance(value, origin) or (origin is float and is_finite(value))
    if not fits or isinstance(value, refused):
        return [value]
    inside: list[tuple[object, object]] = []
    if is_dataclass(value) or hasattr(value, "_fields"):
        inside = [(getattr(value, name), each) for name, each in get_type_hints(type(value)).items()]
    elif issubclass(origin, Mapping) and parts:
        inside = [pair for item in value.items() for pair in zip(item, parts, strict=True)]
    elif origin is tuple and parts and parts[-1] is not Ellipsis:
        if len(value) != len(parts):
            return [value]
        inside = list(zip(value, parts, strict=True))
    elif isinstance(value, Collection) and parts and parts[0] is not Any:  # an iterator has been read
        inside = [(each, parts[0]) for each in value]
    return [part for each, its in inside for part in misfits(each, its)]

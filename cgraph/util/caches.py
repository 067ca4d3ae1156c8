"""Caches: results that functions keep, the last few of a process or those of an object, all emptied by one call."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import _lru_cache_wrapper, lru_cache, wraps
from threading import RLock
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar, cast
from weakref import WeakSet, ref

Arguments = ParamSpec("Arguments")
First = TypeVar("First")
Result = TypeVar("Result")


class Memo(Protocol[Arguments, Result]):
    """Function that keeps its last results, and the function that makes them."""

    __wrapped__: Callable[Arguments, Result]

    def __call__(self, *args: Arguments.args, **named: Arguments.kwargs) -> Result:
        """The result, kept or made."""


class _Results:
    """Results of calls whose first argument is one object. A copy of the object has none of them, here or pickled."""

    def __init__(self, owner: object = None) -> None:
        self.owner = ref(_Results if owner is None else owner)
        self.known: dict[Hashable, object] = {}

    def __reduce__(self) -> tuple[type[_Results], tuple[()]]:
        return _Results, ()


OPERATIONS = 128  # of which results are kept: thrice the table of operations
_memos: list[_lru_cache_wrapper[Any]] = []
_kept: WeakSet[_Results] = WeakSet()


def memo(size: int) -> Callable[[Callable[Arguments, Result]], Memo[Arguments, Result]]:
    """A decorator: the function, of hashable arguments, keeps its last `size` results until `clear_caches`."""

    def decorate(function: Callable[Arguments, Result]) -> Memo[Arguments, Result]:
        keeping = lru_cache(size)(function)
        _memos.append(keeping)
        return cast("Memo[Arguments, Result]", keeping)

    return decorate


def kept_by_first(
    function: Callable[Concatenate[First, Arguments], Result],
) -> Callable[Concatenate[First, Arguments], Result]:
    """The function, whose results its first argument keeps, as a `cached_property` does.

    The other arguments, hashable, should be few. The first has a `__dict__` and can be referred to weakly.
    """

    @wraps(function)
    def call(first: First, /, *others: Arguments.args, **named: Arguments.kwargs) -> Result:
        results: _Results | None = first.__dict__.get("_results")
        if results is None or results.owner() is not first:
            results = first.__dict__["_results"] = _Results(first)
            _kept.add(results)
        key = (function, others, *named.items()) if named else (function, others)
        found = results.known.get(key, results)
        if found is results:
            found = results.known[key] = function(first, *others, **named)
        return cast("Result", found)

    return call


def made_once(method: Callable[..., Result]) -> Callable[..., Result]:
    """The method, whose results an object keeps as parts of itself, by hashable arguments.

    They are made once, by whichever thread asks first, and stay as long as the object does.
    """

    @wraps(method)
    def call(self: Any, *arguments: Hashable) -> Result:
        try:
            return self._made[method, arguments]  # type: ignore[no-any-return]
        except (AttributeError, KeyError):
            own: dict[str, Any] = self.__dict__
            with own.setdefault("_making", RLock()):
                made = own.setdefault("_made", {})
                if (method, arguments) not in made:
                    made[method, arguments] = method(self, *arguments)
                return cast("Result", made[method, arguments])

    return call


def clear_caches() -> int:
    """Forget the results that functions keep in memory: derived graphs, programs, machine code.

    What is asked for again is made again, to the same bits. Objects that somebody has stay as they are. Of machine code
    on disk see `clear_cache`.

    Returns
    -------
    int
        How many results were kept.

    Examples
    --------
    >>> import cgraph as cg
    >>> forgotten = cg.clear_caches()
    >>> cg.clear_caches()
    0
    """
    count = kept_results()
    for each in _memos:
        each.cache_clear()
    for results in list(_kept):
        results.known.clear()
    return count


def kept_results() -> int:
    """Number of results that functions keep at present."""
    return sum([each.cache_info().currsize for each in _memos]) + sum([len(results.known) for results in list(_kept)])

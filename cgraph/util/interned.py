"""Interned: one object for each key, kept for as long as somebody else keeps it, whatever threads ask for it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar
from weakref import WeakValueDictionary

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class Interned(Generic[Key, Value]):
    """A table from keys to the one object of each; it keeps none of them alive."""

    def __init__(self) -> None:
        self._table: WeakValueDictionary[Key, Value] = WeakValueDictionary()
        self._lock = threading.RLock()  # the garbage collector may run, and ask for an object, inside
        self.get = self._table.get  # the object of a key, or None: the fast way to what is there

    def get_or_make(self, key: Key, make: Callable[[], Value]) -> Value:
        """The object of a key, made if there is none; two threads that ask at once get the same."""
        with self._lock:
            value = self._table.get(key)
            if value is None:
                value = self._table[key] = make()
            return value

    def __len__(self) -> int:
        return len(self._table)

"""LLVM through llvmlite: text to machine code for this processor."""

from __future__ import annotations

import ctypes.util
import threading
from collections.abc import Iterable
from functools import cache
from typing import Any

LEVEL = 2  # of the code generator's optimisation; the text has no redundancy for passes over it to find
_lock = threading.Lock()  # llvmlite compiles in one context


class Code:
    """Machine code, alive as long as this object is."""

    def __init__(self, engine: Any) -> None:
        self._engine = engine

    def address(self, name: str) -> int:
        """Where a function begins."""
        return int(self._engine.get_function_address(name))


class Host:
    """The processor, as LLVM knows it.  lanes: the doubles in one of its vectors."""

    def __init__(self, binding: Any) -> None:
        self._binding = binding
        binding.initialize_native_target()
        binding.initialize_native_asmprinter()
        features = binding.get_host_cpu_features()
        self.lanes = 8 if features.get("avx512f") else 4 if features.get("avx2") else 2
        self._name, self._features = binding.get_host_cpu_name(), features.flatten()
        self._target = binding.Target.from_default_triple()

    def compile(self, text: str, functions: Iterable[str]) -> Code:
        """Machine code of a module's text that calls these functions of the C library."""
        binding = self._binding
        with _lock:
            self._find(functions)
            machine = self._target.create_target_machine(cpu=self._name, features=self._features, opt=LEVEL, jit=True)
            module = binding.parse_assembly(text, binding.create_context())
            engine = binding.create_mcjit_compiler(module, machine)
            engine.finalize_object()
            return Code(engine)

    def _find(self, functions: Iterable[str]) -> None:
        """See that LLVM finds the functions: it would end the process over a missing one."""
        find = self._binding.address_of_symbol
        if not all(map(find, functions)):
            self._binding.load_library_permanently(ctypes.util.find_library("m") or "ucrtbase")
        if missing := [name for name in functions if not find(name)]:
            raise RuntimeError(f"the C library of this machine has no {', '.join(missing)}")


def host() -> Host:
    """This machine. Raises ImportError when llvmlite is not installed."""
    try:
        from llvmlite import binding
    except ImportError:
        raise ImportError("machine code needs llvmlite: pip install 'cgraph[native]'") from None
    return _host(binding)


@cache
def _host(binding: Any) -> Host:
    return Host(binding)

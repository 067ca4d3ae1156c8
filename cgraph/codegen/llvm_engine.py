"""LLVM through llvmlite: text to machine code for this processor."""

from __future__ import annotations

import ctypes.util
import threading
import weakref
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from ..util.caches import memo
from ..util.extras import install
from .disk_cache import cached_code

if TYPE_CHECKING:
    from llvmlite.binding import ExecutionEngine, TargetMachine

LEVEL = 2  # of the code generator's optimization; the text has no redundancy for passes over it to find
SHORT = 2000  # nodes; beyond, level 1 but in vectors: three quarters of the time to compile, code as fast within 2 %.
# Nodes; beyond, level 0: a quarter of the time to compile, code that takes twice as long, or a tenth longer where it
# waits for memory.
QUICK = 60_000
_lock = threading.Lock()  # llvmlite compiles in one context


class MissingFunctionError(RuntimeError):
    """A function that the C library of this machine does not have."""


class Code:
    """Machine code, alive as long as this object is."""

    def __init__(self, engine: ExecutionEngine) -> None:
        self._engine = engine
        # Not by the engine's own __del__: in a cycle of garbage Python may end LLVM's context before what lives in it.
        weakref.finalize(self, engine.close).atexit = False

    def address(self, name: str) -> int:
        """Address of a function."""
        return int(self._engine.get_function_address(name))

    def function(self, name: str, prototype: Any) -> Any:
        """A function for calls through ctypes, of a type that `ctypes.CFUNCTYPE` gives; it keeps the code alive."""
        found = prototype(self.address(name))
        found.code = self
        return found


class Host:
    """The processor, as LLVM knows it.

    lanes: the doubles in one of its vectors.  registers: the values that its registers hold at once, some left over.
    """

    def __init__(self, binding: ModuleType, version: str) -> None:
        self._binding = binding
        binding.initialize_native_target()
        binding.initialize_native_asmprinter()
        features = binding.get_host_cpu_features()
        self.lanes = 8 if features.get("avx512f") else 4 if features.get("avx2") else 2
        self.registers = 29 if features.get("avx512vl") or not features.get("sse2") else 13
        self._name, self._features = binding.get_host_cpu_name(), features.flatten()
        self._target = binding.Target.from_default_triple()
        llvm = (f"llvmlite {version}", f"LLVM {binding.llvm_version_info}")
        self._identity = "\n".join((*llvm, self._target.triple, self._name, self._features))

    def compile(
        self,
        text: str,
        functions: Iterable[str],
        nodes: int,
        cache: Path | None = None,
        *,
        lanes: int = 1,
        looped: bool = False,
    ) -> Code:
        """Machine code, made or found in a folder, of a module's text that calls these functions of the C library.

        nodes: of its graphs.  lanes: of its numbers.  looped: whether they are loops over vectors that wait for memory.
        """
        level = 0 if nodes > (QUICK // 3 if looped else QUICK) else 1 if nodes > SHORT and lanes == 1 else LEVEL
        self.require(functions)
        with _lock:
            if cache is None:
                return self._loaded(self._translated(text, level))
            recipe = f"{self._identity}\nlevel {level}\n{text}"
            return self._loaded(cached_code(cache, recipe, lambda: self._translated(text, level)))

    def require(self, functions: Iterable[str]) -> None:
        """Raise MissingFunctionError unless LLVM finds them in the C library: it would end the process over one."""
        find = self._binding.address_of_symbol
        with _lock:
            if not all(map(find, functions)):
                self._binding.load_library_permanently(ctypes.util.find_library("m") or "ucrtbase")
            missing = [name for name in functions if not find(name)]
        if missing:
            raise MissingFunctionError(
                f"the C library of this machine has no {', '.join(missing)}: as machine code the operation needs "
                f"instructions, the column `llvm` of its row; backends 'python' and 'numpy' do without"
            )

    def _translated(self, text: str, level: int) -> bytes:
        """An object file of the text. LLVM's own cache wants the text parsed even when it has the object."""
        try:
            module = self._binding.parse_assembly(text, self._binding.create_context())
        except RuntimeError as error:
            told = " ".join(str(error).rstrip(" ^\n").split())
            raise ValueError(f"LLVM refuses instructions, as of an operation's column `llvm`: {told}") from error
        return bytes(self._machine(level).emit_object(module))

    def _loaded(self, object_file: bytes) -> Code:
        """The object file in memory that can be run. LLVM believes what it reads: a damaged one ends the process."""
        binding = self._binding
        nothing = binding.parse_assembly("", binding.create_context())  # an engine begins with a module
        engine = binding.create_mcjit_compiler(nothing, self._machine(LEVEL))
        engine.add_object_file(binding.ObjectFileRef.from_data(object_file))
        engine.finalize_object()
        return Code(engine)

    def _machine(self, level: int) -> TargetMachine:
        return self._target.create_target_machine(cpu=self._name, features=self._features, opt=level, jit=True)


def host() -> Host:
    """Machine on which this runs. Raises ImportError when llvmlite is not installed."""
    try:
        from llvmlite import __version__, binding
    except ImportError:
        raise ImportError(f"machine code needs llvmlite: {install('native')}") from None
    return _host(binding, __version__)


@memo(1)
def _host(binding: ModuleType, version: str) -> Host:
    return Host(binding, version)

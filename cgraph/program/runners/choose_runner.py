"""`runner`: the choice of what runs a program."""

from __future__ import annotations

from ...codegen.llvm_engine import MissingFunctionError
from ...util.explain_failure import explain_failure
from ...util.require import require_choice, require_flag
from ..program import Program
from .native_runner import NativeRunner
from .runner import Runner

BACKENDS = ("auto", "python", "llvm")


@explain_failure
def runner(program: Program, backend: str = "auto", *, fast: bool = False, fma: bool = True) -> Runner:
    """A program made ready to run.

    backend: "llvm" is machine code (extra `native`), "python" Python over lists; "auto" takes machine code where
    llvmlite is installed.  fast, fma: liberties with rounding, as in `cg.compile`.
    Raises ValueError for an unknown backend, ImportError for "llvm" without llvmlite.

    >>> import cgraph as cg
    >>> from cgraph.extend import Call, Program, runner
    >>> x = cg.variable("x")
    >>> halve = Call(cg.Graph([x], {"next": 0.5 * x}), ("x",), ("x",))
    >>> run = runner(Program({"x": 1}, [halve], record=["x"]))
    >>> run.run(run.memory({"x": 8.0}), passes=3).rows.ravel().tolist()
    [4.0, 2.0, 1.0]
    """
    require_choice("backend", backend, BACKENDS)
    fast, fma = require_flag("fast", fast), require_flag("fma", fma)
    if backend != "python":
        try:
            return NativeRunner(program, fast=fast, fma=fma)
        except (ImportError, MissingFunctionError):
            if backend == "llvm":
                raise
    from .python_runner import PythonRunner

    return PythonRunner(program, fma=fma)

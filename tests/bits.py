"""The same bits: a motion's digest by every way in which its steps can be computed."""

from __future__ import annotations

import base64
import ctypes
import json
import os
import pickle
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from hashlib import sha256
from pathlib import Path

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph.extend import Array, Json, columns, page_functions
from dynamics.equations.state_equation import normalization, state_equation, state_inputs
from dynamics.equations.substitute import substitute
from dynamics.integrators.elementwise import weighted
from dynamics.integrators.tableau import RK4
from dynamics.scenes.python_model import is_python, python_model
from dynamics.scenes.scenes import Scene
from dynamics.simulation.simulate import prepare
from dynamics.systems.arguments import TIME

STEP = 2.0**-10  # s: with it times are exact
STEPS, EVERY = 1000, 100  # steps, and of how many the last state counts
COMPILERS = ("cc", "gcc", "clang")
FLAGS = ("-std=c99", "-O2", "-shared", "-fPIC")
NEAR = 1e-6  # relative: far above rounding, and below a wrong formula
PATIENCE = 300.0  # s that another program may take
LIBRARY, OWN = "C library", "WebAssembly"  # whose sine, exponential, ..
NODE = {"baseline compiler": "--liftoff-only", "optimizing compiler": "--no-liftoff"}


@dataclass(frozen=True)
class Way:
    """A way to compute the motion: whose functions it has, the digest, and whether that is the first way's with these.

    Parameters
    ----------
    name, functions, digest : str
        The way, "C library", "WebAssembly" or "live page", and 32 hexadecimal digits.
    same : bool
        Whether the digest is that of the first way with the same functions.

    Examples
    --------
    >>> from tests.bits import Way
    >>> Way("loop", "C library", "00", True).same
    True
    """

    name: str
    functions: str
    digest: str
    same: bool


@dataclass(frozen=True)
class SameBits:
    """Digests of a motion, one for each way, as `same_bits` makes it.

    Parameters
    ----------
    ways : tuple of Way
        What was run.
    left_out : tuple of str
        What was not, a sentence each.

    Examples
    --------
    >>> import dynamics as dyn
    >>> from tests.bits import same_bits
    >>> same_bits(dyn.scenes.load("spring_mass")).passed
    True
    """

    ways: tuple[Way, ...]
    left_out: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether all that have the same functions have the same digest."""
        return all([way.same for way in self.ways])

    def __str__(self) -> str:
        wide = max([len(way.name) for way in self.ways])
        lines = [f"{'same   ' if way.same else 'DIFFERS'}  {way.digest}  {way.name:{wide}}" for way in self.ways]
        lines.append(
            f"{STEPS} steps of 2^-10 s by rk4 of the state equation; the digest is of the state after every {EVERY}, "
            "SHA-256 of its numbers, half of it."
        )
        if {way.functions for way in self.ways} >= {LIBRARY, OWN}:
            lines.append(
                "Of WebAssembly, sine and the like are its own, the same on every machine; those of the C library "
                "differ from them now and then in the last bit."
            )
        return "\n".join([*lines, *[f"left out: {each}" for each in self.left_out]])

    def to_dict(self) -> dict[str, Json]:
        """Dictionary for JSON."""
        return {"passed": self.passed, **asdict(self)}


def same_bits(scene: Scene, page: Scene | None = None, source: str = "") -> SameBits:
    """Compute one motion of a scene in every way that there is here, and compare the bits.

    page: the scene that the live page shows of it, where that has more parameters, and so another digest.
    source: the model's name, FILE.py:NAME, where it is a model of Python, whose operations another process registers.

    Fused products are off, as by `fma=False`: which products a compiler fuses is its choice. Raises ValueError for a
    motion that does not stay finite, for a row whose `javascript` is another function than its `scalar`, and as
    `state_equation` does.

    Examples
    --------
    >>> import dynamics as dyn
    >>> from tests.bits import same_bits
    >>> {way.name: way.same for way in same_bits(dyn.scenes.load("spring_mass")).ways}["batch"]
    True
    """
    motion = _Motion(scene, source)
    found: list[tuple[str, str, str]] = []
    left_out: list[str] = []
    for name, run in motion.ways():
        try:
            found.append((name, LIBRARY, run()))
        except NotRunError as error:
            left_out.append(f"{name}: {error}")
    modules = [("WebAssembly", OWN if motion.calls_library else LIBRARY, (motion.rate, motion.start))]
    if page is not None:
        modules.append(("live page (masses and gravity are inputs)", "live page", _rate_and_start(page)))
    for what, functions, module in modules:
        for name, option in NODE.items():
            try:
                found.append((f"{what}, {name}", functions, _in_node(*module, option)))
            except NotRunError as error:
                left_out.append(f"{what}, {name}: {error}")
    first: dict[str, str] = {}
    ways = [Way(*row, same=first.setdefault(row[1], row[2]) == row[2]) for row in found]
    return SameBits(tuple(ways), tuple(left_out))


class NotRunError(Exception):
    """What a way needs is not here."""


class _Motion:
    """The steps of a scene's motion and its start."""

    def __init__(self, scene: Scene, source: str = "") -> None:
        self.scene, self.source = scene, source
        self.rate, self.start = _rate_and_start(scene)
        self.states = len(self.rate.outputs)
        self.step, self.carry = _step(self.rate)
        self.calls_library = any([columns(node.op).calls_library for node in self.rate.nodes if node.args])
        self.loop = cg.loop(self.step, self.carry, fma=False)
        self.native = cg.compile(self.step, fma=False).backend != "python"
        rows = rows_of(self.step, self.carry, self.start, self.states, "python")
        self.in_python = _digest(rows)
        if not np.isfinite(rows).all():
            raise ValueError(f"the motion of {scene.name} does not stay finite over {STEPS} steps of 2^-10 s by rk4")

    def ways(self) -> Iterator[tuple[str, Callable[[], str]]]:
        """By name, what computes the digest."""
        yield "loop in Python", lambda: self.in_python
        yield "loop in machine code", self._native(self._loop)
        yield "calls of machine code", self._native(self._calls)
        yield "batch", self._native(self._batch)
        yield "threads", self._native(self._threads)
        yield "another process", self._process
        yield "C", self._c
        yield "simulate in Python", partial(self._simulate, "python")
        yield "simulate in machine code", self._native(partial(self._simulate, "auto"))

    def _native(self, run: Callable[[], str]) -> Callable[[], str]:
        if self.native:
            return run

        def missing() -> str:
            raise NotRunError("there is no machine code, which needs llvmlite")

        return missing

    def _loop(self) -> str:
        return _digest(self.loop(self.start, STEPS, EVERY)[:, : self.states])

    def _calls(self) -> str:
        step, x, rows = cg.compile(self.step, fma=False), np.array(self.start), []
        places = [self.step.input_names.index(name) for name in self.carry]
        for k in range(1, STEPS + 1):
            x[places] = step(x)
            if k % EVERY == 0:
                rows.append(x[: self.states].copy())
        return _digest(np.array(rows))

    def _batch(self) -> str:
        """Nine starts side by side, the motion's own the fifth."""
        starts = np.repeat(np.array(self.start)[:, None], 9, axis=1)
        starts[: self.states] += 0.01 * np.arange(-4, 5)
        found = self.loop.batch(starts, STEPS, EVERY)
        return _digest(found[:, : self.states, 4])

    def _threads(self) -> str:
        with ThreadPoolExecutor(4) as pool:
            runs = pool.map(lambda _: self.loop(self.start, STEPS, EVERY), range(8))
            found = {_digest(rows[:, : self.states]) for rows in runs}
        return found.pop() if len(found) == 1 else "differs among threads"

    def _process(self) -> str:
        motion = pickle.dumps((self.step, self.carry, self.start, self.states, "auto"))
        asked = pickle.dumps((self.source if is_python(self.source) else "", motion))
        code = f"from {__name__} import other_process; other_process()"
        return _run(
            [sys.executable, "-c", code], asked, {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        ).strip()

    def _c(self) -> str:
        compiler = next(filter(None, map(shutil.which, COMPILERS)), None)
        if compiler is None:
            raise NotRunError(f"none of {', '.join(COMPILERS)} is installed")
        with tempfile.TemporaryDirectory() as folder:
            with _left_out(ValueError):  # an operation without a text in C
                source, _ = cg.to_c(self.rate, "motion", {"rk4": RK4}, time=TIME).write(folder)
            library = Path(folder, "motion.so")
            _run([compiler, *FLAGS, source.name, "-o", library.name, "-lm"], folder=folder)
            with _left_out(OSError):  # a function that no library has
                steps = ctypes.CDLL(str(library)).motion_rk4
            steps.argtypes, steps.restype = [ctypes.c_void_p, ctypes.c_double, ctypes.c_ulong], None
            x, rows = np.array(self.start), []
            for _ in range(STEPS // EVERY):
                steps(x.ctypes.data, STEP, EVERY)
                rows.append(x[: self.states].copy())
        return _digest(np.array(rows))

    def _simulate(self, backend: str) -> str:
        """A run brings unit quaternions and constraints back to where they hold, which the steps alone do not."""
        scene = self.scene
        if normalization(scene.model) is not None or (scene.ode is None and len(scene.system.constraints)):
            raise NotRunError(
                "it brings back the state onto unit quaternions and constraints, which steps alone do not"
            )
        times = STEP * np.arange(EVERY, STEPS + 1, EVERY)
        qd = None if scene.ode is not None else scene.qd
        names = [*scene.model.parameters]  # open, as in the other ways: numbers of bodies would be folded
        moving = prepare(scene.model, "rk4", dt=STEP, backend=backend, fma=False, estimate_error=False, varied=names)
        run = moving(scene.q, qd, times[-1], t_eval=times)
        if not run.stats.success:
            raise NotRunError(run.stats.message)
        return _digest(run.q if qd is None else np.concatenate([run.q, run.qd], axis=1))


def _rate_and_start(scene: Scene) -> tuple[Graph, list[float]]:
    """The state equation and the start, a value of every input."""
    rate, known = state_equation(scene.model), state_inputs(scene.model)
    values = dict(zip(known.states, (*scene.q, *scene.qd), strict=True)) | known.parameters
    return rate, [float(values.get(name, 0.0)) for name in rate.input_names]  # torques and the time are 0


def _in_node(rate: Graph, start: list[float], option: str) -> str:
    """The digest by WebAssembly in Node.js."""
    node = shutil.which("node")
    if node is None:
        raise NotRunError("node is not installed")
    _check_javascript(rate, node)
    with _left_out(ValueError):  # a function that no page has
        script = _SCRIPT.replace("MATH", page_functions(rate))
        module = base64.b64encode(cg.to_wasm(rate, {"rk4": RK4}, time=TIME)).decode()
    shape = {"states": len(rate.outputs), "h": STEP, "rows": STEPS // EVERY, "n": EVERY}
    asked = json.dumps({"module": module, "x": start} | shape).encode()
    return _digest(np.frombuffer(bytes.fromhex(_run([node, option, "-e", script], asked)), dtype="<f8"))


def _check_javascript(rate: Graph, node: str) -> None:
    """Raise ValueError where the column `javascript` is not the function of `scalar` at a sample."""
    rows = dict.fromkeys([columns(each.op) for each in rate.nodes if each.args and columns(each.op).own_javascript])
    if not rows:
        return
    asked = json.dumps([[op.javascript, op.samples] for op in rows]).encode()
    found = map(float, _run([node, "-e", _VALUES_SCRIPT], asked).split())
    for op in rows:
        values = [op.scalar(*sample) for sample in op.samples]
        allowed = NEAR * max(map(abs, values))
        for sample, value, other in zip(op.samples, values, found, strict=False):
            if not abs(value - other) <= allowed:
                at = ", ".join([f"{name}={x:g}" for name, x in zip(op.parameters, sample, strict=True)])
                raise ValueError(f"operation {op.name!r}: at {at} scalar is {value:.6g} and javascript {other:.6g}")


_VALUES_SCRIPT = """\
const asked = JSON.parse(require("fs").readFileSync(0, "utf8"));
const values = ([text, samples]) => samples.map((sample) => String(eval(`(${text})`)(...sample)));
console.log(asked.flatMap(values).join(" "));
"""
_SCRIPT = """\
const asked = JSON.parse(require("fs").readFileSync(0, "utf8"));
const module = new WebAssembly.Module(Buffer.from(asked.module, "base64"));
const exports = new WebAssembly.Instance(module, { math: MATH }).exports;
const x = new Float64Array(exports.memory.buffer, 0, asked.x.length);
x.set(asked.x);
for (let row = 0; row < asked.rows; row++) {
  exports.rk4(0, asked.h, asked.n);
  process.stdout.write(Buffer.from(x.slice(0, asked.states).buffer).toString("hex"));
}
"""


def rows_of(step: Graph, carry: dict[str, str], start: list[float], states: int, backend: str) -> Array:
    """The states at every EVERY-th step."""
    return cg.loop(step, carry, backend, fma=False)(start, STEPS, EVERY)[:, :states]


def other_process() -> None:
    """In another process: print the digest of what standard input asks for, with the operations that a model adds."""
    source, motion = pickle.loads(sys.stdin.buffer.read())  # from the process that started this one
    if source:
        python_model(source)
    sys.stdout.write(_digest(rows_of(*pickle.loads(motion))))  # as above


def _digest(rows: Array) -> str:
    return sha256(np.ascontiguousarray(rows, dtype="<f8").tobytes()).hexdigest()[:32]


@contextmanager
def _left_out(*errors: type[Exception]) -> Iterator[None]:
    """Raise NotRunError in place of these."""
    try:
        yield
    except errors as error:
        raise NotRunError(str(error)) from error


def _run(
    command: list[str], given: bytes = b"", environment: dict[str, str] | None = None, folder: str | None = None
) -> str:
    try:
        done = subprocess.run(
            command,
            input=given,
            capture_output=True,
            check=False,
            timeout=PATIENCE,
            env=os.environ | (environment or {}),
            cwd=folder,
        )
    except subprocess.TimeoutExpired:
        raise NotRunError(f"{Path(command[0]).name} was not done after {PATIENCE:g} s") from None
    if done.returncode:
        raise NotRunError(f"{Path(command[0]).name} failed: {_reason(done.stderr.decode(errors='replace'))}")
    return done.stdout.decode()


def _reason(text: str) -> str:
    """The line that has the error: of Python and Node.js the last such as `TypeError: ..`, of a compiler the first."""
    raised = re.findall(r"^[\w.]*Error: .*", text, re.MULTILINE)
    compiled = re.findall(r"^.*\berror: .*", text, re.MULTILINE)
    return next(iter([*raised[-1:], *compiled, *text.strip().splitlines()[-1:]]), "it said nothing")


def _step(rate: Graph) -> tuple[Graph, dict[str, str]]:
    """A step of rk4, operation by operation that of `to_c` and `to_wasm`, and what goes on into the next.

    The time is count * h, as there.
    """
    states = rate.inputs[: len(rate.outputs)]
    count = cg.variable("count" + "_" * sum([name.startswith("count") for name in rate.input_names]))
    timed = TIME in rate.input_names
    t = STEP * count
    slopes: list[list[Node]] = []

    def ahead(weights: tuple[float, ...]) -> list[Node]:
        return [x + STEP * weighted([slope[i] for slope in slopes], weights) for i, x in enumerate(states)]

    for c, weights in zip(RK4.c, RK4.a, strict=True):
        at = dict(zip(states, ahead(weights), strict=True)) if slopes else {}
        if timed:
            at[cg.variable(TIME)] = t + c * STEP if slopes else t
        slopes.append(substitute(list(rate.outputs.values()), at))
    outputs = {f"x{i}": node for i, node in enumerate(ahead(RK4.b))}
    carry = {str(state.name): f"x{i}" for i, state in enumerate(states)}
    inputs = list(rate.inputs)
    if timed:
        inputs[rate.input_names.index(TIME)] = count
        outputs["count"] = count + 1.0
        carry[str(count.name)] = "count"
    return Graph(inputs, outputs), carry

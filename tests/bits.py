"""The same bits: digests of one motion by every way in which its steps can be computed."""

import ctypes
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path

import numpy as np

import cgraph as cg
from cgraph import Graph, Node
from cgraph._shared import Array, columns
from dynamics.equations.state_equation import normalization, state_equation, state_inputs
from dynamics.integrators.step import weighted
from dynamics.integrators.tableau import RK4
from dynamics.scenes import Scene
from dynamics.simulation.simulate import prepare
from dynamics.systems.arguments import TIME
from dynamics.systems.kinematics import substitute
from tests.javascript import stepped_by_js
from tests.repeated import repeated

STEP = 2.0**-10  # s: with it times are exact
STEPS, EVERY = 1000, 100  # steps, and of how many the last state counts
COMPILER = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
FLAGS = ("-std=c99", "-O2", "-shared", "-fPIC")
PATIENCE = 300.0  # s that another program may take


class Motion:
    """The steps of a scene's motion and its start. Fused products are off: which a compiler fuses is its choice."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.rate, known = state_equation(scene.model), state_inputs(scene.model)
        values = dict(zip(known.states, (*scene.q, *scene.qd), strict=True)) | known.parameters
        self.start = [float(values.get(name, 0.0)) for name in self.rate.input_names]  # torques and the time are 0
        self.states = len(self.rate.outputs)
        self.step, self.carry = _step(self.rate)
        self.calls_library = any([columns(node.op).calls_library for node in self.rate.nodes if node.args])
        self.loop = repeated(self.step, self.carry, fma=False)

    def digests(self) -> dict[str, str]:
        """{way: digest} of all ways that there are here; that of JavaScript apart, where sines are its own."""
        step, carry = self.step, self.carry
        found = {"loop in Python": digest(rows_of(step, carry, self.start, self.states, "python"))}
        if cg.compile(step, fma=False).backend != "python":
            found |= {
                "loop in machine code": digest(self.loop(self.start, STEPS, EVERY)[:, : self.states]),
                "calls of machine code": self._calls(),
                "batch": self._batch(),
                "threads": self._threads(),
            }
        found["another process"] = self._process()
        if COMPILER:
            found["C"] = self.in_c()
        scene = self.scene
        if normalization(scene.model) is None and not (scene.ode is None and len(scene.system.constraints)):
            found |= {f"simulate by {backend}": self.simulated(backend) for backend in ("python", "auto")}
        return found

    def _calls(self) -> str:
        step, x, rows = cg.compile(self.step, fma=False), np.array(self.start), []
        places = [self.step.input_names.index(name) for name in self.carry]
        for k in range(1, STEPS + 1):
            x[places] = step(x)
            if k % EVERY == 0:
                rows.append(x[: self.states].copy())
        return digest(np.array(rows))

    def _batch(self) -> str:
        """Nine starts side by side, the motion's own the fifth."""
        starts = np.repeat(np.array(self.start)[:, None], 9, axis=1)
        starts[: self.states] += 0.01 * np.arange(-4, 5)
        return digest(self.loop(starts, STEPS, EVERY)[:, : self.states, 4])

    def _threads(self) -> str:
        with ThreadPoolExecutor(4) as pool:
            runs = pool.map(lambda _: self.loop(self.start, STEPS, EVERY), range(8))
            found = {digest(rows[:, : self.states]) for rows in runs}
        return found.pop() if len(found) == 1 else "differs among threads"

    def _process(self) -> str:
        asked = pickle.dumps((self.step, self.carry, self.start, self.states, "auto"))
        code = f"from {__name__} import other_process; other_process()"
        path = os.pathsep.join([str(Path(__file__).parents[1]), *filter(None, sys.path)])
        return _run([sys.executable, "-c", code], asked, {"PYTHONPATH": path}).strip()

    def in_c(self, flags: tuple[str, ...] = FLAGS) -> str:
        assert COMPILER is not None
        with tempfile.TemporaryDirectory() as folder:
            source, _ = cg.to_c(self.rate, "motion", {"rk4": RK4}, time=TIME).write(folder)
            library = Path(folder, "motion.so")
            _run([COMPILER, *flags, source.name, "-o", library.name, "-lm"], folder=folder)
            steps = ctypes.CDLL(str(library)).motion_rk4
            steps.argtypes, steps.restype = [ctypes.c_void_p, ctypes.c_double, ctypes.c_ulong], None
            x, rows = np.array(self.start), []
            for _ in range(STEPS // EVERY):
                steps(x.ctypes.data, STEP, EVERY)
                rows.append(x[: self.states].copy())
        return digest(np.array(rows))

    def in_javascript(self) -> str:
        text, x, rows = cg.to_js(self.rate, {"rk4": RK4}, time=TIME), self.start, []
        for _ in range(STEPS // EVERY):
            x = stepped_by_js(text, "rk4", x, STEP, EVERY)
            rows.append(x[: self.states])
        return digest(np.array(rows))

    def simulated(self, backend: str) -> str:
        """By `simulate`, its parameters open as in the other ways: numbers of bodies would be folded."""
        scene, times = self.scene, STEP * np.arange(EVERY, STEPS + 1, EVERY)
        qd, names = None if scene.ode is not None else scene.qd, [*scene.model.parameters]
        moving = prepare(scene.model, "rk4", dt=STEP, backend=backend, fma=False, estimate_error=False, varied=names)
        run = moving(scene.q, qd, times[-1], t_eval=times)
        assert run.stats.success
        return digest(run.q if qd is None else np.concatenate([run.q, run.qd], axis=1))


def rows_of(step: Graph, carry: dict[str, str], start: list[float], states: int, backend: str) -> Array:
    """The states at every EVERY-th step."""
    return repeated(step, carry, backend, fma=False)(start, STEPS, EVERY)[:, :states]


def other_process() -> None:
    """In another process: print the digest of what standard input asks for."""
    sys.stdout.write(digest(rows_of(*pickle.loads(sys.stdin.buffer.read()))))


def digest(rows: Array) -> str:
    """SHA-256 of the numbers, half of it."""
    return sha256(np.ascontiguousarray(rows, dtype="<f8").tobytes()).hexdigest()[:32]


def _run(
    command: list[str], given: bytes = b"", environment: dict[str, str] | None = None, folder: str | None = None
) -> str:
    environment = None if environment is None else os.environ | environment
    done = subprocess.run(
        command, input=given, env=environment, cwd=folder, timeout=PATIENCE, capture_output=True, check=True
    )
    return done.stdout.decode()


def _step(rate: Graph) -> tuple[Graph, dict[str, str]]:
    """A step of rk4, operation by operation that of `to_c` and `to_js`, and what goes on into the next.

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

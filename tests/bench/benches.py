"""The benches, a row each: what is told, what measures it, and what one may choose."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from importlib import import_module
from types import ModuleType
from typing import Any, NamedTuple

SPEED, MOTIONS = "speed", "motions"


class Bench(NamedTuple):
    """A bench, whose module is imported when it is asked for.

    home: the function that measures, as folder.module.name within tests; it yields tables and lines, or rows.
    takes: its arguments that one may choose.
    rows: it takes scenes and yields rows, of which `tables` of its module makes a text; `QUICK` there are its arguments
    for a quick run.
    """

    about: str
    home: str
    takes: tuple[str, ...] = ()
    rows: bool = False

    @property
    def module(self) -> ModuleType:
        """Module of the bench."""
        return import_module(f"tests.{self.home.rpartition('.')[0]}")

    def run(self, quick: bool = False, **chosen: Any) -> Iterator[Any]:
        """What is measured, as it comes.  chosen: arguments in place of the usual ones, or of those of a quick run."""
        module = self.module
        measure: Callable[..., Iterator[Any]] = getattr(module, self.home.rpartition(".")[2])
        return measure(**((module.QUICK if quick else {}) | chosen))


READING = ("ignore", "floating", "limits", "friction", "actuators", "contacts")
OF_SPEED = (*READING, "tasks", "modes", "peers", "quick", "budget", "repeats")
OF_MOTIONS = ("times", "errors", "peers", "quick", "repeats", "count")
# A table is read by columns.
# fmt: off
BENCHES = {
    SPEED: Bench("run times of tasks beside other software (default)", "bench.speed.bench.bench", OF_SPEED, rows=True),
    MOTIONS: Bench("what ends of motions cost at equal true error", "bench.motions.motions.motions", OF_MOTIONS, True),
    "counts": Bench("nodes of forward dynamics, and what leaving out one idea adds", "bench.speed.counts.node_counts", ("links",)),
    "operations": Bench("products and sums of robots' equations beside published ones", "bench.speed.counts.operation_counts", ("links",)),
    "compile": Bench("time to compile chains, and derivatives of them", "bench.speed.stages.compile_time", ("links",)),
    "long-chains": Bench("cost of a thousand links, and accuracy of long chains", "bench.speed.stages.long_chains", ("links",)),
    "agreement": Bench("largest differences from MuJoCo and Pinocchio", "agreement.agreement.agreement", ("links", "count")),
    "ensembles": Bench("many pendulums beside MuJoCo's rollout and JAX's vmap", "bench.speed.ensembles.ensembles", ("count", "repeats")),
    "reconfiguration": Bench("first torque after a change of structure", "bench.speed.reconfiguration.reconfiguration", ("links", "repeats")),
    "trust": Bench("random motions with exact answers: runs right, said to be wrong, silent", "trust.cascades.with_cascades", ("count",)),
    "tightest": Bench("random Lagrangians as exactly as float64 has them, beside heyoka", "trust.tightest.tightest", ("count",)),
    "hybrid": Bench("random systems with switching surfaces: ends, events and slopes right, said to be wrong, silent",
                    "bench.hybrid.hybrid", ("count", "seed", "methods", "cases")),
}
# fmt: on

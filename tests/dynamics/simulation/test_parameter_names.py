"""Parameters may be called like what the library calls its variables: no name means anything else for that."""

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cgraph as cg
import dynamics as dyn

ROOT = Path(dyn.__file__).parent
REFUSED = re.compile(r"(q|qd|qdd|tau|lambda)\d*(_old)?|t|dt|.*[\s#%:].*|")  # of the state and time, and of `wrt`


def called(source: str) -> Iterator[str]:
    """The names in calls of `variable`, `variables` and `new_variables`; a number where one is put in."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call) and re.search("variables?$", ast.unparse(node.func)):
            for each in ast.walk(node):
                if isinstance(each, ast.JoinedStr):
                    yield "".join([part.value if isinstance(part, ast.Constant) else "0" for part in each.values])
                elif isinstance(each, ast.Constant) and isinstance(each.value, str):
                    yield from (name + end for name in each.value.split() for end in ("", "0"))


TAKEN = {name for path in ROOT.rglob("*.py") for name in called(path.read_text(encoding="utf-8"))}
NAMES = sorted([name for name in TAKEN | {"bar0", "value0", "mu0"} if not REFUSED.fullmatch(name)])


def spring(names: list[str]) -> dyn.System:
    """A mass on a spring whose parameters are all 1."""

    def lagrangian(q: Any, qd: Any, t: cg.Node, p: Any) -> cg.Node:
        share = sum([p[name] for name in names[1:]], start=p[names[0]]) / len(names)
        return 0.5 * share * (qd[0] ** 2 * (1.0 + q[0] ** 2) + qd[1] ** 2) - 0.5 * cg.exp(0.1 * t) * q[0] ** 2

    return dyn.System(lagrangian, ["x", "y"], parameters=dict.fromkeys(names, 1.0))


START: tuple[list[float], list[float]] = ([1.0, 0.0], [0.2, 0.3])
STEPS: dict[str, Any] = {"t_end": 0.1, "dt": 0.05, "backend": "python"}


def slope(system: dyn.System, method: str) -> Any:
    first = next(iter(system.parameters))
    result = dyn.gradient(system, lambda q, qd, t, p: q[0] * p[first], *START, method=method, wrt=["q", first], **STEPS)
    return [*result["q"], result[first]]


DOORS: dict[str, Callable[[dyn.System], Any]] = {
    **{
        name: lambda system, name=name: dyn.simulate(system, *START, method=name, estimate_error=False, **STEPS).q
        for name in ("verlet", "gauss4", "rk4")
    },
    **{f"gradient {name}": lambda system, name=name: slope(system, name) for name in ("rk4", "midpoint")},
    "taylor": lambda system: dyn.simulate(system, *START, 0.1, "taylor", t_eval=[0.1], backend="python").q,
    "linearize": lambda system: np.hstack(dyn.linearize(system, *START)),
    "conserved": lambda system: [name == "p.y" for name in dyn.conserved(system).quantities],
}


@pytest.mark.parametrize("door", DOORS)
def test_a_parameter_may_have_the_name_of_a_variable(door: str) -> None:
    assert {"p0", "mu0"} <= {*NAMES}
    expected = DOORS[door](spring([f"k_{i}" for i in range(len(NAMES))]))
    assert np.array(DOORS[door](spring(NAMES))) == pytest.approx(np.array(expected), rel=1e-9, abs=1e-12)

"""Motions by rows: those of straight graphs, whatever a run does besides, and the rule which of the two a run takes."""

import pickle
from typing import Any

import numpy as np
from pytest import mark, raises

import cgraph as cg
import dynamics as dyn
from dynamics.integrators.problem import MOST
from dynamics.systems.evaluation import ByRows
from dynamics.systems.model import Model
from tests.dynamics.mechanisms import EVERY_KIND, random_state, random_tree, turned_tree
from tests.slow import slow

ROUNDING = 1e-11  # of the largest entry, in some dozens of steps
HALF = dyn.Event("half", lambda q, qd, t: t - 0.03, reset=lambda q, qd, t: (q, [0.5 * rate for rate in qd]))
RUNS: dict[str, dict[str, Any]] = {
    "rk4": {"dt": 0.01},
    "euler": {"dt": 0.02, "backend": "python", "estimate_error": False},
    "dopri5": {"events": HALF},
    "dop853": {"tau": lambda q, qd, t, p: [cg.sin(9.0 * t) - p["k"] * rate for rate in qd], "parameters": {"k": 0.1}},
}


def motion(model: Model, q: Any, qd: Any, method: str, parameters: Any = None, **options: Any) -> list[Any]:
    """What a run gives, with its parameters open; of what goes to another process, and side by side."""
    run = dyn.prepare(model, method, varied=parameters or (), **options)
    found = pickle.loads(pickle.dumps(run(q, qd, 0.06, t_eval=[0.02, 0.06], parameters=parameters)))
    options |= {"parameters": parameters} if parameters else {}
    many = dyn.simulate_many(model, [q] * 9, qd, 0.06, method, t_eval=[0.06], **options)
    return [found.q, found.qd, found.qdd, found.energy, found.forces, many.q, many.qd]


@mark.parametrize("method", RUNS)
@mark.parametrize("seed", [7, *slow(*range(8, 16))])
def test_motions_by_rows_and_their_gradients_are_those_of_graphs(seed: int, method: str) -> None:
    tree, options = random_tree(seed, 9, EVERY_KIND), RUNS[method]
    q, qd, *_ = random_state(tree, seed)
    models: list[Model] = [tree, dyn.Rows(tree)]
    both = [motion(model, q, 0.3 * qd, method, **options) for model in models]
    if method == "rk4":
        for model, found in zip(models, both, strict=True):
            found += dyn.gradient(model, lambda q, qd, t: sum(qd), q, qd, 0.05, method, dt=0.01).gradients.values()
    error = [np.abs(a - b).max() / max(1.0, np.abs(a).max()) for a, b in zip(*both, strict=True)]
    assert max(error) < ROUNDING, error


def test_a_run_takes_rows_beyond_60_bodies_where_it_can() -> None:
    def is_by_rows(model: Model, n: int, method: str = "rk4", **options: Any) -> bool:
        run = dyn.simulate(model, np.full(n, 0.1), np.zeros(n), 1e-3, method, dt=1e-3, estimate_error=False, **options)
        return isinstance(run.graphs["rate"], ByRows)

    assert MOST == 60
    assert not is_by_rows(turned_tree(60), 60)
    assert is_by_rows(turned_tree(61), 61)
    assert is_by_rows(dyn.Rows(turned_tree(2)), 2)
    for given in ({"method": "radau"}, {"tau": lambda q, qd, t: [-cg.sign(each) for each in qd]}):
        with raises(ValueError, match=r"rows step motions by explicit methods.*rows\.mechanism"):
            dyn.simulate(dyn.Rows(turned_tree(2)), [0.1, 0.2], [0.0, 0.0], 1.0, **given)

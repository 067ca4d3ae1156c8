"""Tables of ensembles: every number where its names say, and what is missing told."""

import sys
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

import dynamics as dyn
from tests.dynamics.models import cart_pendulum

ROWS = [0.0, 0.1, 0.2]


def sweep(**options: object) -> dyn.Ensemble:
    """Three motions of two coordinates, with another stiffness and applied force each."""
    q = np.random.default_rng(0).normal(size=(3, 2))
    spring = dyn.System(
        lambda q, qd, t, p: 0.5 * (qd[0] ** 2 + qd[1] ** 2) - 0.5 * p["k"] * (q[0] - q[1]) ** 2, "a b", {"k": 1.0}
    )
    given = {"parameters": {"k": [1.0, 2.0, 3.0]}, "tau": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]} | options
    return dyn.simulate_many(spring, q, [0.0, 1.0], 0.2, t_eval=ROWS, backend="python", **given)  # type: ignore[arg-type]


def test_an_ensemble_knows_what_it_was_made_from() -> None:
    fan = sweep()
    assert (fan.coordinates, fan.velocities) == (("a", "b"), ("a", "b"))
    assert (fan.q_start == fan.q[:, 0]).all()
    assert fan.qd_start.tolist() == [[0.0, 1.0]] * 3
    assert {name: values.tolist() for name, values in fan.parameters.items()} == {
        "k": [1.0, 2.0, 3.0],
        "tau0": [0.0, 1.0, 0.0],
        "tau1": [0.0, 0.0, 1.0],
    }
    alone = dyn.simulate(
        cart_pendulum(), *np.ones((2, 2)), 0.2, t_eval=ROWS, backend="python"
    )  # what is the same for all is no parameter of the ensemble
    many = dyn.simulate_many(cart_pendulum(), np.ones((1, 2)), [1.0, 1.0], 0.2, t_eval=ROWS, backend="python")
    assert many.parameters == {}
    assert (many.q[0] == alone.q).all()


def test_a_dataset_has_every_number_by_name(tmp_path: Path) -> None:
    xarray = pytest.importorskip("xarray")
    fan = sweep(store=tmp_path / "sweep")
    data = fan.to_xarray()
    assert isinstance(data, xarray.Dataset)
    assert (data.q.sel(trajectory=1, coordinate="b").values == fan.q[1, :, 1]).all()
    assert (data.qd.sel(t=0.1, velocity="a").values == fan.qd[:, 1, 0]).all()
    assert (data.q_start.values == fan.q_start).all()
    assert data.k.values.tolist() == [1.0, 2.0, 3.0]
    assert data.q.where(data.k == 2.0, drop=True).shape == (1, 3, 2)
    assert (data.steps.values == fan.stats.steps).all()
    assert data.message.values.tolist() == ["reached t_end"] * 3
    assert isinstance(data.q.variable._data, np.memmap)  # nothing was read


def test_a_table_has_a_row_for_each_time() -> None:
    pytest.importorskip("xarray")
    fan = sweep(form="momentum", method="rk4", dt=0.1, estimate_error=False)
    table = fan.to_xarray()[["q", "k"]].to_dataframe()
    assert (table["q"].values == fan.q.reshape(-1)).all()
    assert table.loc[(2, 0.1, "a"), "k"] == 3.0
    momenta = fan.to_xarray().p.to_dataframe()["p"]
    assert fan.p is not None
    assert (momenta.values == fan.p.reshape(-1)).all()


def test_a_package_that_is_missing_is_named_with_its_extra() -> None:
    with patch.dict(sys.modules, {"xarray": None}), pytest.raises(ImportError, match=r"needs xarray: .*\[tables\]"):
        sweep().to_xarray()


def test_a_parameter_that_is_called_as_a_column_is_refused() -> None:
    pytest.importorskip("xarray")
    system = dyn.OdeSystem(lambda x, t, p: [-p["steps"] * x[0]], ["x"], {"steps": 1.0})
    fan = dyn.simulate_many(system, [1.0], None, 0.1, t_eval=[0.1], parameters={"steps": [1.0, 2.0]}, backend="python")
    with pytest.raises(ValueError, match="the parameter 'steps' has the name of a column of the table"):
        fan.to_xarray()

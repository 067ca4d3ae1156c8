"""Tables: an ensemble as xarray's dataset, arrays with names, and as pandas' table, a row for each time."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from cgraph._shared import Array, install

if TYPE_CHECKING:
    import pandas
    import xarray

    from .ensemble import Ensemble


def to_xarray(ensemble: Ensemble) -> xarray.Dataset:
    """The ensemble as arrays with names, see `Ensemble.to_xarray`."""
    module, stats = _module("xarray"), ensemble.stats
    by_time, of_start = ("trajectory", "t"), ("trajectory",)
    columns = {"q": ("coordinate", ensemble.q, ensemble.q_start), "qd": ("velocity", ensemble.qd, ensemble.qd_start)}
    variables: dict[str, Any] = {}
    for name, (dimension, rows, start) in columns.items():
        variables[name] = ((*by_time, dimension), rows)
        variables[f"{name}_start"] = ((*of_start, dimension), start)
    if ensemble.p is not None:
        variables["p"] = ((*by_time, "velocity"), ensemble.p)
    for name in ("steps", "rejected", "nfev", "dt", "success", "status", "error", "error_at_end"):
        variables[name] = (of_start, getattr(stats, name))
    variables["message"] = (of_start, np.array(stats.message))
    variables["warnings"] = (of_start, np.array(["; ".join(said) for said in stats.warnings]))
    _require_free(ensemble, {"trajectory", "t", "coordinate", "velocity", *variables})
    coordinates = {
        "trajectory": np.arange(len(ensemble.q)),
        "t": ensemble.t,
        "coordinate": list(ensemble.coordinates),
        "velocity": list(ensemble.velocities),
        **{name: (of_start, values) for name, values in ensemble.parameters.items()},
    }
    return module.Dataset(variables, coordinates, {"method": stats.method})


def to_pandas(ensemble: Ensemble) -> pandas.DataFrame:
    """The ensemble as a table, see `Ensemble.to_pandas`."""
    module, (many, rows, _) = _module("pandas"), ensemble.q.shape
    columns = dict(_columns("q", ensemble.coordinates, ensemble.q))
    columns |= dict(_columns("qd", ensemble.velocities, ensemble.qd))
    columns |= {} if ensemble.p is None else dict(_columns("p", ensemble.velocities, ensemble.p))
    own = {
        **ensemble.parameters,
        "success": ensemble.stats.success,
        "message": np.array(ensemble.stats.message, object),
    }
    columns |= {name: np.repeat(values, rows) for name, values in own.items()}
    index = module.MultiIndex.from_product([np.arange(many), ensemble.t], names=["trajectory", "t"])
    return module.DataFrame(columns, index)


def _columns(letter: str, names: tuple[str, ...], rows: Array) -> list[tuple[str, Array]]:
    return [(f"{letter}.{name}", rows[:, :, k].reshape(-1)) for k, name in enumerate(names)]


def _require_free(ensemble: Ensemble, taken: set[str]) -> None:
    if shared := sorted(taken & {*ensemble.parameters}):
        raise ValueError(f"the parameter {shared[0]!r} has the name of a column of the table: give it another name")


def _module(name: str) -> Any:
    """The package. Raises ImportError that names the extra."""
    try:
        return import_module(name)
    except ImportError:
        raise ImportError(f"this table needs {name}: {install('tables')}") from None

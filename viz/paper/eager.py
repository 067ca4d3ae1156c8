"""PyTorch eager: the formulations by torch.autograd, an operation at a time, for Table 1."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from cgraph import Node
from cgraph._shared import required
from cgraph.extend import topological
from dynamics import System

if TYPE_CHECKING:
    from torch import Tensor


def eager_evaluations(system: System, formulations: Iterable[str]) -> dict[str, Callable[[np.ndarray], list[Tensor]]]:
    """{formulation: function of its inputs} by torch.autograd on the same Lagrangian; empty without torch."""
    try:
        torch = required("torch", "PyTorch is not installed", "torch")
    except ImportError:
        return {}
    ways = {"by_definition": _embedded(torch, system, system.lagrangian), "chain_rule": _chain_rule(torch, system)}
    ways["kinetic_only"] = _embedded(torch, system, system.kinetic)
    return {name: ways[name] for name in formulations}


def _value(torch: ModuleType, node: Node, env: dict[Node, Tensor]) -> Tensor:
    """The value of a node, each operation a torch call."""
    env = dict(env)
    for each in topological([node]):
        if each not in env:
            args = [env[arg] for arg in each.args]
            call = getattr(torch, each.op.name, None)
            env[each] = torch.tensor(each.value, dtype=torch.float64) if call is None or not args else call(*args)
    return env[node]


def _gradient(torch: ModuleType, y: Tensor, x: list[Tensor]) -> list[Tensor]:
    slopes = torch.autograd.grad(y, x, create_graph=True, allow_unused=True)
    return [torch.zeros((), dtype=torch.float64) if slope is None else slope for slope in slopes]


def _leaves(torch: ModuleType, x: np.ndarray) -> list[Tensor]:
    return [torch.tensor(value, dtype=torch.float64, requires_grad=True) for value in x]


def _chain_rule(torch: ModuleType, system: System) -> Callable[[np.ndarray], list[Tensor]]:
    n = system.n

    def evaluate(x: np.ndarray) -> list[Tensor]:
        leaves = _leaves(torch, x)
        q, qd, qdd = leaves[:n], leaves[n : 2 * n], leaves[2 * n :]
        lagrangian = _value(torch, system.lagrangian, dict(zip([*system.q, *system.qd], [*q, *qd], strict=True)))
        slopes = _gradient(torch, lagrangian, [*q, *qd])
        taus = []
        for i in range(n):
            rows = _gradient(torch, slopes[n + i], [*q, *qd])
            rate = sum(row * dot for row, dot in zip(rows, [*qd, *qdd], strict=True))
            taus.append(rate - slopes[i] + system.damping[i] * qd[i])
        return taus

    return evaluate


def _embedded(torch: ModuleType, system: System, energy: Node) -> Callable[[np.ndarray], list[Tensor]]:
    n = system.n

    def evaluate(x: np.ndarray) -> list[Tensor]:
        leaves = _leaves(torch, x)
        q_old, qd_old, qdd, dt = leaves[:n], leaves[n : 2 * n], leaves[2 * n : 3 * n], leaves[3 * n]
        qd = [a * dt + old for a, old in zip(qdd, qd_old, strict=True)]
        q = [v * dt + old for v, old in zip(qd, q_old, strict=True)]
        state = dict(zip([*system.q, *system.qd], [*q, *qd], strict=True))
        momenta = _gradient(torch, _value(torch, energy, state), qd)
        slopes = _gradient(torch, _value(torch, system.lagrangian, state), q)
        rates = [_gradient(torch, p, [dt])[0] for p in momenta]
        return [rates[i] - slopes[i] + system.damping[i] * qd[i] for i in range(n)]

    return evaluate

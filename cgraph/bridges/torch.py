"""`to_torch`: a compiled graph called from within PyTorch."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from ..autodiff.products import jvp, vjp
from ..program.functions.compiled import Compiled
from ..util.extras import required
from ..util.require import require_kind
from .translation import derived, require_compiled, require_inputs, values_at

if TYPE_CHECKING:
    from torch import Tensor


def to_torch(fn: Compiled) -> Callable[[Tensor], Tensor]:
    """The compiled graph as a function within PyTorch, which calls its machine code.

    `autograd` and `torch.func` differentiate it, in reverse and forward, to any order: the derivatives are the graphs
    of `cg.vjp` and `cg.jvp`, compiled in the same way when they are first asked for. `torch.func.vmap` and further axes
    in front call it for all points at once.

    Parameters
    ----------
    fn : Compiled
        Of `cg.compile`.

    Returns
    -------
    callable
        (n_in,) -> (n_out,), and (..., n_in) -> (..., n_out), in float64, on the CPU.

    Raises
    ------
    TypeError
        For what is no compiled graph; by the function, for what is no tensor of float64 on the CPU.
    GraphError
        By the function, for x of another shape.
    ImportError
        Without PyTorch (extra `torch`).

    Examples
    --------
    >>> import cgraph as cg
    >>> x, y = cg.variables("x y")
    >>> area = cg.to_torch(cg.compile(cg.Graph([x, y], {"area": x * y})))
    >>> import torch
    >>> point = torch.tensor([2.0, 3.0], dtype=torch.float64, requires_grad=True)
    >>> area(point).backward()
    >>> point.grad.tolist()
    [3.0, 2.0]
    """
    require_compiled("to_torch", fn)
    torch = required("torch", "to_torch needs PyTorch", "torch")
    call: Callable[..., Tensor] = _call(torch).apply

    def function(x: Tensor) -> Tensor:
        require_kind("x", x, torch.Tensor, "a tensor")
        if x.dtype != torch.float64 or x.device.type != "cpu":
            raise TypeError(f"to_torch calls machine code for float64 on the CPU, got {x.dtype} on {x.device}")
        require_inputs(tuple(x.shape), fn.n_in)
        return call(fn, x)

    return function


def _call(torch: ModuleType) -> Any:
    """The autograd.Function of a compiled graph and a point, (..., n_in)."""

    class Call(torch.autograd.Function):  # type: ignore[name-defined, misc]
        @staticmethod
        def forward(fn: Compiled, x: Tensor) -> Tensor:
            values: Tensor = torch.from_numpy(np.ascontiguousarray(values_at(fn, x.detach().numpy())))
            return values

        @staticmethod
        def setup_context(ctx: Any, inputs: tuple[Compiled, Tensor], output: Tensor) -> None:
            ctx.fn, x = inputs
            ctx.save_for_backward(x)
            ctx.save_for_forward(x)

        @staticmethod
        def backward(ctx: Any, y_bar: Tensor) -> tuple[None, Tensor]:
            (x,) = ctx.saved_tensors
            return None, Call.apply(derived(ctx.fn, vjp), torch.cat([x, y_bar], -1))

        @staticmethod
        def jvp(ctx: Any, fn: None, x_dot: Tensor) -> Tensor:
            (x,) = ctx.saved_tensors
            y_dot: Tensor = Call.apply(derived(ctx.fn, jvp), torch.cat([x, x_dot], -1))
            return y_dot

        @staticmethod
        def vmap(info: Any, in_dims: tuple[None, int], fn: Compiled, x: Tensor) -> tuple[Tensor, int]:
            return Call.apply(fn, x.movedim(in_dims[1], 0)), 0

    return Call

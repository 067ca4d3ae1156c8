"""Peers: the same quantities of the same model by other software, a file for each."""

from __future__ import annotations

from collections.abc import Callable, Set
from dataclasses import dataclass
from importlib.util import find_spec

from .casadi import CasadiPeer
from .case import DERIVATIVES, MOTIONS, TASKS, Case
from .contender import MODES, Contender, Peer, UnavailableError
from .heyoka import HeyokaPeer
from .jax import JaxPeer
from .mujoco import MujocoPeer
from .ours import OurNumpy, Ours
from .pinocchio import PinocchioPeer
from .sympy import SympyPeer
from .torch import TorchPeer

CALLS = {(task, mode) for task in ("inverse", "forward") for mode in ("call", "batch")}
RK4 = {("rk4", mode) for mode in MODES}
SLOPES = {(task, mode) for task in DERIVATIVES for mode in ("call", "batch")}
GRAPHS = CALLS | {(task, "loop") for task in ("inverse", "forward")} | RK4 | SLOPES
ALL = GRAPHS | {("motion", "call"), ("gradient", "call")}


@dataclass(frozen=True)
class Kind:
    """A column of the bench.

    about: what it is, in one line.  package: what has to be installed, by the name it is imported by.
    offers: the (task, mode) that it has a function for.
    """

    about: str
    package: str
    offers: Set[tuple[str, str]]
    make: Callable[[Case], Peer]

    @property
    def installed(self) -> bool:
        """The package is there; nothing is imported."""
        return find_spec(self.package) is not None


# In the order of the tables' columns; the packages themselves are imported when a peer is made.
PEERS = {
    "ours": Kind("our graph as machine code through LLVM", "cgraph", ALL | {("inertial-gradient", "call")}, Ours),
    "ours-numpy": Kind(
        "our graph as generated NumPy, for where there is no llvmlite",
        "numpy",
        {(task, "batch") for task in TASKS if task not in MOTIONS},
        OurNumpy,
    ),
    "ours-gcc": Kind(
        "our graph, written as C code by CasADi and through the C compiler: another code generator, the same graph",
        "casadi",
        GRAPHS,
        lambda case: CasadiPeer(case, native=True, own_graph=False),
    ),
    "casadi-gcc": Kind(
        "CasADi's own graph as C code, through the C compiler",
        "casadi",
        ALL,
        lambda case: CasadiPeer(case, native=True),
    ),
    "casadi": Kind("CasADi's own graph in its virtual machine", "casadi", ALL, CasadiPeer),
    "pinocchio": Kind(
        "Pinocchio's rnea and aba and their derivatives, C++; the step of RK4 is written in Python",
        "pinocchio",
        CALLS | SLOPES | {("rk4", "call")},
        PinocchioPeer,
    ),
    "mujoco": Kind(
        "MuJoCo's mj_inverse and mj_forward, mj_step and rollout for RK4; contacts off",
        "mujoco",
        RK4 | {("inverse", "call"), ("forward", "call")},
        MujocoPeer,
    ),
    "heyoka": Kind("heyoka's own expressions through LLVM", "heyoka", CALLS, HeyokaPeer),
    "jax": Kind("JAX on the CPU, jitted, double precision", "jax", ALL, JaxPeer),
    "sympy": Kind("SymPy through lambdify with cse, and numpy.linalg.solve", "sympy", CALLS, SympyPeer),
    "torch": Kind("PyTorch eager, torch.autograd", "torch", {("inverse", "call")}, TorchPeer),
}

__all__ = ["PEERS", "Case", "Contender", "Kind", "Peer", "UnavailableError"]

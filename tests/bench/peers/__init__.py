"""Peers: the same quantities of the same model by other software, a file for each."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass, field
from importlib import import_module
from importlib.util import find_spec

from tests.bench.peers.peer import DERIVATIVES, MODES, MOTIONS, TASKS, Peer, PeerModel

CALLS = {(task, mode) for task in ("inverse", "forward") for mode in ("call", "batch")}
RK4 = {("rk4", mode) for mode in MODES}
SLOPES = {(task, mode) for task in DERIVATIVES for mode in ("call", "batch")}
GRAPHS = CALLS | {(task, "loop") for task in ("inverse", "forward")} | RK4 | SLOPES
ALL = GRAPHS | {("motion", "call"), ("gradient", "call")}


@dataclass(frozen=True)
class Kind:
    """A column of the bench.

    about: what it is, in one line.  package: what has to be installed, by the name it is imported by.
    offers: the (task, mode) that it has a function for.  home: its class, as module.name.  options: of the class.
    """

    about: str
    package: str
    offers: Set[tuple[str, str]]
    home: str
    options: Mapping[str, bool] = field(default_factory=dict)

    @property
    def installed(self) -> bool:
        """The package is there; nothing is imported."""
        return find_spec(self.package) is not None

    def load(self) -> type[Peer]:
        """Class of the peer, whose module is imported now."""
        module, name = self.home.split(".")
        peer: type[Peer] = getattr(import_module(f".{module}", __name__), name)
        return peer

    def make(self, case: PeerModel) -> Peer:
        """The peer on a case. Raises ImportError where the package is not installed."""
        return self.load()(case, **self.options)


# In the order of the tables' columns; modules and packages are imported when a peer is made.
# fmt: off
PEERS = {
    "ours": Kind("our graph as machine code through LLVM", "cgraph", ALL | {("inertial-gradient", "call")},
                 "ours.Ours"),
    "ours-numpy": Kind("our graph as generated NumPy, for where there is no llvmlite", "numpy",
                       {(task, "batch") for task in TASKS if task not in MOTIONS}, "ours.OurNumpy"),
    "ours-gcc": Kind("our graph, written as C code by CasADi and through the C compiler: another code generator, the "
                     "same graph", "casadi", GRAPHS, "casadi.CasadiPeer", {"native": True, "own_graph": False}),
    "casadi-gcc": Kind("CasADi's own graph as C code, through the C compiler", "casadi", ALL, "casadi.CasadiPeer",
                       {"native": True}),
    "casadi": Kind("CasADi's own graph in its virtual machine", "casadi", ALL, "casadi.CasadiPeer"),
    "pinocchio": Kind("Pinocchio's rnea and aba and their derivatives, C++; the step of RK4 is written in Python",
                      "pinocchio", CALLS | SLOPES | {("rk4", "call")}, "pinocchio.PinocchioPeer"),
    "mujoco": Kind("MuJoCo's mj_inverse and mj_forward, mj_step and rollout for RK4; contacts off", "mujoco",
                   RK4 | {("inverse", "call"), ("forward", "call")}, "mujoco.MujocoPeer"),
    "heyoka": Kind("heyoka's own expressions through LLVM", "heyoka", CALLS, "heyoka.HeyokaPeer"),
    "jax": Kind("JAX on the CPU, jitted, double precision", "jax", ALL, "jax.JaxPeer"),
}
# fmt: on

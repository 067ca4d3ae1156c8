"""dynamics: equations of motion on computational graphs, from Lagrangians and planar arms."""

from . import cases, scenes
from .ensembles import Ensemble, EnsembleStats, simulate_many
from .equations import (
    SingularMassMatrixError,
    bias,
    check_pivot,
    energy,
    forward_dynamics,
    gravity_force,
    mass_matrix,
    momentum,
)
from .event import Event
from .formulations import FORMULATIONS, inverse_dynamics, momentum_rate, spurious
from .handover import Dropped, FreeBody, PickedUp, dropped, picked_up
from .mechanism import Body, Force, Joint, Mechanism, MechanismError, serial_arm, tree
from .mjcf import to_mjcf
from .mujoco_load import load_mjcf, load_urdf
from .multiprecision import Reference, reference
from .ode_system import OdeSystem
from .planar_arm import Link, PlanarArm, planar_arm
from .pruning import EFFECTS, LeftOut, Pruned, prune
from .recursive import RecursiveInverseDynamics
from .scenes import Scene
from .simulate import simulate
from .state_equation import state_equation
from .subtree import Subtree
from .system import System, as_system
from .trajectory import Crossings, Stats, Trajectory
from .urdf import to_urdf

__all__ = [
    "EFFECTS",
    "FORMULATIONS",
    "Body",
    "Crossings",
    "Dropped",
    "Ensemble",
    "EnsembleStats",
    "Event",
    "Force",
    "FreeBody",
    "Joint",
    "LeftOut",
    "Link",
    "Mechanism",
    "MechanismError",
    "OdeSystem",
    "PickedUp",
    "PlanarArm",
    "Pruned",
    "RecursiveInverseDynamics",
    "Reference",
    "Scene",
    "SingularMassMatrixError",
    "Stats",
    "Subtree",
    "System",
    "Trajectory",
    "as_system",
    "bias",
    "cases",
    "check_pivot",
    "dropped",
    "energy",
    "forward_dynamics",
    "gravity_force",
    "inverse_dynamics",
    "load_mjcf",
    "load_urdf",
    "mass_matrix",
    "momentum",
    "momentum_rate",
    "picked_up",
    "planar_arm",
    "prune",
    "reference",
    "scenes",
    "serial_arm",
    "simulate",
    "simulate_many",
    "spurious",
    "state_equation",
    "to_mjcf",
    "to_urdf",
    "tree",
]

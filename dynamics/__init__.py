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
from .tables.certificate import certify
from .tables.coriolis import coriolis, damping_force
from .tables.linearization import linearization, linearize
from .tables.regressor import inertial_parameters, regressor
from .tables.residual import Certificate
from .tables.torque_table import TorqueTable
from .tables.torques import torque_by_link, torque_by_motion
from .trajectory import Crossings, Stats, Trajectory
from .urdf import to_urdf

__all__ = [
    "EFFECTS",
    "FORMULATIONS",
    "Body",
    "Certificate",
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
    "TorqueTable",
    "Trajectory",
    "as_system",
    "bias",
    "cases",
    "certify",
    "check_pivot",
    "coriolis",
    "damping_force",
    "dropped",
    "energy",
    "forward_dynamics",
    "gravity_force",
    "inertial_parameters",
    "inverse_dynamics",
    "linearization",
    "linearize",
    "load_mjcf",
    "load_urdf",
    "mass_matrix",
    "momentum",
    "momentum_rate",
    "picked_up",
    "planar_arm",
    "prune",
    "reference",
    "regressor",
    "scenes",
    "serial_arm",
    "simulate",
    "simulate_many",
    "spurious",
    "state_equation",
    "to_mjcf",
    "to_urdf",
    "torque_by_link",
    "torque_by_motion",
    "tree",
]

"""dynamics: equations of motion on computational graphs, from Lagrangians and planar arms."""

from . import scenes
from .equations.coriolis import coriolis, damping_force
from .equations.equations_of_motion import (
    SingularMassMatrixError,
    bias,
    check_pivot,
    energy,
    forward_dynamics,
    gravity_force,
    mass_matrix,
    momentum,
)
from .equations.formulations import FORMULATIONS, inverse_dynamics, momentum_rate, spurious
from .equations.linearization import linearization, linearize
from .equations.state_equation import state_equation
from .equations.torque_decomposition import torque_by_link, torque_by_motion
from .equations.torque_table import TorqueTable
from .experiments.stability import cases
from .io.load import load_mjcf, load_urdf
from .io.mjcf import to_mjcf
from .io.urdf import to_urdf
from .multibody.impact import Dropped, FreeBody, PickedUp, dropped, picked_up
from .multibody.mechanism import Body, Force, Joint, Mechanism, MechanismError, serial_arm, tree
from .multibody.planar_arm import Link, PlanarArm, planar_arm
from .multibody.pruning import EFFECTS, LeftOut, Pruned, prune
from .multibody.recursive_inverse_dynamics import RecursiveInverseDynamics
from .multibody.regressor import inertial_parameters, regressor
from .multibody.subtree import Subtree
from .reference import Reference, reference
from .scenes.scenes import Scene
from .simulation.ensembles import Ensemble, EnsembleStats, simulate_many
from .simulation.events import Event
from .simulation.simulate import simulate
from .simulation.trajectory import Crossings, Stats, Trajectory
from .systems.ode_system import OdeSystem
from .systems.system import System, as_system
from .verification.certificate import certify
from .verification.residual import Certificate

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

"""dynamics: equations of motion on computational graphs, from Lagrangians and planar arms."""

from . import scenes
from .equations import (
    SingularMassMatrixError,
    bias,
    energy,
    forward_dynamics,
    gravity_force,
    mass_matrix,
    momentum,
)
from .formulations import FORMULATIONS, inverse_dynamics, momentum_rate, spurious
from .mechanism import Body, Joint, Mechanism, MechanismError, serial_arm
from .mjcf import to_mjcf
from .mujoco_load import load_mjcf, load_urdf
from .planar_arm import Link, PlanarArm, planar_arm
from .scenes import Scene
from .simulate import Stats, Trajectory, simulate
from .system import System, as_system
from .urdf import to_urdf

__all__ = [
    "FORMULATIONS",
    "Body",
    "Joint",
    "Link",
    "Mechanism",
    "MechanismError",
    "PlanarArm",
    "Scene",
    "SingularMassMatrixError",
    "Stats",
    "System",
    "Trajectory",
    "as_system",
    "bias",
    "energy",
    "forward_dynamics",
    "gravity_force",
    "inverse_dynamics",
    "load_mjcf",
    "load_urdf",
    "mass_matrix",
    "momentum",
    "momentum_rate",
    "planar_arm",
    "scenes",
    "serial_arm",
    "simulate",
    "spurious",
    "to_mjcf",
    "to_urdf",
]

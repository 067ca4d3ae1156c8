"""Types of joints, and the table of them by kind.

Every `JointType` that a module of this package makes is in the table. Joints that are several of these one after
another are rows of `COMPOSITIONS`.
"""

from importlib import import_module
from pkgutil import iter_modules

from .axial import COMPOSITIONS
from .joint_type import AxialJoint, JointType, SpatialJoint

_MODULES = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
_JOINTS = [each for module in _MODULES for each in vars(module).values() if isinstance(each, JointType)]
TYPES = {joint.kind: joint for joint in sorted(_JOINTS, key=lambda joint: joint.kind)}

__all__ = ["COMPOSITIONS", "TYPES", "AxialJoint", "JointType", "SpatialJoint"]

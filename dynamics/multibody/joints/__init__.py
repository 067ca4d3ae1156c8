"""Types of joints: a file each, and the table of them by kind.

A module of this package that has a `JOINT`, a `JointType`, is in the table. Joints that are several of these one after
another are rows of `composition.py`.
"""

from importlib import import_module
from pkgutil import iter_modules

from .composition import COMPOSITIONS
from .joint_type import AxialJoint, JointType, SpatialJoint

_MODULES = [import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__)]
TYPES: dict[str, JointType] = {module.JOINT.kind: module.JOINT for module in _MODULES if hasattr(module, "JOINT")}

__all__ = ["COMPOSITIONS", "TYPES", "AxialJoint", "JointType", "SpatialJoint"]

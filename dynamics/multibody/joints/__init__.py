"""Types of joints: a file each, and the table of them by kind."""

from .fixed import Fixed
from .joint_type import JointType
from .prismatic import Prismatic
from .revolute import Revolute

TYPES: dict[str, JointType] = {each.kind: each for each in (Revolute(), Prismatic(), Fixed())}

__all__ = ["TYPES", "JointType"]

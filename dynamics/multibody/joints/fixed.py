"""Fixed: a weld, which has no coordinate."""

from .joint_type import AxialJoint


class Fixed(AxialJoint):
    """A weld. The body is merged into the one that carries it."""

    kind = urdf = "fixed"
    moves = False
    coordinates = velocities = units = velocity_units = ()
    neutral = groups = ()


JOINT = Fixed()

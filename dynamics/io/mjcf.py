"""MJCF: the text of a model for MuJoCo, of a planar arm or of a mechanism."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import ArrayLike

from ..multibody import spatial
from ..multibody.mechanism import WORLD, Body, Mechanism, MechanismError
from ..multibody.planar_arm import PlanarArm
from ..multibody.spatial import Array

# MuJoCo wants diagonal inertias that are positive and obey the triangle inequality; a planar arm feels only the one
# about the hinge axis (y), so the other two are any that are allowed.
_SMALLEST = 1e-14  # kg m^2, in place of the zero inertia of a point mass
CAMERA = "side"  # looks along y at the arm's plane
_COLORS = ("0.46 0.24 0.62 1", "0.16 0.38 0.78 1", "0.80 0.20 0.16 1")  # the paper's purple, blue and red


def to_mjcf(model: PlanarArm | Mechanism, timestep: float = 1e-3) -> str:
    """The model as MJCF text: masses and inertias explicit, RK4, contacts off.

    Raises MechanismError for forces on bodies: in MuJoCo they are state, `xfrc_applied`, and not the model's.
    """
    return _arm_to_mjcf(model, timestep) if isinstance(model, PlanarArm) else _mechanism_to_mjcf(model, timestep)


def _arm_to_mjcf(arm: PlanarArm, timestep: float) -> str:
    """The arm as MJCF text: hinges about -y, masses and inertias explicit, RK4, contacts off.

    The arm's plane is x to the right, z up; a positive angle swings the hanging arm towards +x.
    """
    reach = sum(link.length for link in arm.links)
    lines = [
        '<mujoco model="planar arm">',
        '  <compiler angle="radian" inertiafromgeom="false"/>',
        f'  <option timestep="{timestep!r}" integrator="RK4" gravity="0 0 {-arm.gravity!r}">',
        '    <flag contact="disable"/>',
        "  </option>",
        "  <visual>",
        '    <headlight ambient="0.5 0.5 0.5" diffuse="0.5 0.5 0.5"/>',
        '    <global offwidth="480" offheight="320"/>',
        '    <rgba haze="1 1 1 1"/>',
        "  </visual>",
        '  <asset><texture type="skybox" builtin="flat" rgb1="1 1 1" rgb2="1 1 1" width="8" height="8"/></asset>',
        "  <worldbody>",
        f'    <camera name="{CAMERA}" pos="0 {-1.75 * reach!r} {-0.45 * reach!r}" xyaxes="1 0 0 0 0 1"/>',
    ]
    indent = "    "
    for i, link in enumerate(arm.links):
        drop = arm.links[i - 1].length if i else 0.0
        diagonal = " ".join([repr(max(link.inertia, _SMALLEST))] * 3)
        radius, colour = 0.05 * arm.links[0].length, _COLORS[i % len(_COLORS)]
        lines += [
            f'{indent}<body name="link{i + 1}" pos="0 0 {-drop!r}">',
            f'{indent}  <joint name="joint{i + 1}" type="hinge" axis="0 -1 0" damping="{arm.damping[i]!r}"/>',
            f'{indent}  <inertial pos="0 0 {-link.center!r}" mass="{link.mass!r}" diaginertia="{diagonal}"/>',
            f'{indent}  <geom type="capsule" fromto="0 0 0 0 0 {-link.length!r}" size="{radius!r}" rgba="{colour}"/>',
        ]
        indent += "  "
    for _ in arm.links:
        indent = indent[:-2]
        lines.append(f"{indent}</body>")
    return "\n".join([*lines, "  </worldbody>", "</mujoco>"]) + "\n"


def _mechanism_to_mjcf(mechanism: Mechanism, timestep: float) -> str:
    """The moving bodies, those welded to them merged in."""
    if mechanism.forces:
        raise MechanismError(f"MJCF has no forces, there is one on body {mechanism.forces[0].body!r}")
    children: dict[str, list[Body]] = {}
    for body in mechanism.moving:
        children.setdefault(body.parent, []).append(body)
    lines = [
        '<mujoco model="mechanism">',
        '  <compiler angle="radian" inertiafromgeom="false"/>',
        f'  <option timestep="{timestep!r}" integrator="RK4" gravity="{numbers(mechanism.gravity)}">',
        '    <flag contact="disable"/>',
        "  </option>",
        "  <worldbody>",
    ]
    indent = 2
    stack: list[Body | None] = [*reversed(children.get(WORLD, []))]  # None closes a body
    while stack:
        opened = stack.pop()
        if opened is None:
            indent -= 1
            lines.append("  " * indent + "</body>")
            continue
        lines += ["  " * indent + line for line in _body_lines(opened)]
        indent += 1
        stack += [None, *reversed(children.get(opened.name, []))]
    return "\n".join([*lines, "  </worldbody>", "</mujoco>"]) + "\n"


def _body_lines(body: Body) -> list[str]:
    joint = body.joint
    x, y, _ = np.asarray(joint.orientation).T
    kind = "hinge" if joint.kind == "revolute" else "slide"
    spring = f'stiffness="{joint.stiffness!r}" springref="{joint.spring_reference!r}" armature="{joint.armature!r}"'
    axis = f'axis="{numbers(joint.axis)}" damping="{joint.damping!r}"'
    mass = max(body.mass, _SMALLEST)
    name = quoteattr(body.name)
    return [
        f'<body name={name} pos="{numbers(joint.position)}" xyaxes="{numbers(np.concatenate([x, y]))}">',
        f'  <joint name={name} type="{kind}" {axis} {spring}/>',
        f'  <inertial pos="{numbers(body.center)}" mass="{mass!r}" {_principal(np.asarray(body.inertia))}/>',
    ]


def _principal(inertia: Array) -> str:
    """The inertia by its principal moments, more exact than what MuJoCo's own iteration finds."""
    moments, axes = np.diag(inertia), np.eye(3)
    if np.any(inertia - np.diag(moments)):
        moments, axes = np.linalg.eigh(inertia)
        axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    moments = np.maximum(moments, _SMALLEST)
    largest = moments.argmax()  # of a plate it is the sum of the others, and may not be more by rounding
    moments[largest] = min(moments[largest], np.delete(moments, largest).sum() * (1.0 - 1e-15))
    return f'diaginertia="{numbers(moments)}" quat="{numbers(spatial.to_quaternion(axes))}"'


def numbers(values: ArrayLike) -> str:
    """Numbers as XML attributes have them, each exact."""
    return " ".join([repr(float(value)) for value in np.asarray(values)])

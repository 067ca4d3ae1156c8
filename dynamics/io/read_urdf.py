"""URDF read: the mechanism of a <robot>, with the numbers of the file and the joints that mimic others."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np

from cgraph._shared import Array, require_flag

from ..multibody.algebra import spatial
from ..multibody.bodies.body import ANYTHING, NO_LIMITS, Limits, moment_rounding
from ..multibody.forces.contact import Contact
from ..multibody.forces.joint_force import JointForce, JointFriction, JointLimit
from ..multibody.joints import COMPOSITIONS, TYPES
from ..multibody.loops import Loop
from ..multibody.trees.mechanism import WORLD, Body, Joint, Mechanism, MechanismError
from .contacts import FRICTION, capsule_ends, untaken, with_contacts
from .left_out import follows_itself, listed, present, refused_or_left_out, unused
from .smooth_forces import Smooth
from .source import XACRO, Recorded, unread

GRAVITY = (0.0, 0.0, -9.81)  # m/s^2, where the file says nothing
FAR_LIMIT = 1e9  # in any unit: a limit that is there because URDF asks for one; it stands for none
BALLS = ("sphere", "capsule")  # shapes whose contacts are taken
_OTHERS = {"revolute": "revolute", "planar": "planar"}  # beside the words of joint types: a hinge with limits, three
_SINGLE = ("continuous", "revolute", "prismatic")  # joints with one coordinate
_ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def read_urdf(robot: Recorded, called: str, ignore: bool, floating: bool, smooth: Smooth) -> Mechanism:
    """The mechanism of a robot, whose root link stands still or floats. Raises MechanismError with one sentence."""
    try:
        if require_flag("floating", floating):
            add_floating_base(robot)
        macros = {each.tag for each in robot.iter() if each.tag.startswith("xacro:")}
        if macros and (not require_flag("ignore", ignore) or robot.find("link") is None):
            hint = "" if ignore else f" (the option ignore leaves {listed(sorted(macros))} out)"
            raise MechanismError(f"this is {XACRO}{hint}")
        _require_plain_joints(robot)
        links, joints = _by_name(robot, "link"), _by_name(robot, "joint")
        root = _root(links, joints)
        leaders, refused = read_mimics(joints)
        read = {name: _limits(joint, name) for name, joint in joints.items()}
        limits, impossible = {name: each for name, (each, _) in read.items()}, [name for name in read if read[name][1]]
        rotors = armatures(robot)
        with np.errstate(all="ignore"):  # of numbers that are not finite Mechanism says where they stand
            inertials = {name: _inertial(link, name) for name, link in links.items()}
            bodies = [] if root == WORLD else [Body(root, Joint("fixed"), **inertials[root][0])]
            for name, element in joints.items():
                parent, child = _end(element, name, "parent"), _end(element, name, "child")
                own = {"limits": limits[name], "armature": rotors.get(name, 0.0)}
                bodies.append(Body(child, _joint(element, name, child, own), parent, **inertials[child][0]))
        losses = {name: loss for name, joint in joints.items() if (loss := _friction(joint, name))}
        loops, gravity = _couplings(joints, leaders), _gravity(robot)
        balls = ([], []) if smooth.contacts is None else _balls(links, gravity)
        forces, left = _forces(joints, limits, losses, smooth)
        takeable = any([[*robot.iterfind(f"link/collision/geometry/{shape}")] for shape in BALLS])
        what = {
            untaken(takeable): smooth.contacts is None and [*robot.iterfind("link/collision")],
            **left,
            f"limits that cannot be ({listed(impossible)})": impossible,
            f"what is not read ({'; '.join(others := unread(robot))})": others,
        }
        outside = [*present(what), *_negative(inertials, by_digits=True)]
        left_out = refused_or_left_out([*refused, *_negative(inertials, by_digits=False)], outside, ignore)
        mechanism = Mechanism(bodies, gravity, forces, left_out=left_out, loops=loops)
        return mechanism if smooth.contacts is None else with_contacts(mechanism, smooth.contacts, *balls)
    except MechanismError as error:
        raise MechanismError(f"URDF, {called}: {error}") from None


def add_floating_base(robot: Element) -> None:
    """Hang the root link of a robot on the world by a floating joint, called as the link or as no joint is.

    A root link that is called as the world itself gets a name that no link has.
    """
    joints, links = _by_name(robot, "joint"), _by_name(robot, "link")
    given = _root(links, joints)
    root = unused(given, links) if given == WORLD else given
    ends = [end for joint in joints.values() for end in joint.findall("parent") if end.get("link") == given]
    for element, attribute in ((links[given], "name"), *[(end, "link") for end in ends]):
        element.set(attribute, root)
    name = unused(root, joints)
    joint = Recorded("joint", {"name": name, "type": "floating"})
    joint.extend([Recorded("parent", {"link": WORLD}), Recorded("child", {"link": root})])
    robot.extend([Recorded("link", {"name": WORLD}), joint])


def _require_plain_joints(robot: Element) -> None:
    """Raises MechanismError for joints and links of other software's own, such as <drake:joint>."""
    for each in robot:
        if each.tag.partition(":")[2] in ("joint", "link"):
            given = f"<{each.tag}> {each.get('name')!r} of the type {each.get('type')!r}"
            raise MechanismError(f"{given} is not URDF but an extension, which only its own software reads")


def _by_name(robot: Element, tag: str) -> dict[str, Element]:
    """The robot's links or joints by their names."""
    found: dict[str, Element] = {}
    for each in robot.findall(tag):
        name = each.get("name")
        if not name:
            raise MechanismError(f"a {tag} has no name")
        if name in found:
            raise MechanismError(f"two {tag}s have the name {name!r}")
        found[name] = each
    if tag == "link" and not found:
        raise MechanismError("a robot needs a link, and there is none")
    return found


def _root(links: Mapping[str, Element], joints: Mapping[str, Element]) -> str:
    """The link that is no joint's child."""
    above: dict[str, str] = {}
    for name, joint in joints.items():
        parent, child = _end(joint, name, "parent"), _end(joint, name, "child")
        for end in (parent, child):
            if end not in links:
                raise MechanismError(f"joint {name!r} names the link {end!r}, which is not there")
        if child in above:
            raise MechanismError(f"link {child!r} is the child of two joints, {above[child]!r} and {name!r}")
        above[child] = name
    roots = [name for name in links if name not in above]
    if not roots:
        raise MechanismError("a robot is one tree with a root, and every link is a joint's child")
    if len(roots) > 1:
        raise MechanismError(f"a robot is one tree, and {len(roots)} links are no joint's child: {listed(roots)}")
    return roots[0]


def _gravity(robot: Element) -> list[float]:
    """Gravity as MuJoCo's extension of URDF has it [m/s^2], else the usual one."""
    options = [each for extension in robot.findall("mujoco") for each in extension.findall("option")]
    return _numbers(options[0], "<mujoco>", "gravity", 3, " ".join(map(repr, GRAVITY))) if options else [*GRAVITY]


def _end(joint: Element, name: str, which: str) -> str:
    """The link at an end of a joint."""
    element = _one(joint, f"joint {name!r}", which)
    link = None if element is None else element.get("link")
    if not link:
        raise MechanismError(f"joint {name!r} has no {which} link")
    return link


def _joint(joint: Element, name: str, child: str, own: dict[str, Any]) -> Joint:
    """The joint, called as in the file.  own: its limits and armature."""
    where, word = f"joint {name!r}", joint.get("type")
    kinds = {each.urdf: kind for kind, each in TYPES.items() if each.urdf} | _OTHERS
    if word not in kinds:
        given = f"is of the type {listed([word])}" if word else "has no type"
        raise MechanismError(f"{where} {given}, and URDF has {', '.join(sorted(kinds))}")
    fields: dict[str, Any] = dict(zip(("position", "orientation"), origin_of(joint, where), strict=True))
    axis = _one(joint, where, "axis")
    if axis is not None:
        axis.get("xyz")  # of joints without axis it has no meaning
    if kinds[word] != "fixed":
        if kinds[word] in COMPOSITIONS or TYPES[kinds[word]].has_axis:
            fields["axis"] = (1.0, 0.0, 0.0) if axis is None else _numbers(axis, where, "xyz", 3)
        if kinds[word] == "planar":
            fields["second_axis"] = _first_in_plane(fields["axis"])
        dynamics = _one(joint, where, "dynamics")
        if dynamics is not None:
            several = kinds[word] == "planar" and len(dynamics.get("damping", "").split()) > 1
            damping = _numbers(dynamics, where, "damping", 3 if several else 1, "0")
            fields["damping"] = tuple(damping) if several else damping[0]
        fields |= own
    return Joint(kinds[word], name="" if name == child else name, **fields)


def _first_in_plane(axis: Sequence[float]) -> Array:
    """Where the shortest turn of z to `axis` takes x, a planar joint's x in MuJoCo 4 and Drake; for -z that is x."""
    x, y, z = spatial.snapped(spatial.unit(np.asarray(axis)))
    share = 1.0 / (1.0 + z) if z >= 0.0 else (1.0 - z) / (x * x + y * y or 1.0)
    return np.array([1.0 - share * x * x, -share * x * y, -x])


def armatures(robot: Element) -> dict[str, float]:
    """{joint: gear^2 times the inertia of the rotors that drive it [kg m^2 or kg]}, by the extension of Drake's.

    As there, of simple transmissions, on joints of one coordinate whose limit of effort is not 0.
    """
    found, joints = dict[str, float](), _by_name(robot, "joint")
    for transmission in robot.iter("transmission"):
        kind, where = transmission.findtext("type", transmission.attrib.get("type", "")), "a <transmission>"
        names = [end.get("name", "") for end in transmission.iter("joint") if "SimpleTransmission" in kind]
        for name in [each for each in names[:1] if each in joints and joints[each].get("type") in _SINGLE]:
            for actuator in transmission.iter("actuator") if _limits(joints[name], name)[0].effort[1] > 0.0 else ():
                rotor, gear = (_one(actuator, where, f"drake:{what}") for what in ("rotor_inertia", "gear_ratio"))
                if rotor is not None:
                    transmission.get("name")
                    ratio = 1.0 if gear is None else _numbers(gear, where, "value", 1)[0]
                    found[name] = found.get(name, 0.0) + ratio * ratio * _numbers(rotor, where, "value", 1)[0]
    return found


def _inertial(link: Element, name: str) -> tuple[dict[str, Any], float, bool]:
    """Fields of a body: mass, center and inertia in the link's frame, without negative principal moments, if any.

    Then the least principal moment in the file [kg m^2], 0 if none is negative, and whether rounding to the file's
    digits makes it of 0.
    """
    where = f"link {name!r}"
    inertial = _one(link, where, "inertial")
    if inertial is None:
        return {}, 0.0, False
    mass, moments = (_one(inertial, where, tag) for tag in ("mass", "inertia"))
    if mass is None or moments is None:
        raise MechanismError(f"{where} has an <inertial> without <{'mass' if mass is None else 'inertia'}>")
    center, turn = origin_of(inertial, where)
    xx, xy, xz, yy, yz, zz = (_numbers(moments, where, entry, 1)[0] for entry in _ENTRIES)
    inertia = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
    fields = {"mass": _numbers(mass, where, "value", 1)[0], "center": center, "inertia": inertia}
    if not np.isfinite(inertia).all():
        return fields, 0.0, False
    values, axes = np.linalg.eigh(inertia)
    if values[0] >= -moment_rounding(float(np.abs(values).max()), fields["mass"] * float(center @ center)):
        return fields, 0.0, False
    fields["inertia"] = axes @ np.diag(np.maximum(values, 0.0)) @ axes.T
    texts = [moments.get(entry, "") for entry in (*_ENTRIES, "ixy", "ixz", "iyz")]
    places = [Decimal(text.strip()).as_tuple().exponent for text in texts if float(text)]  # a 0 is taken as exact
    return fields, float(values[0]), bool(-values[0] <= 0.5 * math.hypot(*[10.0 ** int(place) for place in places]))


def _negative(inertials: Mapping[str, tuple[object, float, bool]], *, by_digits: bool) -> list[str]:
    """A sentence on links with negative moments: those that rounding to the file's digits makes of 0, or the others."""
    least = [(name, value) for name, (_, value, rounded) in inertials.items() if value < 0.0 and rounded == by_digits]
    chosen = [f"{name}: {value:.3g}" for name, value in least]
    return present({f"moments of inertia below 0 ({listed(chosen)} kg m^2)": chosen})


def origin_of(element: Element, where: str) -> tuple[Array, Array]:
    """The position [m] and the axes, as columns, in an <origin>; those of the parent where there is none."""
    origin = _one(element, where, "origin")
    if origin is None:
        return np.zeros(3), np.eye(3)
    position = np.array(_numbers(origin, where, "xyz", 3, "0 0 0"))
    if origin.get("quat_xyzw") is not None:
        x, y, z, w = _numbers(origin, where, "quat_xyzw", 4)
        return position, spatial.from_quaternion((w, x, y, z))
    return position, from_rpy(*_numbers(origin, where, "rpy", 3, "0 0 0"))


def from_rpy(roll: float, pitch: float, yaw: float) -> Array:
    """The rotation by angles [rad] about the fixed x, then y, then z."""
    x, y, z = np.eye(3)
    return spatial.snapped(spatial.rotation(z, yaw) @ spatial.rotation(y, pitch) @ spatial.rotation(x, roll))


def _one(element: Element, where: str, tag: str) -> Element | None:
    """The only child of that tag, None where there is none."""
    children = element.findall(tag)
    if len(children) > 1:
        raise MechanismError(f"{where} has {len(children)} elements <{tag}>, and one is needed")
    return children[0] if children else None


def _numbers(element: Element, where: str, attribute: str, count: int, default: str | None = None) -> list[float]:
    """The finite numbers of an attribute, in ASCII; float() would also take 1_000 and digits of other scripts."""
    text = element.get(attribute, default)
    if text is None:
        raise MechanismError(f"{where}: <{element.tag}> has no {attribute}")
    try:
        values = [float(each) for each in text.split()] if text.isascii() and "_" not in text else []
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        needed = "one finite number" if count == 1 else f"{count} finite numbers"
        raise MechanismError(f"{where}: {attribute} of <{element.tag}> needs {needed}, got {text!r:.60}")
    return values


def _couplings(joints: Mapping[str, Element], leaders: Mapping[str, str]) -> list[Loop]:
    """The loops q = multiplier q_leader + offset."""
    loops = []
    for name, leader in leaders.items():
        where = f"joint {name!r}"
        mimic = _one(joints[name], where, "mimic")
        assert mimic is not None
        line = [_numbers(mimic, where, "offset", 1, "0")[0], _numbers(mimic, where, "multiplier", 1, "1")[0]]
        body, to = (_end(joints[each], each, "child") for each in (name, leader))
        loops.append(Loop("coupling", body, to, coefficients=line))
    return loops


def _forces(
    joints: Mapping[str, Element], limits: Mapping[str, Limits], losses: Mapping[str, float], smooth: Smooth
) -> tuple[list[JointForce], dict[str, object]]:
    """The forces of joints that are taken, and sentences on those that are not, see `present`."""
    forces: list[JointForce] = []
    ranges = {name: each.position for name, each in limits.items() if each.position != ANYTHING}
    points = [name for name, (lower, upper) in ranges.items() if lower == upper]
    rubbing = [name for name, loss in losses.items() if loss > 0.0 and joints[name].get("type") != "planar"]
    for name, joint in joints.items():
        body = _end(joint, name, "child")
        if smooth.limits is not None and name in ranges and name not in points:
            forces.append(JointLimit(body, *ranges[name], *smooth.limits))
        if smooth.friction is not None and name in rubbing:
            forces.append(JointFriction(body, losses[name], smooth.friction))
    rough = [name for name in losses if smooth.friction is None or name not in rubbing]
    return forces, {
        f"joint limits ({listed([*ranges])})": ranges and smooth.limits is None,
        f"limits whose ends are one number ({listed(points)})": points and smooth.limits is not None,
        f"friction loss ({listed([f'{name}: {losses[name]:g}' for name in rough])})": rough,
    }


def _balls(links: Mapping[str, Element], gravity: Sequence[float]) -> tuple[list[Contact], list[str]]:
    """Spheres and ends of capsules of the links, and sentences on contacts other than theirs with the ground."""
    balls: list[Contact] = []
    others: list[str] = []
    touching: dict[str, None] = {}
    ground: dict[str, Any] = {"friction": FRICTION, "stiffness": 0.0}
    ground["normal"] = spatial.snapped(-np.array(gravity) / (np.linalg.norm(gravity) or 1.0))
    for name, link in links.items():
        for collision in link.findall("collision") if name != WORLD else ():
            touching[name] = None
            where = f"the collision of link {name!r}"
            shape = collision.find("geometry/*")
            if shape is None or shape.tag not in BALLS:
                others.append(f"{name}: {'no shape' if shape is None else shape.tag}")
                continue
            for geometry in collision.findall("geometry"):
                geometry.findall(shape.tag)
            center, turn = origin_of(collision, where)
            half = 0.5 * _numbers(shape, where, "length", 1)[0] if shape.tag == "capsule" else 0.0
            radius = _numbers(shape, where, "radius", 1)[0]
            if not (radius >= 0.0 and half >= 0.0):
                raise MechanismError(f"{where}: radius and length must not be negative")
            centers = capsule_ends(center, turn[:, 2], half) if half else [center]
            balls += [Contact(name, at=at, radius=radius, **ground) for at in centers if radius]
            others += [f"{name}: {shape.tag} of radius 0"] * (not radius)
    sentences = {
        f"contacts of shapes other than spheres and capsules ({listed(others)})": others,
        "contacts of links with one another": len(touching) > 1,
    }
    return balls, present(sentences)


def _limits(joint: Element, name: str) -> tuple[Limits, bool]:
    """Limits of a joint of one coordinate, and whether some cannot be, in whose place there are none."""
    limit, limits, kind = _one(joint, f"joint {name!r}", "limit"), NO_LIMITS, joint.get("type")
    if limit is None or kind not in _SINGLE:
        return limits, False
    impossible = False
    for what in ("position", "velocity", "effort")[kind == "continuous" :]:
        texts = [limit.get("lower", "0"), limit.get("upper", "0")] if what == "position" else [limit.get(what, "inf")]
        try:
            ends = [math.copysign(math.inf, end) if abs(end := float(text)) >= FAR_LIMIT else end for text in texts]
            limits = replace(limits, **{what: (ends[0] if len(ends) == 2 else -ends[0], ends[-1])})
        except ValueError:
            impossible = True
    return limits, impossible


def _friction(joint: Element, name: str) -> float:
    dynamics = None if joint.get("type") == "fixed" else _one(joint, f"joint {name!r}", "dynamics")
    return 0.0 if dynamics is None else _numbers(dynamics, f"joint {name!r}", "friction", 1, "0")[0]


def read_mimics(joints: Mapping[str, Element]) -> tuple[dict[str, str], list[str]]:
    """{joint that mimics another: that one}, and sentences on those that are refused; a fixed joint mimics none.

    Raises MechanismError for a joint that mimics several.
    """
    leaders: dict[str, str] = {}
    kinds = {name: joint.get("type") for name, joint in joints.items()}
    for name, joint in joints.items():
        mimic = _one(joint, f"joint {name!r}", "mimic")
        if mimic is not None and kinds[name] != "fixed":
            leaders[name] = mimic.get("joint", "")
    astray = [name for name in leaders if leaders[name] not in joints]
    circle = [name for name in leaders if follows_itself(name, leaders)]
    others = [name for name in leaders if name not in (*astray, *circle)]
    several = [name for name in others if not {kinds[name], kinds[leaders[name]]} <= {*_SINGLE}]
    after = {name: f"{name} after {leader}" for name, leader in leaders.items()}
    refused = {
        "joints that mimic one that is not there": astray,
        "joints that mimic one another in a circle": circle,
        "joints that mimic others where one of both has not one coordinate": several,
    }
    return (
        {name: leaders[name] for name in others if name not in several},
        present({f"{what} ({listed([after[name] for name in names])})": names for what, names in refused.items()}),
    )

"""XML elements that record what is asked of them, and the names of what nobody has asked for."""

from collections.abc import Iterator
from typing import Any
from xml.etree.ElementTree import Element

from ..multibody.trees.mechanism import MechanismError
from .left_out import listed

XACRO = "xacro, not URDF: expand it first, as `xacro robot.urdf.xacro > robot.urdf` does"
_WITHOUT_MOTION = ("visual", "material", "collision", "type", "hardwareInterface")  # on contacts there is a sentence
_MECHANICS = ("mechanicalReduction", "drake:rotor_inertia", "drake:gear_ratio", "springStiffness", "turnGravityOff")
_NONE = ("mechanicalReduction 1", "mechanicalReduction 1.0", "turnGravityOff 0", "turnGravityOff false")


class Recorded(Element):
    """An element that records the attributes and children that are asked for."""

    def __init__(self, tag: str, attributes: dict[str, str]) -> None:
        super().__init__(tag, attributes)
        self.asked: set[str] = set()

    def get(self, key: str, default: Any = None) -> Any:
        """The text of an attribute. Raises MechanismError for a macro of xacro."""
        self.asked.add(key)
        text = super().get(key, default)
        if isinstance(text, str) and ("${" in text or "$(" in text):
            raise MechanismError(f"{key} of <{self.tag}> is {text!r:.60}: this is {XACRO}")
        return text

    def findall(self, path: str, namespaces: Any = None) -> list[Any]:
        """The children of a name."""
        self.asked.add(path)
        return super().findall(path, namespaces)


def unread(root: Recorded) -> list[str]:
    """What nobody has asked for, such as "<dynamics K D> of elbow", but for names and what is only seen."""
    found: dict[str, list[str]] = {}
    for what, owner in _unread(root, ""):
        found.setdefault(what, []).append(owner)
    return [f"{what} of {listed([*dict.fromkeys(owners)])}" if owners[0] else what for what, owners in found.items()]


def _unread(element: Recorded, owner: str) -> Iterator[tuple[str, str]]:
    """What of an element nobody has asked for, and the link or joint it belongs to."""
    left = [key for key in element.attrib if key not in (*element.asked, "name", "version") and key[:5] != "xmlns"]
    if left:
        yield f"<{' '.join([element.tag, *left])}>", owner
    for child in element:
        assert isinstance(child, Recorded)
        if child.asked:
            yield from _unread(child, owner or child.attrib.get("name", f"<{child.tag}>"))
        elif child.tag not in _WITHOUT_MOTION:
            inside = [each.tag for each in child.iter() if _changes_motion(each) and each is not child]
            yield f"<{child.tag}>{' with ' * bool(inside)}{', '.join(dict.fromkeys(inside))}", owner


def _changes_motion(element: Element) -> bool:
    """Whether an element of an extension, such as <transmission> or <gazebo>, would change a motion."""
    is_joint = element.tag == "joint" and "type" in element.attrib  # one of SDF, which closes a loop
    return is_joint or (element.tag in _MECHANICS and f"{element.tag} {element.text}" not in _NONE)

"""Sources of models: a path or XML text, read as bytes, what errors call it, and elements that record what is read."""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from ..multibody.trees.mechanism import MechanismError
from .left_out import listed

_BEFORE_XML = "\ufeff \t\r\n"  # what editors leave there
_FORMATS = {"robot": "URDF, which load_urdf reads", "mujoco": "MJCF, which load_mjcf reads", "sdf": "SDF"}
XACRO = "xacro, not URDF: expand it first, as `xacro robot.urdf.xacro > robot.urdf` does"
_WITHOUT_MOTION = ("visual", "material", "collision", "type", "hardwareInterface")  # on contacts there is a sentence
_MECHANICS = ("mechanicalReduction", "drake:rotor_inertia", "drake:gear_ratio", "springStiffness", "turnGravityOff")
_NONE = ("mechanicalReduction 1", "mechanicalReduction 1.0", "turnGravityOff 0", "turnGravityOff false")


def is_text(source: object) -> bool:
    """Whether the source is XML text and no path."""
    return isinstance(source, str) and source.lstrip(_BEFORE_XML).startswith("<")


def called(source: object) -> str:
    """Name of a source in errors."""
    return "the given text" if is_text(source) else f"{str(source)!r}"


def path_of(source: object) -> Path:
    """The path of a file that is there. Raises MechanismError."""
    if not isinstance(source, str | os.PathLike):
        raise MechanismError(f"a model is a path or XML text, and of MJCF an MjModel, too, got {type(source).__name__}")
    if not os.fspath(source):
        raise MechanismError("a model is a path or XML text, got an empty text")
    path = Path(source)
    if "://" in os.fspath(source):
        raise MechanismError(f"{os.fspath(source)!r:.200} is an address, and a model is the path of a file")
    try:
        is_folder, is_file = path.is_dir(), path.is_file()
    except OSError as error:  # such as a name that is too long, of a text that begins with no "<"
        raise MechanismError(f"{os.fspath(source)!r:.200} cannot be read: {error.strerror}") from None
    if is_folder:
        raise MechanismError(f"{os.fspath(source)!r:.200} is a folder, and a model is a file")
    if not is_file:
        raise MechanismError(f"there is no file {os.fspath(source)!r:.200}")
    return path


def text_of(source: object) -> bytes:
    """The XML of a source, in the encoding that it declares. Raises MechanismError."""
    try:
        if is_text(source):
            return str(source).lstrip(_BEFORE_XML).encode()
        text = path_of(source).read_bytes().removeprefix(b"\xef\xbb\xbf").lstrip()
    except UnicodeEncodeError as error:
        raise MechanismError(f"{called(source)} is not XML: {error}") from None
    except OSError as error:
        raise MechanismError(f"{called(source)} cannot be read: {error.strerror}") from None
    if not text:
        raise MechanismError(f"{called(source)} is empty")
    if text.startswith(b"version https://git-lfs"):
        raise MechanismError(f"{called(source)} is a pointer of Git LFS: `git lfs pull` brings the file itself")
    return text


def root_of(source: object) -> str:
    """The name of the root element; "" for what is not XML."""
    tags: list[str] = []
    parser = expat.ParserCreate("utf-8" if is_text(source) else None)
    parser.StartElementHandler = lambda tag, attributes: tags.append(tag)
    text = text_of(source)
    with suppress(expat.ExpatError, LookupError, ValueError):  # what is wrong further on shows when it is read
        parser.Parse(text, True)
    return tags[0] if tags else ""


def require_root(source: object, needed: str, given: str) -> None:
    """Raises MechanismError for a root element of another format.  needed, given: names of root elements."""
    if given != needed and (given in _FORMATS or needed == "robot"):
        what = {"robot": "a URDF", "mujoco": "an MJCF"}[needed]
        other = f": it is {_FORMATS[given]}" if given in _FORMATS else ""
        raise MechanismError(f"{what}'s root element is <{needed}>, {called(source)} has <{given}>{other}")


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


def urdf_root(source: object) -> Recorded:
    """The root element of a URDF. Raises MechanismError for other sources.

    Prefixes of namespaces stay parts of names, so that one that is nowhere declared, left by a macro, does no harm.
    """
    parser, builder = expat.ParserCreate("utf-8" if is_text(source) else None), ElementTree.TreeBuilder(Recorded)
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler = builder.data
    text = text_of(source)
    try:
        parser.Parse(text, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise MechanismError(f"{called(source)} is not XML: {error}") from None
    robot: Recorded = builder.close()  # type: ignore[assignment]
    require_root(source, "robot", robot.tag)
    return robot

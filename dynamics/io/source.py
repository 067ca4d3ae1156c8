"""Sources of models: a path or XML text, read as bytes, and what errors call it."""

import os
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from ..multibody.trees.mechanism import MechanismError
from .recorded_element import Recorded

_BEFORE_XML = "\ufeff \t\r\n"  # what editors leave there
_FORMATS = {"robot": "URDF, which load_urdf reads", "mujoco": "MJCF, which load_mjcf reads", "sdf": "SDF"}


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

"""What MJCF may ask of MuJoCo: a text no other files, and none more copies than are made in seconds."""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path
from xml.parsers import expat

from ..multibody.mechanism import MechanismError
from .source import is_text, path_of, text_of

COPIES = 10_000  # of replicated elements: MuJoCo's time grows with their square
_FILES = {f"file{side}" for side in ("", "right", "left", "up", "down", "front", "back")}


def require_modest(source: object, called: str) -> None:
    """Raises MechanismError for a text that names another file or is not XML, too many copies, and a blank anchor.

    called: what errors call the source.
    """
    asked = _Asked(None if is_text(source) else path_of(source).parent)
    try:
        asked.read(text_of(source))
    except (expat.ExpatError, LookupError, ValueError) as error:
        if is_text(source):
            raise MechanismError(f"{called} is not XML: {error}") from None
    if is_text(source) and asked.files:
        named = f"{called} names the file {asked.files[0]!r:.200}"
        raise MechanismError(f"{named}, and a text reads no other files: give the path of a model instead")
    if asked.blank:
        raise MechanismError(f"MuJoCo cannot read {called}: the anchor of a <connect> needs three numbers, got none")
    if asked.copies > COPIES:
        raise MechanismError(f"{called} asks for {asked.copies:.6g} copies by `count`, at most {COPIES} are made")


class _Asked:
    """Which files a model names, and how many copies its elements and those of the files that it includes ask for.

    folder: where included files are; None: they are not read.
    """

    def __init__(self, folder: Path | None) -> None:
        self.folder = folder
        self.files: list[str] = []
        self.included: set[Path] = set()
        self.copies = 0.0
        self.blank = False  # an anchor without numbers, after which MuJoCo 4 reads no other model in this process
        self.within = [1.0]  # of each open element, how often it is made

    def read(self, text: bytes) -> None:
        """Add what a text asks for. Raises what expat does, also where MuJoCo takes it, as "--" in a comment."""
        parser = expat.ParserCreate("utf-8" if self.folder is None else None)
        parser.StartElementHandler, parser.EndElementHandler = self._opened, self._closed
        parser.Parse(text, True)

    def _opened(self, tag: str, attributes: dict[str, str]) -> None:
        self.files += [attributes[name] for name in sorted(_FILES & attributes.keys())]
        self.blank |= not attributes.get("anchor", "0").strip()
        times = 1.0
        with suppress(ValueError):  # MuJoCo says what is no number
            times = math.prod([float(each) for each in attributes.get("count", "1").split()])
        self.within.append(self.within[-1] * max(times, 1.0))
        if times > 1.0:
            self.copies += self.within[-1]
        if tag == "include" and self.folder is not None:
            path, depth = self.folder / attributes.get("file", ""), len(self.within)
            if path not in self.included and path.is_file():  # MuJoCo refuses a file that is included twice
                self.included.add(path)
                with suppress(expat.ExpatError, LookupError):
                    self.read(path.read_bytes())
                del self.within[depth:]

    def _closed(self, tag: str) -> None:
        self.within.pop()

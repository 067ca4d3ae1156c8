"""MuJoCo's module, with its warnings as Python's, and what it does by functions outside of it."""

from __future__ import annotations

import ctypes
import warnings
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from cgraph._shared import install

if TYPE_CHECKING:
    from mujoco import MjSpec

DIGITS = 17  # of a number in a text, so that it is read as the same float


def mujoco() -> ModuleType:
    """The mujoco module. Raises ImportError naming the extra when it is not installed."""
    try:
        import mujoco as module
    except ImportError as error:
        raise ImportError(f"MuJoCo is not installed: {install('mujoco')}") from error
    if module.get_mju_user_warning() is None:  # by itself it adds a warning to a file in the current folder
        module.set_mju_user_warning(_warn)
    found: ModuleType = module  # it has no types
    return found


def _warn(text: str) -> None:
    """MuJoCo's warning as Python's."""
    with suppress(BaseException):  # an exception that leaves a callback aborts the process
        warnings.warn(f"MuJoCo: {' '.join(text.split())}", stacklevel=2)


def word_of(kind: str, value: int) -> str:
    """MuJoCo's word for a value of one of its enumerations, as "hinge" for one of "Joint"."""
    name: str = getattr(mujoco(), f"mjt{kind}")(int(value)).name
    return name.partition("_")[2].lower()


def text_of(spec: MjSpec) -> str:
    """The MJCF text that MuJoCo writes of a compiled spec, with all digits.

    By itself it writes 6 digits. Its own tests write more by a function of the library that Python's module leaves out.
    """
    library = ctypes.CDLL(str(next(Path(mujoco().__file__ or "").parent.glob("*mujoco.*"))))
    before = library._mjPRIVATE__get_xml_precision()
    library._mjPRIVATE__set_xml_precision(DIGITS)
    try:
        text: str = spec.to_xml()
    finally:
        library._mjPRIVATE__set_xml_precision(before)
    return text

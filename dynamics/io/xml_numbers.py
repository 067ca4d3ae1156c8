"""Numbers as XML attributes have them, each exact."""

from __future__ import annotations

import numpy as np

from ..multibody.parameters import Quantities


def numbers(values: Quantities) -> str:
    """The numbers, with blanks between."""
    return " ".join([repr(float(value)) for value in np.asarray(values)])

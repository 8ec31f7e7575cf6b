"""Names for arrays in annotations."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = np.ndarray[Any, np.dtype[Any]]
"""An array of any type."""

Floats = NDArray[np.float64]
"""An array of float64."""

Ints = NDArray[np.integer[Any]]
"""An array of whole numbers of any type."""

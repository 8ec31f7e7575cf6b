"""A clock that kernels can read, so that time limits hold inside kernels.

Kernels that can take longer than some hundredths of a second take a deadline, in seconds of `time.monotonic`
(``inf``: none), and check it regularly. A late kernel stops at the next point where its result is valid, even if it is
not the best. It comes by the name ``deadline``, or in a field of that name of a record: the call that a kernel is
compiled for gets it later by the time that this took (compiled.py).
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numba import config, types  # noqa: TID251  (a declaration of the system's clock; kernels are made by _compiled)

from assoc._system.compiled import njit

_read: Any = None
_UNCOMPILED = bool(getattr(config, "DISABLE_JIT", 0))
_CLOCK = 0
if not _UNCOMPILED and hasattr(time, "clock_gettime"):
    _read = types.ExternalFunction("clock_gettime", types.int32(types.int32, types.voidptr))
    _CLOCK = time.CLOCK_MONOTONIC

    def _now() -> float:
        """Return seconds of `time.monotonic`."""
        pair = np.empty(2, np.int64)
        _read(_CLOCK, pair.ctypes.data)
        return float(pair[0] + 1e-9 * pair[1])

    now = njit(_now, stand_in=time.monotonic)

elif _UNCOMPILED:
    now = time.monotonic

else:

    @njit
    def now() -> float:
        """Return 0: without such a clock, time limits are checked only between kernels."""
        return 0.0


@njit
def is_over(deadline: float) -> bool:
    """Whether the time is over."""
    return bool(deadline < np.inf and now() > deadline)

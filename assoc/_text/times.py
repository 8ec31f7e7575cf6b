"""Times for people, and numbers of fixed decimals."""

from __future__ import annotations

import datetime

UNIX = 1e9
"""From this many seconds on, times are taken for Unix times: seconds since 1970 (2001 and later)."""
_LAST = 1e11


def moment(time: float) -> str:
    """Return a time to the millisecond: ``12.5 s``, and Unix times as UTC, ``2021-07-12 14:00:02.5Z``."""
    if not UNIX < time < _LAST:
        return f"{decimals(time, 3)} s"
    whole = datetime.datetime.fromtimestamp(0, datetime.UTC) + datetime.timedelta(milliseconds=round(1e3 * time))
    return f"{whole:%Y-%m-%d %H:%M:%S}{decimals(whole.microsecond / 1e6, 3)[1:]}Z"


def decimals(value: float, digits: int) -> str:
    """Return a number with at most so many decimals, without zeros at its end."""
    text = f"{round(value, digits) + 0.0:.{digits}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text

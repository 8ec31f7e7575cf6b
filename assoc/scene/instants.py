"""Dates and times of day as seconds."""

from __future__ import annotations

import datetime
from typing import Any

import numpy as np

from assoc.errors import InvalidInputError


def as_seconds(times: Any) -> Any:
    """Turn dates into seconds since 1970-01-01 UTC, and durations into seconds; anything else is returned unchanged.

    Taken are arrays of numpy's datetime64 and timedelta64, Python's datetimes and timedeltas, and what pandas makes of
    them. A date without a time zone is one of UTC. A missing date (NaT), or dates mixed with numbers, are refused.
    """
    array = np.asarray(times)
    if array.dtype == object and array.size:
        first = array.flat[0]
        if not isinstance(first, (datetime.datetime, datetime.timedelta, np.datetime64, np.timedelta64)):
            return times
        try:
            array = np.array([_plain(date) for date in array.flat]).reshape(array.shape)
        except (TypeError, ValueError) as error:
            raise InvalidInputError("times must be all dates or all seconds, got both") from error
    if array.dtype.kind not in "mM":
        return times
    if np.isnat(array).any():
        raise InvalidInputError("times must be complete, got a date that is missing (NaT)")
    unit = np.datetime64(0, "s") if array.dtype.kind == "M" else np.timedelta64(0, "s")
    whole = array.astype("datetime64[us]" if array.dtype.kind == "M" else "timedelta64[us]") - unit
    return whole.astype(np.int64) / 1e6


def _plain(date: Any) -> np.datetime64 | np.timedelta64:
    if isinstance(date, datetime.datetime):
        return np.datetime64(date if date.tzinfo is None else date.astimezone(datetime.UTC).replace(tzinfo=None), "us")
    if isinstance(date, datetime.timedelta):
        return np.timedelta64(date, "us")
    if isinstance(date, (np.datetime64, np.timedelta64)):
        return date
    raise TypeError(type(date).__name__)

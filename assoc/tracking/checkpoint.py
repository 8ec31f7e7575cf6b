"""What is read from a file of a saved tracker is looked at before it is believed: kernels do not check indices."""

from __future__ import annotations

import copy
import json
import math
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.base import Filter
from assoc.filters.batches import arrays_of
from assoc.filters.motion.models import LinearMotion, Motion
from assoc.filters.state import gaussian

MOST = 10_000_000
"""Measurements of a sensor in a scan, and scans, at the most."""


def demand(good: object, name: str, expected: str) -> None:
    """Refuse a field of a saved tracker by name."""
    if not bool(good):
        raise InvalidInputError(f"the field {name!r} is not that of a saved tracker: expected {expected}")


def check_progress(arrays: Mapping[str, Array], tracks: int) -> None:
    """Time, number of scans and ids."""
    demand(1 <= int(arrays["next_id"]) < 2**62, "next_id", "a whole number above 0")
    time, scan, pace = float(arrays["time"]), int(arrays["scan"]), float(arrays["pace"])
    demand(not math.isinf(time), "time", "seconds")
    demand(0 <= scan < 2**62, "scan", "a whole number >= 0")
    demand(math.isfinite(pace) and pace >= 0, "pace", "seconds >= 0")
    if math.isnan(time):
        demand(scan == 0 and tracks == 0, "time", "seconds, since there have been scans or tracks")


def check_bank(arrays: Mapping[str, Array], filter: Filter[Any], widest: int, prefix: str = "bank.") -> None:
    """Tracks: all arrays of one length, ids that were given, states of the filter's shape.

    Parameters
    ----------
    arrays : mapping
    filter : Filter
    widest : int
        The most components of a measurement.
    prefix : str
        Of the names of a bank's arrays.
    """
    ids = arrays[f"{prefix}track_id"]
    for name, value in arrays.items():
        if name.startswith(prefix):
            demand(value.ndim and len(value) == len(ids), name, f"{len(ids)} rows, as many as ids")
            if value.dtype.kind == "f":
                demand(np.isfinite(value).all(), name, "finite numbers")
    demand(((ids >= 1) & (ids < int(arrays["next_id"]))).all(), f"{prefix}track_id", "ids from 1 up to the next one")
    for name in ("detections", "missed", "hits"):
        demand((arrays[f"{prefix}{name}"] >= 0).all(), f"{prefix}{name}", "whole numbers >= 0")
    n = filter.motion.dim
    for name, model in arrays_of(filter.start(gaussian(np.zeros((1, n)), np.eye(n)[None]))).items():
        key = f"{prefix}state.{name}"
        found = arrays[key].shape[1:]
        # what a filter keeps of measurements has no width before the first one
        same = [a == b or (b == 0 and a <= widest) for a, b in zip(found, model.shape[1:], strict=True)]
        demand(all(same), key, f"rows of the shape {model.shape[1:]}")
        if name == "weights":
            near = np.abs(arrays[key].sum(axis=-1) - 1.0) < 1e-6
            demand(near.all() and (arrays[key] >= 0).all(), key, "probabilities")


def check_window(arrays: Mapping[str, Array], tracks: int, sensors: int, depth: int) -> None:
    """Scans that are not final, and each branch's measurements in them."""
    times, sizes, history = arrays["window_times"], arrays["window_sizes"], arrays["history"]
    demand(len(times) < max(depth, 1) or len(times) == 0, "window_times", f"fewer than {depth} scans")
    demand(np.isfinite(times).all(), "window_times", "finite numbers")
    demand(sizes.shape == (len(times), sensors), "window_sizes", f"the shape {(len(times), sensors)}")
    demand(((sizes >= 0) & (sizes <= MOST)).all(), "window_sizes", "numbers of measurements")
    demand(history.shape == (tracks, depth * sensors), "history", f"the shape {(tracks, depth * sensors)}")
    most = np.full(depth * sensors, MOST)
    most[: sizes.size] = sizes.ravel()
    demand(((history >= 0) & (history <= most)).all(), "history", "numbers of measurements of the scans in the window")


def rng_state(rng: np.random.Generator, text: str) -> Any:
    """State of a random generator from its JSON text, tried out on a copy."""
    try:
        state = json.loads(text)
        copy.deepcopy(rng.bit_generator).state = state
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError) as error:
        raise InvalidInputError("the field 'filter_rng' is not the state of a random generator") from error
    return state


def difference(saved: str, own: str) -> str:
    """Say which setting of a tracker differs from a saved one's."""
    now = json.loads(own)
    try:
        before = json.loads(saved)
    except (ValueError, RecursionError):
        before = None
    if not isinstance(before, dict):
        return "they cannot be read"
    for key in now:
        old, new = str(before.get(key)), now[key]
        if old != new:
            # long texts from where they part
            same = len(os.path.commonprefix([old, new]))
            first = 0 if same < 60 else same - 20
            return f"{key} was {old[first : first + 80]!r}, is {new[first : first + 80]!r}"
    return "an unknown setting"


def described(thing: object) -> str:
    """A filter, with all that it and its motion model are made of, as text."""
    if isinstance(thing, (Filter, Motion)):
        parts = {name: value for name, value in vars(thing).items() if not name.startswith("_")}
        parts.pop("rng", None)
        inside = [f"{name}={described(parts[name])}" for name in sorted(parts)]
        if isinstance(thing, LinearMotion):
            inside.append(f"noise of a second={described(thing.matrices(1.0)[1])}")
        return f"{type(thing).__name__}({', '.join(inside)})"
    if isinstance(thing, np.ndarray):
        return str(thing.tolist())
    if isinstance(thing, (tuple, list)):
        return f"[{', '.join(described(one) for one in thing)}]"
    plain = thing is None or isinstance(thing, (bool, int, float, str, np.number))
    return repr(thing) if plain else type(thing).__name__

"""A tracker's state, in memory before a step and in a file: saved, checked, restored.

What is read is checked before it is used: kernels do not check indices.
"""

from __future__ import annotations

import copy
import json
import math
import os
from abc import ABC
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np

from assoc._files.npz import Field, load_npz, save_npz
from assoc._system.door import doors
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.base import Filter
from assoc.filters.batches import arrays_of
from assoc.filters.motion.models import LinearMotion, Motion
from assoc.filters.state import gaussian
from assoc.registration.online import OnlineRegistration
from assoc.scene.scene import Scene
from assoc.sensors import Sensor
from assoc.tracking.births.initiation import Initiation
from assoc.tracking.identity_evidence import Identities
from assoc.tracking.life_cycle import LifeCycle
from assoc.tracking.track_batch import TrackBatch

FORMAT = "assoc.tracker"
VERSION = 1

PREFIX = "bank."
"""What the names of the tracks' fields begin with in a file; files of version 1 have it."""

MOST = 10_000_000
"""Measurements of a sensor in a scan, and scans, at the most."""


def require_field(good: object, name: str, expected: str) -> None:
    """Refuse a field of a saved tracker by name."""
    if not bool(good):
        raise InvalidInputError(f"the field {name!r} is not that of a saved tracker: expected {expected}")


def check_progress(arrays: Mapping[str, Array], tracks: int) -> None:
    """Time, number of scans and ids."""
    require_field(1 <= int(arrays["next_id"]) < 2**62, "next_id", "a whole number above 0")
    time, scan, pace = float(arrays["time"]), int(arrays["scan"]), float(arrays["pace"])
    require_field(not math.isinf(time), "time", "seconds")
    require_field(0 <= scan < 2**62, "scan", "a whole number >= 0")
    require_field(math.isfinite(pace) and pace >= 0, "pace", "seconds >= 0")
    if math.isnan(time):
        require_field(scan == 0 and tracks == 0, "time", "seconds, since there have been scans or tracks")


def check_tracks(arrays: Mapping[str, Array], filter: Filter[Any], widest: int, prefix: str = PREFIX) -> None:
    """Tracks: all arrays of one length, ids that were given, states of the filter's shape.

    Parameters
    ----------
    arrays : mapping
    filter : Filter
    widest : int
        The most components of a measurement.
    prefix : str
        Of the names of a batch's arrays.
    """
    ids = arrays[f"{prefix}track_id"]
    for name, value in arrays.items():
        if name.startswith(prefix):
            require_field(value.ndim and len(value) == len(ids), name, f"{len(ids)} rows, as many as ids")
            if value.dtype.kind == "f":
                require_field(np.isfinite(value).all(), name, "finite numbers")
    given = (ids >= 1) & (ids < int(arrays["next_id"]))
    require_field(given.all(), f"{prefix}track_id", "ids from 1 up to the next one")
    for name in ("detections", "missed", "hits"):
        require_field((arrays[f"{prefix}{name}"] >= 0).all(), f"{prefix}{name}", "whole numbers >= 0")
    n = filter.motion.dim
    for name, model in arrays_of(filter.start(gaussian(np.zeros((1, n)), np.eye(n)[None]))).items():
        key = f"{prefix}state.{name}"
        found = arrays[key].shape[1:]
        # what a filter keeps of measurements has no width before the first one
        same = [a == b or (b == 0 and a <= widest) for a, b in zip(found, model.shape[1:], strict=True)]
        require_field(all(same), key, f"rows of the shape {model.shape[1:]}")
        if name == "weights":
            near = np.abs(arrays[key].sum(axis=-1) - 1.0) < 1e-6
            require_field(near.all() and (arrays[key] >= 0).all(), key, "probabilities")


def check_window(arrays: Mapping[str, Array], tracks: int, sensors: int, depth: int) -> None:
    """Scans that are not final, and each branch's measurements in them."""
    times, sizes, history = arrays["window_times"], arrays["window_sizes"], arrays["history"]
    require_field(len(times) < max(depth, 1) or len(times) == 0, "window_times", f"fewer than {depth} scans")
    require_field(np.isfinite(times).all(), "window_times", "finite numbers")
    require_field(sizes.shape == (len(times), sensors), "window_sizes", f"the shape {(len(times), sensors)}")
    require_field(((sizes >= 0) & (sizes <= MOST)).all(), "window_sizes", "numbers of measurements")
    require_field(history.shape == (tracks, depth * sensors), "history", f"the shape {(tracks, depth * sensors)}")
    most = np.full(depth * sensors, MOST)
    most[: sizes.size] = sizes.ravel()
    known = (history >= 0) & (history <= most)
    require_field(known.all(), "history", "numbers of measurements of the scans in the window")


def rng_state(rng: np.random.Generator, text: str) -> Any:
    """State of a random generator from its JSON text, tried out on a copy."""
    try:
        state = json.loads(text)
        copy.deepcopy(rng.bit_generator).state = state
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError) as error:
        raise InvalidInputError("the field 'filter_rng' is not the state of a random generator") from error
    return state


def changed_setting(saved: str, own: str) -> str:
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
    """A filter or sensor, with all that it and its motion model are made of, as text."""
    if isinstance(thing, (Filter, Motion)):
        parts = {name: value for name, value in vars(thing).items() if not name.startswith("_")}
        parts.pop("rng", None)
        inside = [f"{name}={described(parts[name])}" for name in sorted(parts)]
        if isinstance(thing, Motion):
            # what a user's function does is known by what it gives
            somewhere = np.full((1, thing.dim), 100.0)
            matrix = thing.matrices(1.0)[1] if isinstance(thing, LinearMotion) else thing.noise(somewhere, 1.0)
            inside.append(f"noise of a second={described(matrix)}")
            if not isinstance(thing, LinearMotion):
                inside.append(f"motion of a second={described(thing.propagate(somewhere, 1.0))}")
        return f"{type(thing).__name__}({', '.join(inside)})"
    if isinstance(thing, np.ndarray):
        return str(thing.tolist())
    if isinstance(thing, (tuple, list)):
        return f"[{', '.join(described(one) for one in thing)}]"
    if isinstance(thing, Mapping):
        return f"{{{', '.join(f'{key}: {described(one)}' for key, one in thing.items())}}}"
    if is_dataclass(thing) and not isinstance(thing, type):
        inside = [f"{one.name}={described(getattr(thing, one.name))}" for one in fields(thing)]
        return f"{type(thing).__name__}({', '.join(inside)})"
    plain = thing is None or isinstance(thing, (bool, int, float, str, np.number))
    return repr(thing) if plain else type(thing).__name__


class Memory(NamedTuple):
    """A tracker as it was once. Steps replace arrays and do not write to them, so that nothing need be copied."""

    values: dict[str, Any]
    rng: Any

    @classmethod
    def of(cls, tracker: Any) -> Memory:
        """Remember a tracker."""
        rng = getattr(tracker.filter, "rng", None)
        return cls(_with_own_lists(vars(tracker)), None if rng is None else rng.bit_generator.state)

    def restore(self, tracker: Any) -> None:
        """Make the tracker what it was; the memory stays good for another time."""
        vars(tracker).update(_with_own_lists(self.values))
        if self.rng is not None:
            tracker.filter.rng.bit_generator.state = self.rng

    @property
    def time(self) -> float | None:
        """Time of the last step before, seconds."""
        when: float | None = self.values["_time"]
        return when

    @property
    def next_id(self) -> int:
        """Tracks that began later have this id or a larger one."""
        return int(self.values["_next_id"])

    @property
    def track_ids(self) -> set[int]:
        """Ids of the tracks that lived, also of those in the making elsewhere."""
        young = self.values.get("_young_memory")
        return set(self.values["_batch"].track_id.tolist()) | (set() if young is None else young.track_ids)


def _with_own_lists(values: dict[str, Any]) -> dict[str, Any]:
    return {name: list(value) if isinstance(value, list) else value for name, value in values.items()}


@doors
class Checkpoint(ABC):
    """What makes a tracker savable: its settings, its state as arrays, and how they are checked and taken over.

    Children with a state of their own extend `_settings`, `_arrays`, `_check` and `_take`.
    """

    name: ClassVar[str]
    sensors: tuple[Sensor, ...]
    filter: Filter[Any]
    solver: str
    solver_parameters: dict[str, Any]
    seed: int
    life_cycle: LifeCycle
    initiation: Initiation
    gate_probability: float
    registration: OnlineRegistration | None
    identities: Identities | None
    _place: Scene
    _time: float | None
    _pace: float
    _turns: Array
    _scan: int
    _next_id: int
    _batch: TrackBatch

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the whole state as an npz file of format "assoc.tracker"; whole or not at all."""
        save_npz(path, FORMAT, VERSION, self._arrays())

    def restore(self, path: str | os.PathLike[str]) -> None:
        """Read the state that a tracker with the same settings has saved; the future is the same, bit for bit.

        Raises
        ------
        InvalidInputError
            The file is not a saved tracker, or damaged, or that of a tracker with other settings. The tracker
            is then as it was.
        """
        own = self._arrays()
        kinds = {"f": "float", "i": "int", "u": "int", "b": "bool", "U": "str"}
        spec = {name: Field(kinds[value.dtype.kind], value.ndim) for name, value in own.items()}
        found = load_npz(path, FORMAT, VERSION, {"settings": spec["settings"]})
        if str(found["settings"]) != str(own["settings"]):
            raise InvalidInputError(
                f"{path}: was saved by a tracker with other settings: "
                f"{changed_setting(str(found['settings']), str(own['settings']))}"
            )
        arrays = load_npz(path, FORMAT, VERSION, spec)
        try:
            self._check(arrays)
        except InvalidInputError as error:
            raise InvalidInputError(f"{path}: {error}") from None
        self._take(arrays)

    def _settings(self) -> dict[str, str]:
        """What a saved state depends on, as texts."""
        return {
            "tracker": self.name,
            "filter": described(self.filter),
            "sensors": described(self.sensors),
            "region": str(self._place.region.tolist()),
            "solver": f"{self.solver} {sorted(self.solver_parameters.items())}",
            "seed": str(self.seed),
            "life_cycle": repr(self.life_cycle),
            "initiation": repr(self.initiation),
            "gate_probability": repr(self.gate_probability),
            **({} if self.registration is None else {"registration": repr(self.registration.parameters)}),
            **({} if self.identities is None else {"identity": repr(self.identities.parameters)}),
        }

    def _arrays(self) -> dict[str, Array]:
        rng = getattr(self.filter, "rng", None)
        return {
            "settings": np.array(json.dumps(self._settings())),
            "time": np.array(math.nan if self._time is None else self._time),
            "scan": np.array(self._scan),
            "pace": np.array(self._pace),
            "turns": self._turns,
            "next_id": np.array(self._next_id),
            "filter_rng": np.array("" if rng is None else json.dumps(rng.bit_generator.state)),
            **self._batch.arrays(PREFIX),
            **({} if self.registration is None else self.registration.arrays()),
            **({} if self.identities is None else self.identities.arrays()),
        }

    def _check(self, arrays: dict[str, Array]) -> None:
        """Refuse arrays that no tracker of these settings has saved."""
        check_progress(arrays, len(arrays[f"{PREFIX}track_id"]))
        turns = arrays["turns"]
        good = turns.shape == self._turns.shape and ((turns >= 0) & (turns <= 1 + 1e-6)).all()
        require_field(good, "turns", f"{len(self.sensors)} shares of a turn")
        check_tracks(arrays, self.filter, max(sensor.dim for sensor in self.sensors))
        rng = getattr(self.filter, "rng", None)
        if rng is not None and str(arrays["filter_rng"]):
            rng_state(rng, str(arrays["filter_rng"]))
        if self.registration is not None:
            self.registration.restored(arrays)
        if self.identities is not None:
            self.identities.restored(arrays)

    def _take(self, arrays: dict[str, Array]) -> None:
        """Take over checked arrays."""
        when = float(arrays["time"])
        self._time = None if math.isnan(when) else when
        self._scan, self._next_id = int(arrays["scan"]), int(arrays["next_id"])
        self._pace = float(arrays["pace"])
        self._turns = arrays["turns"]
        rng = getattr(self.filter, "rng", None)
        if rng is not None and str(arrays["filter_rng"]):
            rng.bit_generator.state = rng_state(rng, str(arrays["filter_rng"]))
        self._batch = self._batch.restored(arrays, PREFIX)
        if self.registration is not None:
            self.registration = self.registration.restored(arrays)
        if self.identities is not None:
            self.identities = self.identities.restored(arrays)

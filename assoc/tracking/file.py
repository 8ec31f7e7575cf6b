"""A tracker's state as an npz file. Reading checks everything, since kernels do not check indices."""

from __future__ import annotations

import copy
import json
import math
import os
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from assoc._files.npz import Field, load_npz, save_npz
from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.filters.base import Filter
from assoc.filters.batches import arrays_of
from assoc.filters.motion.models import LinearMotion, Motion
from assoc.tracking.records.biases import Biases
from assoc.tracking.records.clutter import ONE_SAYS, ClutterMap
from assoc.tracking.records.doubles import Doubles
from assoc.tracking.records.echoes import Echoes
from assoc.tracking.records.estimates import DETECTION, PER_TRACK, Estimates
from assoc.tracking.records.extents import Extents
from assoc.tracking.records.ghosts import Unseen
from assoc.tracking.records.track_batch import one_state
from assoc.tracking.records.unresolved import Unresolved
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.state import Starter, TrackerState

FORMAT = "assoc.tracker"
VERSION = 8
_KINDS = {"f": "float", "i": "int", "u": "int", "b": "bool", "U": "str"}


class Saved(dict[str, Array]):
    """The arrays of a file, by name."""

    prefix = ""
    """Prefix of the names in the file, for messages."""

    def require(self, good: object, name: str, expected: str) -> None:
        """Raise an error that names the field, unless `good`."""
        if not bool(good):
            what = f"the field {self.prefix + name!r} is not that of a saved tracker"
            raise InvalidInputError(f"{what}: expected {expected}")

    def part(self, prefix: str) -> Saved:
        """The arrays whose names have this prefix, without it."""
        found = Saved({name.removeprefix(prefix): value for name, value in self.items() if name.startswith(prefix)})
        found.prefix = self.prefix + prefix
        return found


# estimates are far from it; sums and quotients of such numbers are finite
_HUGE = 1e30


def save(path: str | os.PathLike[str], settings: TrackerSettings, state: TrackerState) -> None:
    """Write a state; the file appears whole or not at all."""
    save_npz(path, FORMAT, VERSION, file_arrays(settings, state))


def file_arrays(settings: TrackerSettings, state: TrackerState) -> dict[str, Array]:
    """The arrays that `save` writes."""
    return {"settings": np.array(json.dumps(settings_as_text(settings))), **state_arrays(settings, state)}


def restore(path: str | os.PathLike[str], settings: TrackerSettings, state: TrackerState) -> TrackerState:
    """Read a state saved by a tracker with these settings; `state`, any of its states, gives the arrays' types.

    Refused is a file that is not a saved tracker, or damaged, of another version, or of other settings.
    """
    own = file_arrays(settings, state)
    spec = {name: Field(_KINDS[value.dtype.kind], value.ndim) for name, value in own.items()}
    found = load_npz(path, FORMAT, VERSION, {"version": Field("int", 0), "settings": spec["settings"]})
    if int(found["version"]) != VERSION:
        raise InvalidInputError(
            f"{path}: has version {int(found['version'])} of {FORMAT!r}, this program reads version {VERSION} only; "
            "save the tracker anew"
        )
    if str(found["settings"]) != str(own["settings"]):
        raise InvalidInputError(
            f"{path}: was saved by a tracker with other settings: "
            f"{_changed_setting(str(found['settings']), str(own['settings']))}"
        )
    arrays = load_npz(path, FORMAT, VERSION, spec)
    try:
        return _state(settings, state, Saved(arrays))
    except InvalidInputError as error:
        raise InvalidInputError(f"{path}: {error}") from None


def state_arrays(settings: TrackerSettings, state: TrackerState) -> dict[str, Array]:
    """A state as arrays by name."""
    found = {
        "time": np.array(math.nan if state.time is None else state.time),
        "scan": np.array(state.scan),
        "pace": np.array(state.pace),
        "turns": state.turns,
        "next_id": np.array(state.next_id),
        "solver_calls": np.array(state.solver_calls),
        "filter_rng": np.array("" if state.rng is None else json.dumps(state.rng)),
        **{f"tracks.{name}": value for name, value in state.tracks.arrays().items()},
        **{f"lost.{name}": value for name, value in state.lost.arrays().items()},
        **{f"doubles.{name}": value for name, value in state.doubles._asdict().items()},
        **{f"unresolved.{name}": value for name, value in state.unresolved._asdict().items()},
        **settings.method.arrays(state.method_state),
    }
    if state.identities is not None:
        found |= state.identities.arrays()
    if state.estimates is not None:
        found |= {f"estimates.{name}": np.array(value) for name, value in state.estimates._asdict().items()}
    if state.clutter is not None:
        found |= {f"clutter.{name}": value for name, value in state.clutter.arrays().items()}
    if state.biases is not None:
        found |= {f"biases.{name}": value for name, value in state.biases._asdict().items()}
    if state.echoes is not None:
        found |= {f"echoes.{name}": np.array(value) for name, value in state.echoes._asdict().items()}
    if state.extents is not None:
        found |= {f"extents.{name}": value for name, value in state.extents._asdict().items()}
    if settings.starter is not None and state.starter is not None:
        inner, unseen = state.starter
        found |= {f"nursery.{name}": value for name, value in state_arrays(settings.starter, inner).items()}
        found |= {"unseen_ids": unseen.ids, "unseen": unseen.misses}
    return found


def _state(settings: TrackerSettings, model: TrackerState, saved: Saved) -> TrackerState:
    """The state in these arrays, checked; `model` is any state of these settings."""
    saved.require(1 <= int(saved["next_id"]) < 2**62, "next_id", "a whole number above 0")
    _check_tracks(settings, saved.part("tracks."), int(saved["next_id"]))
    _check_tracks(settings, saved.part("lost."), int(saved["next_id"]))
    tracks, lost = (getattr(model, name).restored(saved.part(f"{name}.")) for name in ("tracks", "lost"))
    time, scan, pace = float(saved["time"]), int(saved["scan"]), float(saved["pace"])
    saved.require(not math.isinf(time), "time", "seconds")
    saved.require(0 <= scan < 2**62, "scan", "a whole number >= 0")
    saved.require(math.isfinite(pace) and pace >= 0, "pace", "seconds >= 0")
    saved.require(int(saved["solver_calls"]) >= 0, "solver_calls", "a whole number >= 0")
    unknown = math.isnan(time) and (scan > 0 or len(tracks) > 0)
    saved.require(not unknown, "time", "seconds, since there have been scans or tracks")
    turns = saved["turns"]
    good = turns.shape == model.turns.shape and ((turns >= 0) & (turns <= 1 + 1e-6)).all()
    saved.require(good, "turns", f"{len(model.turns)} shares of a turn")
    state = model._replace(
        tracks=tracks, lost=lost, doubles=_doubles(model.doubles, saved.part("doubles.")), turns=turns,
        unresolved=_unresolved(model.unresolved, saved.part("unresolved.")),
        time=None if math.isnan(time) else time, scan=scan, pace=pace,
        next_id=int(saved["next_id"]), solver_calls=int(saved["solver_calls"]),
        rng=_rng_state(settings, str(saved["filter_rng"]), model.rng),
        identities=None if model.identities is None else model.identities.restored(saved),
        estimates=None if model.estimates is None else _estimates(model.estimates, saved.part("estimates.")),
        clutter=None if model.clutter is None else _clutter(settings, model.clutter, saved.part("clutter.")),
        biases=None if model.biases is None else _biases(model.biases, saved.part("biases.")),
        echoes=None if model.echoes is None else _echoes(model.echoes, saved.part("echoes.")),
        extents=None if model.extents is None else _extents(model.extents, saved.part("extents.")),
    )  # fmt: skip
    state = state._replace(method_state=settings.method.restored(settings, saved, state))
    if settings.starter is None or model.starter is None:
        return state
    inner = _state(settings.starter, model.starter.state, saved.part("nursery."))
    saved.require(inner.time in (None, state.time), "nursery.time", "the tracker's time")
    ids, misses = saved["unseen_ids"], saved["unseen"]
    saved.require((np.diff(ids) > 0).all(), "unseen_ids", "ids that ascend")
    good = misses.shape == (len(ids), len(turns)) and (misses >= 0).all()
    saved.require(good, "unseen", "how often each sensor has missed each track")
    return state._replace(starter=Starter(inner, Unseen(ids, misses)))


def _doubles(model: Doubles, saved: Saved) -> Doubles:
    """Pairs of tracks in these arrays, checked."""
    ids, counts = saved["ids"], saved["counts"]
    saved.require(ids.shape == (len(ids), 2) and (ids >= 1).all(), "ids", "two track ids in each row")
    good = counts.shape == (len(ids), *model.counts.shape[1:]) and np.isfinite(counts).all() and (counts >= 0).all()
    saved.require(good, "counts", f"numbers >= 0 of the shape {(len(ids), *model.counts.shape[1:])}")
    return Doubles(ids, counts)


def _unresolved(model: Unresolved, saved: Saved) -> Unresolved:
    """Pairs of tracks and what was learnt of resolutions in these arrays, checked."""
    found = Unresolved(**saved)
    saved.require(found.ids.shape == (len(found.ids), 2) and (found.ids >= 1).all(), "ids", "two track ids in each row")
    saved.require(found.apart.shape == (len(found.ids),), "apart", "a number for each pair")
    saved.require((np.diff(found.confirmed) > 0).all(), "confirmed", "ids that ascend")
    good = found.evidence.shape == model.evidence.shape and np.isfinite(found.evidence).all()
    saved.require(good, "evidence", f"finite numbers of the shape {model.evidence.shape}")
    return found


def _estimates(model: Estimates, saved: Saved) -> Estimates:
    """The estimates in these arrays, checked."""
    count = len(saved["ids"])
    saved.require((np.diff(saved["ids"]) > 0).all(), "ids", "ids that ascend")
    for name, value in model._asdict().items():
        shape = np.shape(value)
        shape = (count, *shape[1:]) if name in PER_TRACK else shape
        good = saved[name].shape == shape and (np.abs(saved[name]) < _HUGE).all()
        saved.require(good, name, f"numbers below {_HUGE:g} of the shape {shape}")
    for name in ("factors", "used", "manoeuvres", "bands"):
        saved.require((saved[name] > 1.0 / _HUGE).all(), name, f"numbers above {1.0 / _HUGE:g}")
    saved.require((saved["used"][:, DETECTION] < 1).all(), "used", "probabilities below 1 in its second column")
    saved.require((saved["bands"] < 1).all(), "bands", "probabilities below 1")
    for hits, dwells in (("hits", "dwells"), ("open_hits", "open_dwells")):
        good = (saved[hits] >= 0).all() and (saved[hits] <= saved[dwells] + 1e-6).all()
        saved.require(good, hits, f"numbers from 0 to those of {dwells}")
    for name in ("alarms", "turns"):
        saved.require((saved[name] >= 0).all(), name, "no number below 0")
    saved.require((np.linalg.eigvalsh(saved["weights"]) > 0).all(), "weights", "a positive definite matrix")
    arrays: dict[str, Any] = {**saved, "manoeuvres": float(saved["manoeuvres"])}
    return Estimates(**arrays)


def _clutter(settings: TrackerSettings, model: ClutterMap, saved: Saved) -> ClutterMap:
    """The clutter map in these arrays, checked."""
    for name, value in saved.items():
        saved.require(np.isfinite(value).all(), name, "finite numbers")
    good = saved["clock"].shape == model.clock.shape and (saved["clock"] >= 0).all()
    saved.require(good, "clock", f"turns of {len(model.clock)} sensors")
    for s, own in enumerate(model.plots):
        count, width = len(saved[f"places.{s}"]), own.places.shape[1]
        saved.require(saved[f"places.{s}"].shape[1] == width, f"places.{s}", f"rows of {width} components")
        part = settings.sensors[s].position_part
        # in units of the noise; what turns is searched for in a circle, the squares of the rest must be numbers
        turns, unit = np.array(part.angular[:width]), np.sqrt(np.diagonal(part.covariance)[:width])
        low, high = np.where(turns, 0.0, -1e100), np.where(turns, 2.0 * math.pi / unit * (1.0 + 1e-12), 1e100)
        good = ((saved[f"places.{s}"] >= low) & (saved[f"places.{s}"] <= high)).all()
        saved.require(good, f"places.{s}", "places in units of the noise, azimuths from 0 to a full turn")
        clocks = saved[f"clocks.{s}"]
        good = clocks.shape == (count,) and (np.diff(clocks) >= 0).all() and (clocks <= saved["clock"][s]).all()
        saved.require(good, f"clocks.{s}", f"{count} turns that do not descend")
        votes = saved[f"votes.{s}"]
        good = votes.shape == (count,) and bool((np.abs(votes) <= ONE_SAYS).all())
        saved.require(good, f"votes.{s}", f"{count} numbers from {-ONE_SAYS:.3g} to {ONE_SAYS:.3g}")
        saved.require(saved[f"sites.{s}"].shape == (count,), f"sites.{s}", f"{count} numbers of sites")
    return model.restored(saved)


def _biases(model: Biases, saved: Saved) -> Biases:
    """Biases in these arrays, checked."""
    for name, value in model._asdict().items():
        good = saved[name].shape == value.shape and (np.abs(saved[name]) < _HUGE).all()
        saved.require(good, name, f"numbers below {_HUGE:g} of the shape {value.shape}")
    # as far as rounding lets it be: information on drifts grows with the squares of the scans
    least = -1e-9 * max(np.abs(saved["information"]).max(initial=0.0), 1.0)
    some = (np.linalg.eigvalsh(saved["information"] + saved["information"].swapaxes(1, 2)) > least).all()
    saved.require(some, "information", "matrices that are not negative")
    return Biases(**saved)


def _echoes(model: Echoes, saved: Saved) -> Echoes:
    """Tracks that may be echoes in these arrays, checked."""
    pairs = len(saved["ids"])
    for name, value in model._asdict().items():
        shape = np.shape(value)
        shape = (pairs, *shape[1:]) if name in ("ids", "kinds", "counts") else shape
        shape = (len(saved[name]),) if name == "hidden" else shape
        good = saved[name].shape == shape and np.isfinite(saved[name]).all() and (saved[name] >= 0).all()
        saved.require(good, name, f"numbers >= 0 of the shape {shape}")
    saved.require((np.diff(saved["hidden"]) > 0).all(), "hidden", "ids that ascend")
    saved.require((saved["kinds"] < np.shape(model.found)).all(), "kinds", "a sensor, and 0 or 1")
    return Echoes(**{**saved, "targets": float(saved["targets"])})  # type: ignore[arg-type]


def _extents(model: Extents, saved: Saved) -> Extents:
    """Targets with an extent in these arrays, checked."""
    count = len(saved["ids"])
    for name, value in model._asdict().items():
        shape = (len(saved["past"]), 3) if name == "past" else (count, *value.shape[1:])
        good = saved[name].shape == shape and (np.abs(saved[name]) < _HUGE).all()
        saved.require(good, name, f"numbers below {_HUGE:g} of the shape {shape}")
        least = -_HUGE if name in ("evidence", "places", "shapes", "covariance") else 0
        saved.require((saved[name] >= least).all(), name, "no number below 0")
    saved.require((np.diff(saved["ids"]) > 0).all(), "ids", "ids that ascend")
    for name in ("shapes", "covariance"):
        saved.require((np.linalg.eigvalsh(saved[name]) > -1e-6).all(), name, "matrices that are not negative")
    some = saved["points"].sum(axis=(3, 4))[saved["dwells"] > 0]
    saved.require((np.abs(some - 1.0) < 1e-6).all(), "points", "probabilities")
    return Extents(**saved)


def _check_tracks(settings: TrackerSettings, saved: Saved, next_id: int) -> None:
    """Check tracks: arrays of equal length, ids below `next_id`, states of the filter's shape."""
    ids = saved["track_id"]
    for name, value in saved.items():
        saved.require(len(value) == len(ids), name, f"{len(ids)} rows, as many as ids")
        if value.dtype.kind == "f":
            saved.require(np.isfinite(value).all(), name, "finite numbers")
    saved.require(((ids >= 1) & (ids < next_id)).all(), "track_id", "ids from 1 up to the next one")
    for name in ("detections", "missed", "hits", "hidden"):
        saved.require((saved[name] >= 0).all(), name, "numbers >= 0")
    widest = max(sensor.dim for sensor in settings.sensors)
    for name, model in arrays_of(one_state(settings.filter)).items():
        key, value = f"state.{name}", saved[f"state.{name}"]
        # arrays in which a filter stores measurements have width 0 before the first one
        pairs = zip(value.shape[1:], model.shape[1:], strict=True)
        same = all(a == b or (b == 0 and a <= widest) for a, b in pairs)
        saved.require(same, key, f"rows of the shape {model.shape[1:]}")
        if name == "weights":
            near = np.abs(value.sum(axis=-1) - 1.0) < 1e-6
            saved.require(near.all() and (value >= 0).all(), key, "probabilities")


def _rng_state(settings: TrackerSettings, text: str, now: Any) -> Any:
    """State of the filter's random generator from JSON, tested on a copy; without a text, the present state."""
    if now is None or not text:
        return now
    try:
        state = json.loads(text)
        copy.deepcopy(settings.filter.rng.bit_generator).state = state  # type: ignore[attr-defined]
    except (ValueError, TypeError, KeyError, RecursionError, OverflowError) as error:
        raise InvalidInputError("the field 'filter_rng' is not the state of a random generator") from error
    return state


def settings_as_text(settings: TrackerSettings) -> dict[str, str]:
    """The settings that a saved state depends on, as texts."""
    return {
        "tracker": settings.name,
        "filter": described(settings.filter),
        "sensors": described(settings.sensors),
        "region": str(settings.scene.region.tolist()),
        "solver": f"{settings.solver} {sorted(settings.solver_parameters.items())}",
        "seed": str(settings.seed),
        "life_cycle": repr(settings.life_cycle),
        "initiation": repr(settings.initiation),
        "gate_probability": repr(settings.gate_probability),
        # as files from before still say
        "registration": "none",
        "identity": repr(settings.identity),
        # left out where it is not on: files from before it are still read
        **({"adapt": "True"} if settings.adapt else {}),
        **({"extended": "True"} if settings.extended else {}),
        **{item.name: described(getattr(settings.method, item.name)) for item in fields(settings.method)},
    }


def _changed_setting(saved: str, own: str) -> str:
    """Say which setting of a tracker differs from a saved one's."""
    now = json.loads(own)
    try:
        before = json.loads(saved)
    except (ValueError, RecursionError):
        before = None
    if not isinstance(before, dict):
        return "they cannot be read"
    for key in {**now, **before}:
        old, new = str(before.get(key)), str(now.get(key))
        if old != new:
            # long texts are shown from their first difference
            same = len(os.path.commonprefix([old, new]))
            first = 0 if same < 60 else same - 20
            return f"{key} was {old[first : first + 80]!r}, is {new[first : first + 80]!r}"
    return "an unknown setting"


def described(thing: object) -> str:
    """A filter or sensor with all its parameters, and those of its motion model, as text."""
    if isinstance(thing, (Filter, Motion)):
        parts = {name: value for name, value in vars(thing).items() if not name.startswith("_")}
        parts.pop("rng", None)
        inside = [f"{name}={described(parts[name])}" for name in sorted(parts)]
        if isinstance(thing, Motion):
            # functions of users are compared by their results
            somewhere = np.full((1, thing.dim), 100.0)
            matrix = thing.matrices(1.0)[1] if isinstance(thing, LinearMotion) else thing.noise(somewhere, 1.0)
            inside.append(f"noise of a second={described(matrix)}")
            if not isinstance(thing, LinearMotion):
                inside.append(f"motion of a second={described(thing.propagate(somewhere, 1.0))}")
        return f"{type(thing).__name__}({', '.join(inside)})"
    if isinstance(thing, np.ndarray):
        return str(thing.tolist())
    if isinstance(thing, (tuple, list)):
        return f"[{', '.join(described(item) for item in thing)}]"
    if isinstance(thing, Mapping):
        return f"{{{', '.join(f'{key}: {described(item)}' for key, item in thing.items())}}}"
    if is_dataclass(thing) and not isinstance(thing, type):
        inside = [f"{item.name}={described(getattr(thing, item.name))}" for item in fields(thing)]
        return f"{type(thing).__name__}({', '.join(inside)})"
    plain = thing is None or isinstance(thing, (bool, int, float, str, np.number))
    return repr(thing) if plain else type(thing).__name__

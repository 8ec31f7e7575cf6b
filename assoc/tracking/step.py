"""A step of a tracker: check -> register -> predict -> associate -> life cycle -> report, one function a stage.

A stage takes a step under way and hands it on (`assoc.tracking.progress`); `stages_of` lists those that a tracker has.
What a measurement adds to a track's score is told by the filter's correction: associating and updating are one stage.
Whatever fails, the state of before is as it was: stages write to nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from assoc._system.interrupts import interruptible
from assoc._types import Array
from assoc.errors import InvalidInputError, warn
from assoc.scene.own_times import checked_sectors, checked_times
from assoc.scene.scan import Scan
from assoc.tracking.births.new_tracks import angles_alone
from assoc.tracking.births.nursery import current, end_ghosts, raise_young, take_over
from assoc.tracking.checking import checked_measurements, checked_time
from assoc.tracking.identity_evidence import checked_identities
from assoc.tracking.looks import excuse, keep_pace
from assoc.tracking.progress import Progress, Work
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.stages import associate, live, predict, register, remember_identities, report
from assoc.tracking.state import TrackerState, rng_of
from assoc.tracking.track import Step

Stage = Callable[[Progress], Progress]


def stages_of(settings: TrackerSettings) -> list[Stage]:
    """The stages of a step after its input has been checked, in order."""
    nursing = settings.nursery is not None
    return [
        *([register] if settings.registration is not None else []),
        keep_pace,
        *([take_over] if nursing else []),
        predict,
        associate,
        live,
        *([end_ghosts, raise_young] if nursing else []),
        *([remember_identities] if settings.identity is not None else []),
        excuse,
        report,
    ]


def advance(settings: TrackerSettings, state: TrackerState, scan: Scan) -> tuple[TrackerState, Step]:
    """Take in a checked scan.

    Returns
    -------
    state, step
        What the tracker is after it, and what it says of it.

    Raises
    ------
    InvalidInputError
        Times and measurements lead to numbers out of range.
    """
    progress = Progress(settings, _warned(settings, state, scan), scan, Work(settings, state))
    if state.rng is not None:
        settings.filter.rng.bit_generator.state = state.rng  # type: ignore[attr-defined]
    try:
        with interruptible():
            for stage in stages_of(settings):
                progress = stage(progress)
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        dt = 0.0 if state.time is None else scan.time - state.time
        raise InvalidInputError(
            f"the scan at {scan.time:g} s, {dt:g} s after the last, leads to numbers out of range ({error}); expected "
            "seconds, metres and radians"
        ) from error
    assert progress.step is not None
    return progress.state._replace(rng=rng_of(settings)), progress.step


def check(
    settings: TrackerSettings,
    state: TrackerState,
    time: object,
    measurements: Sequence[Array],
    times: Sequence[Array] | None,
    sectors: Array | None,
    identities: Sequence[Array] | None,
) -> Scan:
    """The first stage: what `Tracker.step` is given as a scan, or an InvalidInputError that names what is wrong."""
    when, sensors = checked_time(time, state.time), settings.sensors
    checked = checked_measurements(measurements, sensors)
    stamps = None if times is None else _checked_stamps(times, checked, when, state.time)
    looks = None if sectors is None else checked_sectors(sectors, len(sensors), "sectors")
    if settings.registration is not None and stamps is not None:
        raise InvalidInputError("times: registration needs measurements of one instant; register a scene before")
    codes = None
    if settings.identity is not None and identities is not None:
        codes = tuple(checked_identities(identities, [len(z) for z in checked]))
        if stamps is None:
            # identities are weighed where measurements are followed one by one, at their own times
            stamps = tuple(np.full(len(z), when) for z in checked)
    return Scan(state.scan, when, tuple(checked), times=stamps, sectors=looks, identities=codes)


def _checked_stamps(
    times: Sequence[Array], measurements: list[Array], when: float, before: float | None
) -> tuple[Array, ...]:
    checked = checked_times(times, measurements, when, "times")
    early = -math.inf if before is None else before
    for s, array in enumerate(checked):
        if len(array) and array.min() < early:
            raise InvalidInputError(
                f"times of sensor {s} must lie from the last step's time, {early:g} s, to {when:g} s, "
                f"got {array.min():g}"
            )
    return checked


def _warned(settings: TrackerSettings, state: TrackerState, scan: Scan) -> TrackerState:
    """Warn once where angles alone can start no track, and there is none."""
    sensors = settings.sensors
    if state.warned or not any(map(len, scan.measurements)) or not angles_alone(sensors):
        return state
    if scan.at_once and len(sensors) > 1 or len(current(settings, state)):
        return state
    if any(fit.any() for fit in settings.births.places(scan.measurements).fit):
        return state
    if len(sensors) == 1:
        warn("the only sensor measures angles alone: no track starts, for bearings do not cross")
    else:
        what = "measurements with times, sectors or identities start no tracks"
        warn(f"all sensors measure angles alone: {what}, only those of one instant without do")
    return state._replace(warned=True)

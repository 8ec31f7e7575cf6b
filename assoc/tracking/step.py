"""A step of a tracker: check -> register -> predict -> associate -> life cycle -> report, one function a stage.

A stage takes a step under way and hands it on (`assoc.tracking.progress`); `stages_of` lists those that a tracker has.
What a measurement adds to a track's score is told by the filter's correction: associating and updating are one stage.
Whatever fails, the state of before is as it was: stages write to nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from assoc._system.interrupts import interruptible
from assoc._types import Array
from assoc.costs.tracks.own_times import PairEvidence, TimedScan
from assoc.errors import InvalidInputError, warn
from assoc.filters.base import predict_each
from assoc.scene.own_times import checked_sectors, checked_times
from assoc.scene.scan import Scan
from assoc.tracking.births.nursery import current, end_ghosts, raise_young, take_over
from assoc.tracking.checking import checked_measurements, checked_time
from assoc.tracking.identity_evidence import checked_identities
from assoc.tracking.looks import excuse, keep_pace
from assoc.tracking.progress import Progress, Work
from assoc.tracking.settings import TrackerSettings
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
        *([end_ghosts, young] if nursing else []),
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
    if not settings.angles_alone or state.warned or not any(map(len, scan.measurements)):
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


def register(progress: Progress) -> Progress:
    """Estimate the sensors' biases by the scan, and correct its measurements by them."""
    scan = progress.scan
    assert progress.state.registration is not None
    registration = progress.state.registration.after(scan.time, scan.measurements)
    corrected = replace(scan, measurements=tuple(registration.correct(scan.measurements)))
    return progress.with_state(registration=registration)._replace(scan=corrected)


def predict(progress: Progress) -> Progress:
    """Let time pass: some targets leave; tracks move to the scan, or are followed from measurement to measurement."""
    settings, dt = progress.settings, progress.elapsed
    tracks = progress.state.tracks.survived(dt / settings.life_cycle.lifetime)
    progress = progress.with_state(tracks=tracks)
    if not progress.scan.at_once:
        return progress._replace(timed=_timed(settings, progress.state, settings.method.arranged(progress.scan)))
    if dt == 0.0 or not len(tracks):
        return progress
    states = predict_each(settings.filter, tracks.states, np.full(len(tracks), dt))
    return progress.with_state(tracks=tracks.moved(states))


def _timed(settings: TrackerSettings, state: TrackerState, scan: Scan) -> TimedScan:
    """The tracks and a scan whose measurements have times of their own."""

    def start(where: Array, spread: Array, lag: Array) -> Any:
        return settings.initiation.start(settings.filter, where, spread, lag)

    before = scan.time if state.time is None else state.time
    return TimedScan(
        settings.filter, state.tracks.states, before, scan.measurements, scan.own_times(), settings.sensors,
        settings.births.places(scan.measurements), start, scan.sectors, settings.gate_probability, scan.time,
        _evidence(state, scan),
    )  # fmt: skip


def _evidence(state: TrackerState, scan: Scan) -> PairEvidence | None:
    """What identities say of pairs of a row of the tracks and a measurement."""
    known, codes, track_id = state.identities, scan.identities, state.tracks.track_id
    if known is None or codes is None:
        return None
    return lambda track, s, measurement: known.evidence(track_id[track], codes[s][measurement])


def associate(progress: Progress) -> Progress:
    """Associate the measurements with the tracks, which are corrected by them, and begin new tracks."""
    method = progress.settings.method
    if progress.timed is None:
        return progress._replace(found=method.at_once(progress))
    return progress._replace(found=method.in_order(progress, progress.timed))


def live(progress: Progress) -> Progress:
    """Confirm tracks, decide, delete tracks."""
    done: Progress = progress.settings.method.life_cycle(progress, progress.found)
    return done


def remember_identities(progress: Progress) -> Progress:
    """Take note of what the plots of each track told."""
    state, told, step = progress.state, progress.scan.identities, progress.step
    assert state.identities is not None and step is not None
    if told is None:
        return progress
    return progress.with_state(identities=state.identities.after(step.assigned, told, state.tracks.track_id))


def report(progress: Progress) -> Progress:
    """End the step: the state is that after the scan."""
    work, scan = progress.work, progress.scan
    return progress.with_state(
        time=scan.time, scan=progress.state.scan + 1, next_id=work.next_id, solver_calls=work.solver_calls
    )


def young(progress: Progress) -> Progress:
    """Take a step of the nursery with the measurements that the tracks have left over."""
    return raise_young(progress, [keep_pace, predict, associate, live, excuse, report])

"""A step of a tracker: check -> predict -> associate -> life cycle -> report, one function a stage.

A stage takes a step under way (`assoc.tracking.progress`) and returns the next one; `stages_of` lists the stages of a
tracker. Scores of measurements come from the filter's update, so associating and updating are one stage. Stages do not
modify their input: after an error the old state is intact.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from assoc._system.interrupts import interruptible
from assoc._text.times import moment
from assoc._types import Array
from assoc.costs.tracks.own_times import PairEvidence, TimedScan
from assoc.errors import InvalidInputError, warn
from assoc.filters.base import predict_each
from assoc.filters.batches import placed
from assoc.scene.own_times import checked_sectors, checked_times
from assoc.scene.scan import Scan
from assoc.tracking.adapting.learning import correct, learn, remember_tracks, use_estimates
from assoc.tracking.adapting.speeds import use_speeds
from assoc.tracking.progress import Progress, Work
from assoc.tracking.records.identity_evidence import checked_identities
from assoc.tracking.records.track import Step
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.stages.checking import checked_measurements, checked_time
from assoc.tracking.stages.coverage import count_out_of_view, keep_pace
from assoc.tracking.stages.echoes import hide_echoes
from assoc.tracking.stages.extents import weigh_extents
from assoc.tracking.stages.gathering import gather, plot_by_plot, with_widths
from assoc.tracking.stages.merging import merge
from assoc.tracking.stages.splitting import name_parents
from assoc.tracking.stages.starter import current, end_ghosts, step_starter, take_over
from assoc.tracking.stages.taking_up import take_up
from assoc.tracking.stages.unresolved import share, tell_apart, without_copies
from assoc.tracking.state import TrackerState, rng_of

Stage = Callable[[Progress], Progress]


def stages_of(settings: TrackerSettings) -> list[Stage]:
    """The stages of a step after its input has been checked, in order."""
    starting = settings.starter is not None
    return [
        *([correct, use_estimates, use_speeds] if settings.adapt else []),
        *([gather] if settings.extended and not starting else []),
        keep_pace,
        *([take_over] if starting else [share]),
        predict,
        *([remember_tracks] if settings.adapt else []),
        count_out_of_view,
        associate,
        live,
        *([within_heights] if settings.height is not None else []),
        *([end_ghosts, grow_starter] if starting else []),
        *([hide_echoes] if settings.adapt and not starting else []),
        *([weigh_extents] if settings.extended and not starting else []),
        *([learn] if settings.adapt else []),
        *([remember_identities] if settings.identity is not None else []),
        *([] if starting else [take_up, merge, name_parents, tell_apart]),
        *([plot_by_plot] if settings.extended and not starting else []),
        report,
    ]


def advance(settings: TrackerSettings, state: TrackerState, scan: Scan) -> tuple[TrackerState, Step]:
    """Process a checked scan: the tracker's state after it, and its result.

    InvalidInputError where times and measurements lead to numbers out of range.
    """
    settings = settings.at(scan.time)
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
            f"the scan at {moment(scan.time)}, {dt:g} s after the last, leads to numbers out of range ({error}); "
            "expected seconds, metres and radians"
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
    passed = None if sectors is None else checked_sectors(sectors, len(sensors), "sectors")
    codes = None
    if identities is not None:
        codes = tuple(checked_identities(identities, [len(z) for z in checked]))
        if stamps is None and settings.identity is not None:
            # only the functions for measurements with times of their own weigh identities
            stamps = tuple(np.full(len(z), when) for z in checked)
    scan = Scan(state.scan, when, tuple(checked), times=stamps, sectors=passed, identities=codes)
    return scan.aligned(sensors)


def _checked_stamps(
    times: Sequence[Array], measurements: list[Array], when: float, before: float | None
) -> tuple[Array, ...]:
    checked = checked_times(times, measurements, when, "times")
    early = -math.inf if before is None else before
    for s, array in enumerate(checked):
        if len(array) and array.min() < early:
            raise InvalidInputError(
                f"times of sensor {s} must lie from the last step's time, {moment(early)}, to {moment(when)}, "
                f"got {array.min():g}"
            )
    return checked


def _warned(settings: TrackerSettings, state: TrackerState, scan: Scan) -> TrackerState:
    """Warn once if there is no track and measurements of angles alone cannot start one."""
    sensors = settings.sensors
    if not settings.angles_alone or state.warned or not any(map(len, scan.measurements)):
        return state
    if scan.at_once and len(sensors) > 1 or len(current(settings, state)):
        return state
    if any(fit.any() for fit in settings.births.places(scan).fit):
        return state
    if len(sensors) == 1:
        warn("the only sensor measures angles alone: no track starts, for bearings do not cross")
    else:
        what = "measurements with times, sectors or identities start no tracks"
        warn(f"all sensors measure angles alone: {what}, only those of one instant without do")
    return state._replace(warned=True)


def predict(progress: Progress) -> Progress:
    """Lower the existence of tracks by the time passed; predict them to the scan, or prepare them for own times."""
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
    """Tracks and scan, where measurements have times of their own."""

    def start(where: Array, spread: Array, lag: Array) -> Any:
        return settings.initiation.start(settings.filter, where, spread, lag)

    before = scan.time if state.time is None else state.time
    return TimedScan(
        settings.filter, state.tracks.states, before, scan, settings.sensors, settings.births.places(scan), start,
        settings.gate_probability, _evidence(state, scan),
    )  # fmt: skip


def _evidence(state: TrackerState, scan: Scan) -> PairEvidence | None:
    """Evidence of identities about pairs of a track's row and a measurement; None without identities."""
    known, codes, track_id = state.identities, scan.identities, state.tracks.track_id
    if known is None or codes is None:
        return None
    return lambda track, s, measurement: known.evidence(track_id[track], codes[s][measurement])


def associate(progress: Progress) -> Progress:
    """Associate measurements with tracks, update the tracks, and begin new ones."""
    method = progress.settings.method
    if progress.timed is not None and not method.own_times:
        raise InvalidInputError("times, sectors and identities: this tracker takes measurements of one instant only")
    first_new, shared = progress.work.next_id, progress.shared
    done = method.associate(progress)
    if progress.gathered is not None:
        done = with_widths(progress, done)
    if shared is None or shared.measured is None:
        return progress._replace(association=done)
    return progress._replace(association=without_copies(progress, done, first_new), scan=shared.measured)


def live(progress: Progress) -> Progress:
    """Confirm tracks, report decisions, delete tracks."""
    done: Progress = progress.settings.method.life_cycle(progress, progress.association)
    return done


def within_heights(progress: Progress) -> Progress:
    """Give tracks whose height has become less certain than the region's heights these as a measurement."""
    settings, tracks = progress.settings, progress.state.tracks
    height, axis = settings.height, settings.filter.motion.position[2]
    assert height is not None
    wide = tracks.states.covariance[:, axis, axis] > height.covariance[0, 0]
    if not wide.any():
        return progress
    middle = np.full((np.count_nonzero(wide), 1), settings.scene.region[2].mean())
    known = settings.filter.update(tracks.states[wide], middle, height).state
    rest = np.flatnonzero(~wide)
    states = placed(len(tracks), [(np.flatnonzero(wide), known), (rest, tracks.states[rest])])
    return progress.with_state(tracks=tracks.moved(states))


def remember_identities(progress: Progress) -> Progress:
    """Add the identities of this scan's plots to their tracks."""
    state, codes, step = progress.state, progress.scan.identities, progress.step
    assert state.identities is not None and step is not None
    if codes is None:
        return progress
    return progress.with_state(identities=state.identities.after(step.assigned, codes, state.tracks.track_id))


def report(progress: Progress) -> Progress:
    """End the step: set time, scan number and counters of the new state."""
    work, scan = progress.work, progress.scan
    if work.gap > 0.0 and progress.step is not None:
        progress = progress._replace(step=replace(progress.step, gap=work.gap))
    return progress.with_state(
        time=scan.time, scan=progress.state.scan + 1, next_id=work.next_id, solver_calls=work.solver_calls
    )


def grow_starter(progress: Progress) -> Progress:
    """Step the starter with the measurements that no track took."""
    return step_starter(progress, [keep_pace, predict, count_out_of_view, associate, live, report])

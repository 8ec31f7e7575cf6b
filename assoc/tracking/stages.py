"""The stages that every step of a tracker has, and those of registration and identities; see `assoc.tracking.step`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from assoc._types import Array
from assoc.costs.tracks.own_times import PairEvidence, TimedScan
from assoc.filters.base import predict_each
from assoc.scene.scan import Scan
from assoc.tracking.progress import Progress
from assoc.tracking.settings import TrackerSettings
from assoc.tracking.state import TrackerState


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

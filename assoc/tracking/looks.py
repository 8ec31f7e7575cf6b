"""Where sensors looked: how often in a scan, which tracks they could see, and which were missed for too long."""

from __future__ import annotations

import numpy as np

from assoc._types import Array
from assoc.scene.own_times import FULL_TURN, looked_at
from assoc.tracking.progress import Progress
from assoc.tracking.track_batch import TrackBatch

_FORGETTING = 0.05
# turns in a scan; with fewer all sensors are taken to be off, and no track is deleted
_LEAST_TURN = 1e-3


def keep_pace(progress: Progress) -> Progress:
    """Update the exponential means of the scans' pace and of the sensors' turns, both of which may change."""
    state, dt = progress.state, progress.elapsed
    if dt == 0:
        return progress
    share = max(1.0 / max(state.scan, 1), _FORGETTING)
    sectors, turns = progress.scan.sectors, state.turns
    if sectors is not None:
        turns = turns + ((sectors[:, 1] - sectors[:, 0]) / FULL_TURN - turns) * share
    return progress.with_state(pace=state.pace + (dt - state.pace) * share, turns=turns)


def excuse(progress: Progress) -> Progress:
    """Undo the effect of misses on existence for tracks outside the field of view of a sensor that looked."""
    tracks = progress.state.tracks
    overlooked: Array = (out_of_view(progress) & looked(progress)) @ progress.settings.terms.miss
    return progress.with_state(tracks=tracks.not_overlooked(-overlooked))


def out_of_view(progress: Progress) -> Array:
    """Which tracks are outside of which sensors' fields of view, and so not missed, bool (T, S)."""
    where, views = _where(progress), [sensor.position_part for sensor in progress.settings.sensors]
    return ~np.stack([sensor.in_view(sensor.measure(where)) for sensor in views], axis=1)


def looked(progress: Progress) -> Array:
    """Which sensors looked towards which tracks, bool (T, S)."""
    sectors, sensors = progress.scan.sectors, progress.settings.sensors
    if sectors is None:
        return np.ones((len(progress.state.tracks), len(sensors)), dtype=np.bool_)
    away = _where(progress)[:, None] - np.array([sensor.position for sensor in sensors])
    azimuths = np.arctan2(away[..., 1], away[..., 0])
    return np.stack([looked_at(sector, azimuth) for sector, azimuth in zip(sectors, azimuths.T, strict=True)], axis=1)


def _where(progress: Progress) -> Array:
    """Positions of the tracks, (T, 3)."""
    tracks, position = progress.state.tracks, list(progress.settings.filter.motion.position)
    where = np.zeros((len(tracks), 3))
    where[:, : len(position)] = tracks.states.mean[:, position]
    return where


def to_delete(progress: Progress, tracks: TrackBatch) -> Array:
    """Which tracks are to be deleted after the scan, bool (T,)."""
    settings, state = progress.settings, progress.state
    # dwells are counted in scans of the sensor that turns fastest
    most = float(state.turns.max())
    if most < _LEAST_TURN:
        return np.zeros(len(tracks), dtype=np.bool_)
    patience = settings.life_cycle.patience(settings.terms.miss * (state.turns / most), state.pace / most)
    return tracks.to_delete(settings.life_cycle, progress.scan.time, patience)

"""Recordings as cases of `experiments.trackers.unseen`: reports of ships (AIS), and the Autoferry scenarios."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd

from assoc.scene import Scene, Truth
from assoc.sensors import PositionSensor
from experiments.real import autoferry

AIS = {"AIS every 10 s": 10.0, "AIS every 60 s": 60.0}
"""Seconds between two reports of a ship that trackers are given."""
# a ship silent for longer is gone, seconds
_SILENT = 180.0


def kinds(path: Path) -> list[str]:
    """What a file of reports, or a folder of scenarios, holds."""
    return [f"ferry {n}" for n in autoferry.scenarios(path)] if path.is_dir() else [*AIS]


def case(path: Path, kind: str) -> SimpleNamespace:
    """A case with what a user would say of boats."""
    common = {"plane": True, "oracle": None}
    if path.is_dir():
        scene = autoferry.load(path, int(kind.split()[1]), autoferry.SETS["radar and lidar"])
        opts = {"speed": autoferry.SPEED, "process_noise": autoferry.SETTING.process_noise}
        # docks and moored boats are in no truth: what stays within 15 m of where it began is not judged
        return SimpleNamespace(scene=_with_sources(scene), cutoff=autoferry.CUTOFF, targets=None, opts=opts, away=15.0,
                               **common)  # fmt: skip
    return SimpleNamespace(scene=_reports(path, AIS[kind]), cutoff=200.0, targets="ship", opts={}, **common)


def _with_sources(scene: Scene) -> Scene:
    """The scene with the detection nearest to each boat, within 25 m, as that boat's."""
    sources = []
    for k in range(scene.num_scans):
        found = [np.full(len(z), -1) for z in scene.measurements[k]]
        for own, z in zip(found, scene.scan(k).aligned(scene.sensors).measurements, strict=True):
            for boat, at in zip(scene.truth.target_ids[k].tolist(), scene.truth.positions[k], strict=True):
                apart = np.linalg.norm(z - at[:2], axis=1)
                if len(z) and apart.min() < autoferry.NEAR:
                    own[apart.argmin()] = boat
        sources.append(found)
    truth = Truth(scene.truth.target_ids, scene.truth.positions, sources)
    return Scene(scene.sensors, scene.times, scene.measurements, scene.region, truth, sectors=scene.sectors)


def _reports(path: Path, interval: float) -> Scene:
    """Ships in one plane, each where it is at the same instants, by two reports around; nobody says who is who."""
    table = pd.read_csv(path)
    time = pd.to_datetime(table["Time"]).to_numpy().astype("datetime64[ms]").astype(np.int64) / 1e3
    lat, lon = (np.radians(table[f"{name}_degrees"].to_numpy()) for name in ("Latitude", "Longitude"))
    place = 6371e3 * np.column_stack([(lon - np.median(lon)) * np.cos(np.median(lat)), lat - np.median(lat)])
    times = np.arange(0.0, float(np.ptp(time)), interval)
    ids, at = [[[] for _ in times] for _ in range(2)]
    for ship, (_, rows) in enumerate(table.groupby("MMSI").groups.items()):
        when, index = np.unique(time[rows] - time.min(), return_index=True)
        where, after = place[rows][index], np.searchsorted(when, times)
        for k in np.flatnonzero((after > 0) & (after < len(when))).tolist():
            a = after[k]
            if when[a] - when[a - 1] <= _SILENT:
                part = (times[k] - when[a - 1]) / (when[a] - when[a - 1])
                ids[k].append(ship)
                at[k].append(where[a - 1] + part * (where[a] - where[a - 1]))
    xy = [np.array(rows).reshape(-1, 2) for rows in at]
    region = np.array([*np.stack([place.min(axis=0) - 1e3, place.max(axis=0) + 1e3], axis=1), [0.0, 1.0]])
    sensor = PositionSensor(position=np.zeros(3), noise=np.array([10.0, 10.0]), detection_probability=0.95,
                            false_alarm_rate=0.1, field_of_view=region[:2], name="AIS")  # fmt: skip
    names = [np.array(rows, dtype=np.int64) for rows in ids]
    truth = Truth(names, [np.append(z, np.zeros((len(z), 1)), axis=1) for z in xy], [[rows] for rows in names])
    return Scene([sensor], times, [[z] for z in xy], region, truth)

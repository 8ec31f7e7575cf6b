"""Air traffic control: radars with biases over recorded or simulated flights, from plots to reference trajectories.

Four turning radars with errors of range, azimuth and gain see the flights of FILE (trajectories, as for from-tracks)
and simulated ones, while 0, 20 and 100 % of the aircraft have no transponder: their plots have neither altitude, code
nor address (primary only). The radars are registered, the plots tracked without codes and addresses, and the tracks
smoothed.
"""

import math
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path as File
from typing import NamedTuple

import numpy as np

from assoc._types import Array
from assoc.recordings import Recording, radar_of
from assoc.recordings.columns import FLIGHT_LEVEL
from assoc.recordings.on_earth import placed
from assoc.recordings.several import identities_of_radars, parts_of_radars, scene_of_radars
from assoc.registration import register, with_biases
from assoc.scene import Scene
from assoc.scene.geodesy import Origin, east_north_up, geodetic
from assoc.sensors.base import wrap_angle
from assoc.simulation import simulate
from assoc.simulation.antenna import dwells, slant_range_and_bearing
from assoc.simulation.flights import random_flight
from assoc.simulation.radars import on_circle
from assoc.simulation.turning import Path
from assoc.tracking import TRACKERS, TrackTable, smoothed, track_scene
from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.trackers.judging import mean_claim

SHARES = (0.0, 0.2, 1.0)
"""Of aircraft without a transponder."""
TURNS, REACH, SPREAD = (5.0, 6.0, 8.0, 10.0), 250e3, 100e3
NOISE, HEIGHT_NOISE, DETECTION, FALSE_PLOTS, LOST = (60.0, math.radians(0.06)), 30.0, 0.9, 10.0, 0.05
BIASES = {"range": 100.0, "azimuth": math.radians(0.1), "gain": 5e-4}
"""Standard deviations from which each radar's are drawn: metres, radians, metres per metre."""
DURATION, AIRCRAFT, SEEDS = 150.0, 40, 3


class Traffic(NamedTuple):
    """Flights in a frame on the earth."""

    origin: Origin
    paths: list[Path]


def recorded(file: str, duration: float) -> Traffic:
    """The flights of a recording, second by second."""
    # the scenario's own radar sees nothing
    silent = {"radars": 1, "detection_probability": 1e-6, "false_alarms": 1e-9, "interval": 1.0}
    scene = simulate("from-tracks", 0, file=file, scans=int(duration), **silent)
    number = np.repeat(np.arange(scene.num_scans), [len(ids) for ids in scene.truth.target_ids])
    ids, positions = np.concatenate(scene.truth.target_ids), np.concatenate(scene.truth.positions)
    paths = []
    for target in np.unique(ids).tolist():
        rows = np.flatnonzero(ids == target)
        for part in np.split(rows, np.flatnonzero(np.diff(number[rows]) > 1) + 1):
            if len(part) > 1:
                times = scene.times[number[part]] - scene.times[0]
                paths.append(Path(target, times, positions[part], np.gradient(positions[part], times, axis=0)))
    return Traffic(scene.origin, paths)


def simulated(seed: int, duration: float) -> Traffic:
    """Airliners over a plain at 47 degrees north."""
    rng = np.random.default_rng(seed)
    paths = [Path(k, *random_flight(rng, 0.0, 150e3, duration).path(duration)) for k in range(AIRCRAFT)]
    return Traffic((math.radians(47.0), math.radians(8.0), 0.0), paths)


class Observed(NamedTuple):
    """Plots of all radars as one scene."""

    scene: Scene
    identities: list[tuple[Array, ...]]
    sources: list[list[Array]]
    """By scan and sensor: the path of each plot, -1 of false ones."""
    exact: Scene
    """The scene without the radars' errors: with their noise alone."""


def observed(traffic: Traffic, primary: float, duration: float, seed: int) -> Observed:
    """Let the radars turn; `primary` is the share of aircraft without a transponder."""
    rng = np.random.default_rng([seed, 7])
    aircraft = np.unique([path.target for path in traffic.paths])
    silent = set(rng.permutation(aircraft)[: round(primary * len(aircraft))].tolist())
    codes = rng.choice(np.arange(1, 4096), aircraft.max() + 1, replace=False)
    latitude, longitude, _ = geodetic(on_circle(np.zeros(3), SPREAD, len(TURNS)) * [1, 1, 0], traffic.origin).T
    recordings, radars, wrong = [], [], []
    for s, turn in enumerate(TURNS):
        place = float(latitude[s]), float(longitude[s]), 0.0
        wrong.append({name: float(rng.normal(0.0, sigma)) for name, sigma in BIASES.items()})
        plots = _plots(traffic, place, turn, wrong[-1], silent, codes, duration, rng)
        radar = radar_of(
            plots, name=f"radar {s + 1}", range_noise=NOISE[0], azimuth_noise=NOISE[1],
            detection_probability=DETECTION, false_alarm_rate=FALSE_PLOTS,
        )  # fmt: skip
        heights = HEIGHT_NOISE if np.isfinite(plots.trusted_altitudes).any() else None
        own = placed(plots, radar, place, traffic.origin, heights)
        recordings.append(own[0])
        radars.append(own[1])
    scene = scene_of_radars(recordings, radars, rotations=TURNS, origin=traffic.origin)
    sources: list[list[Array]] = [[] for _ in scene.times]
    parts = parts_of_radars(recordings, radars)
    for part in parts:
        cut = np.searchsorted(part.recording.times, scene.times[:-1], side="right")
        for own_sources, rows in zip(sources, np.split(part.recording.sources, cut), strict=True):
            own_sources.append(rows)
    exact = with_biases(scene, [{name: -value for name, value in wrong[part.number].items()} for part in parts])
    return Observed(scene, identities_of_radars(recordings, radars, scene.times), sources, exact)


def _plots(
    traffic: Traffic, place: Origin, turn: float, wrong: dict[str, float], silent: set[int], codes: Array,
    duration: float, rng: np.random.Generator,
) -> Recording:  # fmt: skip
    """A radar's plots with its errors: times, ranges, bearings, codes, altitudes, addresses, and whose they are."""
    ahead, rows = rng.uniform(0.0, turn), []
    for number, path in enumerate(traffic.paths):
        where = geodetic(path.positions, traffic.origin)
        local = east_north_up(*where.T, place)
        when = dwells(path.times + ahead, local, turn) - ahead
        when = when[(when >= path.times[0]) & (when <= path.times[-1]) & (rng.random(len(when)) < DETECTION)]
        there = np.column_stack([np.interp(when, path.times, axis) for axis in local.T])
        distance, bearing = slant_range_and_bearing(there)
        heard = np.full(len(when), path.target not in silent)
        level = np.round(np.interp(when, path.times, where[:, 2]) / FLIGHT_LEVEL) * FLIGHT_LEVEL
        known = [heard & (rng.random(len(when)) > LOST) for _ in range(2)]
        address = np.where(heard, 0x400000 + path.target, 0)
        code, height = np.where(known[0], codes[path.target], 0), np.where(known[1], level, np.nan)
        rows.append(np.column_stack([when, distance, bearing, code, height, address, np.full(len(when), number)]))
    count = int(rng.poisson(FALSE_PLOTS * duration / turn))
    when, nothing = rng.uniform(0.0, duration, count), np.zeros(count)
    bearing = 2.0 * math.pi * (when + ahead) / turn
    far = rng.uniform(0.0, REACH, count)
    rows.append(np.column_stack([when, far, bearing, nothing, nothing + np.nan, nothing, nothing - 1]))
    table = np.concatenate(rows)
    table = table[(table[:, 1] < REACH) & (table[:, 0] < duration)]
    times, distance, bearing, code, height, address, source = table[np.argsort(table[:, 0])].T
    distance = distance + rng.normal(0.0, NOISE[0], len(distance))
    return Recording(
        times,
        np.abs(distance * (1.0 + wrong["gain"]) + wrong["range"]),
        math.pi / 2 - bearing + rng.normal(0.0, NOISE[1], len(times)) + wrong["azimuth"],
        code.astype(np.int64),
        height,
        addresses=address.astype(np.int64),
        sources=source.astype(np.int64),
    )


def plot_errors(observed: Observed, scene: Scene, traffic: Traffic) -> Array:
    """Horizontal RMSE (S,) of each radar's plots of aircraft, metres."""
    squared: dict[str, list[Array]] = {}
    for k, scan in enumerate(scene.measurements):
        for s, sensor in enumerate(scene.sensors):
            whose, z, when = observed.sources[k][s], scan[s], scene.measurement_times[k][s]
            for number in np.unique(whose[whose >= 0]).tolist():
                mine = whose == number
                there = traffic.paths[number].at(when[mine])[0]
                exact = sensor.measure(there)
                along = z[mine, 0] - exact[:, 0]
                # above a radar a wrong azimuth is no large error
                ground = np.hypot(*(there - sensor.position)[:, :2].T)
                across = ground * wrap_angle(z[mine, 1] - exact[:, 1])
                squared.setdefault(sensor.name.split(",")[0], []).append(along**2 + across**2)
    return np.sqrt([np.mean(np.concatenate(squared[name])) for name in sorted(squared)])


class Association(NamedTuple):
    """How plots were given to tracks, in shares of plots."""

    wrong: float
    """Of plots in tracks: of another aircraft than most of the track's, or of none."""
    mixed: float
    """Tracks with plots of two aircraft or more, in a hundred tracks."""
    left: float
    """Of the aircraft's plots: in no track."""
    tracks: float
    """Tracks for each aircraft."""


def judged(tracks: Array, sources: Array, owners: Array) -> tuple[Association, dict[int, int]]:
    """Judge the tracks (n,) of plots, 0 for none; also the path that each track followed most, -1 for none."""
    # a flight with a gap in its reports is one aircraft of several paths
    aircraft = np.where(sources >= 0, owners[sources], -1)
    wrong, mixed, leaders, numbers = 0, 0, {}, np.unique(tracks[tracks > 0]).tolist()
    for number in numbers:
        mine = aircraft[tracks == number]
        names, counts = np.unique(mine[mine >= 0], return_counts=True)
        leaders[number] = int(names[counts.argmax()]) if len(names) else -1
        wrong += len(mine) - int(counts.max(initial=0))
        mixed += len(names) > 1
    real = aircraft >= 0
    return Association(
        100.0 * wrong / max(np.count_nonzero(tracks), 1), 100.0 * mixed / max(len(numbers), 1),
        100.0 * float((tracks[real] == 0).mean()), len(numbers) / len(np.unique(aircraft[real])),
    ), leaders  # fmt: skip


class Tracked(NamedTuple):
    """What the tracker made of a scene."""

    taken: Array
    """Track of each plot (n,), 0 for none, in the order of scans and sensors."""
    shown: TrackTable
    """Tracks as they were shown at each scan."""
    finished: TrackTable
    """The same, smoothed."""


def tracked(seen: Observed, scene: Scene) -> Tracked:
    """Track and smooth; codes and addresses only name the tracks."""
    tracker = TRACKERS["multi-sensor"].for_scene(scene, adapt=True)
    shown, decisions = track_scene(tracker, scene, identities=seen.identities)
    decisions = sorted(decisions, key=lambda decision: decision.scan)
    taken = np.concatenate([ids for decision in decisions for ids in decision.assigned])
    sure = np.concatenate([flags for decision in decisions for flags in decision.confirmed])
    confirmed = np.isin(taken, taken[sure]) & (taken > 0)
    return Tracked(np.where(confirmed, taken, 0), shown, smoothed(tracker, scene, decisions))


def track_errors(table: TrackTable, leaders: dict[int, int], traffic: Traffic) -> tuple[float, float]:
    """Horizontal RMSE of tracks, metres, and their squared errors in squared standard deviations, mean by axis."""
    frame, errors, scaled = table.to_frame(), [], []
    for number, rows in frame.groupby("track_id"):
        for path in traffic.paths:
            if path.target == leaders.get(int(number), -1):
                own = rows[(rows["time"] >= path.times[0]) & (rows["time"] <= path.times[-1])]
                off = own[["x", "y"]].to_numpy() - path.at(own["time"].to_numpy())[0][:, :2]
                errors.append((off**2).sum(axis=1))
                scaled.append((off / own[["sigma_x", "sigma_y"]].to_numpy()) ** 2)
    return float(np.sqrt(np.concatenate(errors).mean())), float(np.concatenate(scaled).mean())


def row(traffic: Traffic, primary: float, duration: float, seed: int) -> dict[str, float]:
    """All figures of one scene."""
    seen = observed(traffic, primary, duration, seed)
    sources = np.concatenate([whose for scan in seen.sources for whose in scan])
    owners = np.array([path.target for path in traffic.paths])
    registered = register(seen.scene, components=("range", "azimuth", "gain")).correct(seen.scene)
    found = {"plots as they come: RMSE": _rms(plot_errors(seen, seen.scene, traffic))}
    found["plots, registered: RMSE"] = _rms(plot_errors(seen, registered, traffic))
    found["plots, noise alone: RMSE"] = _rms(plot_errors(seen, seen.exact, traffic))
    for label, scene in (("as they come", seen.scene), ("registered", registered)):
        done = tracked(seen, scene)
        own, leaders = judged(done.taken, sources, owners)
        found[f"reference, {label}: RMSE"], scaled = track_errors(done.finished, leaders, traffic)
    found["reference, registered: squared error / stated"] = scaled
    found["tracks as shown, registered: RMSE"], _ = track_errors(done.shown, leaders, traffic)
    found |= {f"assoc: {what}": value for what, value in zip(WHAT, own, strict=True)}
    return found


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))


WHAT = ("wrong plots", "mixed tracks", "plots of aircraft left out", "tracks of an aircraft")
UNITS = dict(zip(WHAT, ("%", "%", "%", ""), strict=True)) | {"RMSE": "m"}


def experiment(chosen: Namespace) -> list[Claim]:
    """All shares of aircraft without a transponder, on simulated flights and on those of a file."""
    claims: list[Claim] = []
    duration = 40.0 if chosen.quick else DURATION
    for kind in chosen.names if chosen.file else ["simulated"]:
        for primary in SHARES[1:2] if chosen.quick else SHARES:
            rows = []
            for k in range(chosen.seed, chosen.seed + (1 if chosen.quick else chosen.seeds)):
                traffic = simulated(k, duration) if kind == "simulated" else recorded(chosen.file, duration)
                rows.append(row(traffic, primary, duration, k))
                shown = {name: round(float(value), 2) for name, value in rows[-1].items()}
                print(f"{kind}, {primary:.0%}: {shown}", flush=True)
            for name in rows[0]:
                unit = UNITS.get(name.split(": ")[1], "")
                values = np.array([row[name] for row in rows])
                claims.append(mean_claim(f"{kind} flights, {primary:.0%} primary only, {name}", unit, values))
    return claims


def _add_file(parser: ArgumentParser) -> None:
    text = "recorded trajectories (.csv, .parquet)"
    parser.add_argument("file", nargs="?", type=_file, metavar="FILE", help=text)


def _file(text: str) -> str:
    if not File(text).is_file():
        raise ArgumentTypeError(f"{text}: expected a file of recorded trajectories")
    return text


if __name__ == "__main__":
    raise SystemExit(main(
        "real.air_traffic", experiment, __doc__, options=[_add_file], only=("simulated", "recorded"),
        seeds=(SEEDS, "scenes: flights if simulated, noise, errors, aircraft without a transponder", 1),
        said=f" {{seeds}} scenes of {DURATION:g} s each.",
    ))  # fmt: skip

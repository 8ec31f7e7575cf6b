"""Three radars in Stone Soup: our fusion before its tracker, compared with its global nearest neighbour alone.

    python -m experiments.trackers.fusion_in_stone_soup [--quick] [--seed N] [--json FILE] [--figure FILE]
                                                           [--publish]
    python -m experiments.trackers.fusion_in_stone_soup --tune

Ground truth, radars (15 mrad, 30 m, P_d 0.9), clutter (8 false alarms a scan), predictors, updaters, initiator,
deleter, tracker and the GOSPA metric (order 2, cutoff 500 m) are Stone Soup's. In the usual way its tracker takes the
three radars' detections one set after the other. With our feeder in front it takes one set of fused detections. The
settings of each way (points until a track counts, largest Mahalanobis distance) are those that did best for it on
other seeds.
"""

import time
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from itertools import product
from typing import Any

import numpy as np
from stonesoup.base import Property
from stonesoup.dataassociator.base import DataAssociator
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
from stonesoup.deleter.time import UpdateTimeStepsDeleter
from stonesoup.hypothesiser.distance import DistanceHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.measures import Euclidean, Mahalanobis
from stonesoup.metricgenerator.manager import MultiManager
from stonesoup.metricgenerator.ospametric import GOSPAMetric
from stonesoup.models.clutter import ClutterModel
from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
from stonesoup.platform.base import FixedPlatform
from stonesoup.predictor.kalman import ExtendedKalmanPredictor
from stonesoup.sensor.radar import RadarBearingRange
from stonesoup.simulator.platform import PlatformDetectionSimulator
from stonesoup.simulator.simple import MultiTargetGroundTruthSimulator
from stonesoup.tracker.simple import MultiTargetTracker
from stonesoup.types.array import StateVector
from stonesoup.types.state import GaussianState
from stonesoup.updater.kalman import ExtendedKalmanUpdater

from assoc._types import Array
from assoc.integrations.stonesoup import AssignmentAssociator, FusionFeeder, adapt
from assoc.simulation.radars import azimuth_interval, on_circle, padded, padded_azimuth, range_interval
from experiments.common.claims import Claim
from experiments.common.command import make_parser, mean_interval, run

Stream = list[tuple[datetime, set[Any]]]

START = datetime(2026, 1, 1)
REGION = np.array([[-5e3, 5e3], [-5e3, 5e3], [0.0, 0.0]])
INTERVAL, P_D = 2.0, 0.9
RANGE_NOISE, BEARING_NOISE = 30.0, 0.015
POSITION, PROCESS = (0, 2), (1.0, 1.0)
CUTOFF = 500.0
PLACES = on_circle(np.zeros(3), 15e3, 3)
VIEWS = [
    (
        padded(range_interval(place, REGION), RANGE_NOISE, 0.0, np.inf),
        padded_azimuth(azimuth_interval(place, REGION), BEARING_NOISE),
    )
    for place in PLACES
]
PARTS = ("distance", "localisation", "missed", "false")


@dataclass(frozen=True)
class Size:
    """Of a scene."""

    targets: int = 10
    scans: int = 30
    clutter: float = 8.0
    """False alarms a scan."""
    settled: int = 9
    """Scans until tracks count, whatever the way."""


USUAL = Size()


class MissingRadar(RadarBearingRange):
    """Stone Soup's radar sees all within its range; this one misses some."""

    probability: float = Property(default=P_D, doc="Detection probability.")

    def is_detectable(self, state: Any, measurement_model: Any = None) -> bool:
        """Draw whether a target is seen."""
        return bool(self.random_state.rand() < self.probability) and super().is_detectable(state, measurement_model)


@dataclass(frozen=True)
class Way:
    """How detections become tracks."""

    name: str
    fused: bool
    associator: type[DataAssociator]
    points: int
    distance: float
    patience: int


WAYS = (
    Way("GNN, radar after radar", False, GNNWith2DAssignment, 7, 3.0, 3),
    Way("S-D fusion, GNN", True, GNNWith2DAssignment, 4, 3.0, 3),
    Way("S-D fusion, our associator", True, AssignmentAssociator, 4, 3.0, 3),
)


def simulate(seed: int, size: Size = USUAL) -> tuple[Stream, set[Any], list[MissingRadar]]:
    """Run Stone Soup's simulators once: detections by time and radar, truth paths, radars."""
    seeds = np.random.default_rng(seed).integers(2**31, size=8).tolist()
    motion = CombinedLinearGaussianTransitionModel([ConstantVelocity(q) for q in PROCESS], seed=seeds[0])
    spread = np.diag([2e3, 60.0, 2e3, 60.0]) ** 2
    truth = MultiTargetGroundTruthSimulator(
        transition_model=motion,
        initial_state=GaussianState(StateVector(np.zeros(4)), spread, timestamp=START),
        timestep=timedelta(seconds=INTERVAL),
        number_steps=size.scans,
        birth_rate=0.0,
        death_probability=0.0,
        seed=seeds[3],
        initial_number_targets=size.targets,
    )
    radars, platforms = [], []
    for place, number in zip(PLACES, seeds[4:], strict=False):
        noise = np.random.RandomState(number)
        radar = MissingRadar(
            position_mapping=POSITION,
            ndim_state=4,
            noise_covar=np.diag([BEARING_NOISE, RANGE_NOISE]) ** 2,
            max_range=100e3,
            seed=number,
            clutter_model=ClutterModel(size.clutter, noise.uniform, tuple(map(tuple, REGION[:2])), seed=noise),
        )
        at = GaussianState(StateVector([place[0], 0, place[1], 0]), np.eye(4), timestamp=START)
        platforms.append(FixedPlatform(states=at, position_mapping=POSITION, sensors=[radar]))
        radars.append(radar)
    simulator = PlatformDetectionSimulator(truth, platforms, platforms_detectable=False)
    stream = [(moment, set(found)) for moment, found in simulator]
    return stream, set(truth.groundtruth_paths), radars


def detector(way: Way, stream: Stream, radars: list[MissingRadar]) -> Any:
    """What the tracker reads: the stream as it is, or our feeder in front of it."""
    if not way.fused:
        return stream
    sensors = [
        adapt(radar, detection_probability=P_D, field_of_view=view) for radar, view in zip(radars, VIEWS, strict=True)
    ]
    return FusionFeeder(stream, sensors, region=REGION)


def track(way: Way, stream: Stream, radars: list[MissingRadar]) -> tuple[set[Any], float]:
    """Run Stone Soup's tracker: all tracks there ever were, and the processor time it took, seconds."""
    predictor = ExtendedKalmanPredictor(CombinedLinearGaussianTransitionModel([ConstantVelocity(q) for q in PROCESS]))
    updater = ExtendedKalmanUpdater()
    associator = way.associator(DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=way.distance))
    deleter = UpdateTimeStepsDeleter(way.patience)
    prior = GaussianState(StateVector(np.zeros(4)), np.diag([0.0, 100.0, 0.0, 100.0]) ** 2, timestamp=START)
    tracker = MultiTargetTracker(
        initiator=MultiMeasurementInitiator(prior, deleter, associator, updater, min_points=way.points),
        deleter=deleter,
        detector=detector(way, stream, radars),
        data_associator=associator,
        updater=updater,
    )
    began = time.process_time()
    tracks: set[Any] = set()
    for _, present in tracker:
        tracks |= present
    return tracks, time.process_time() - began


def gospa(tracks: set[Any], paths: set[Any]) -> Array:
    """Stone Soup's GOSPA (p 2) of each scan and its three parts, metres (K, 4)."""
    generator = GOSPAMetric(p=2, c=CUTOFF, measure=Euclidean(POSITION))
    manager = MultiManager([generator])
    manager.add_data({"tracks": tracks, "groundtruth_paths": paths})
    metric = manager.generate_metrics()["gospa_generator"]["GOSPA Metrics"]
    rows = np.array([[value.value[part] for part in PARTS] for value in metric.value], dtype=float)
    rows[:, 1:] = np.sqrt(rows[:, 1:])  # the parts are sums of squares
    return rows


GRID = {"points": {False: (5, 7, 10), True: (2, 3, 4)}, "distance": (3.0, 4.0), "patience": (1, 3)}
TUNING_SEEDS = (9001, 9002)


def tune() -> None:
    """Print the mean GOSPA of the settings tried for each way, on seeds that the comparison does not use."""
    scenes = [simulate(seed) for seed in TUNING_SEEDS]
    for way in (WAYS[2], WAYS[0]):
        for points, distance, patience in product(GRID["points"][way.fused], GRID["distance"], GRID["patience"]):
            tried = replace(way, points=points, distance=distance, patience=patience)
            mean = np.mean([gospa(track(tried, stream, radars)[0], paths)[:, 0] for stream, paths, radars in scenes])
            print(f"{way.name}: {points} points, distance {distance:g}, {patience} scans: {mean:.1f} m", flush=True)


def compare(seeds: list[int], size: Size = USUAL) -> tuple[Array, Array]:
    """GOSPA (way, seed, scan, part) and processor time in seconds (way, seed)."""
    values, seconds = [], []
    for seed in seeds:
        stream, paths, radars = simulate(seed, size)
        runs = [track(way, stream, radars) for way in WAYS]
        values.append([gospa(tracks, paths) for tracks, _ in runs])
        seconds.append([took for _, took in runs])
    return np.array(values).swapaxes(0, 1), np.array(seconds).T


def experiment(quick: bool, rng: np.random.Generator, size: Size = USUAL) -> tuple[list[Claim], Any]:
    """Compare the ways on the same scenes."""
    seeds = rng.integers(2**31, size=2 if quick else 10).tolist()
    values, seconds = compare(seeds, size)
    claims = []
    for way, mine in zip(WAYS, values, strict=True):
        for p, part in enumerate(PARTS):
            by_seed = mine[:, :, p].mean(axis=1)
            name = "GOSPA" if part == "distance" else f"GOSPA, {part}"
            claims.append(Claim(f"{way.name}: {name}", "m", None, by_seed.mean(), mean_interval(by_seed)))
    # first over all scans, then from when tracks count
    later = f"GOSPA from {size.settled * INTERVAL:g} s on"
    for first, words, band in ((0, "GOSPA", (None, 0.0)), (size.settled, later, None)):
        mean = values[:, :, first:, 0].mean(axis=2)
        for way, mine in zip(WAYS[1:], mean[1:], strict=True):
            gain = mine - mean[0]
            what, source = f"{way.name} less {WAYS[0].name}: {words}", "chosen by us" if band else ""
            claims.append(Claim(what, "m", None, gain.mean(), mean_interval(gain), band, source=source))
    for way, took in zip(WAYS, seconds, strict=True):
        claims.append(Claim(f"{way.name}: time of a scan", "ms", None, 1e3 * float(np.median(took)) / size.scans))
    for way, took in zip(WAYS[1:], seconds[1:], strict=True):
        claims.append(Claim(f"{WAYS[0].name} / {way.name}: time", "", None, float(np.median(seconds[0] / took))))
    return claims, (values[:, :, :, 0], simulate(seeds[0], size))


def draw(figure: Any, shown: Any) -> None:
    """Draw the first scene with its last way's tracks, and GOSPA over time."""
    gospas, (stream, paths, radars) = shown
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.2))
    fused = detector(WAYS[2], stream, radars)
    spots = [np.asarray(d.state_vector, dtype=float).ravel() for _, found in fused for d in found]
    inverse = [np.asarray(d.measurement_model.inverse_function(d), float).ravel() for _, found in stream for d in found]
    for rows, columns, style, label in (
        (inverse, POSITION, {"s": 2, "color": "0.75"}, "detections of three radars"),
        (spots, (0, 1), {"s": 14, "facecolors": "none", "edgecolors": "#0072b2", "linewidths": 0.8}, "fused"),
    ):
        points = np.array(rows)[:, list(columns)] / 1e3
        left.scatter(points[:, 0], points[:, 1], label=label, **style)
    for i, path in enumerate(paths):
        line = np.array([np.asarray(s.state_vector, float).ravel()[list(POSITION)] for s in path]) / 1e3
        left.plot(line[:, 0], line[:, 1], color="black", linewidth=1.2, label="truth" if i == 0 else None)
    left.set(xlabel="x (km)", ylabel="y (km)", xlim=(-6, 6), ylim=(-6, 6), aspect="equal", title="one scene")
    left.legend(fontsize=8, loc="lower left")
    times = INTERVAL * np.arange(gospas.shape[-1])
    for way, mine, style in zip(WAYS, gospas, ("o-", "s-", "x--"), strict=True):
        right.plot(times, mine.mean(axis=0), style, markersize=4, label=way.name)
        right.fill_between(times, *np.transpose([mean_interval(scan) for scan in mine.T]), alpha=0.2)
    right.set(xlabel="time (s)", ylabel="GOSPA (m)", ylim=(0, None), title=f"mean of {gospas.shape[1]} scenes, 95 %")
    right.legend(fontsize=8)


NAME = "trackers.fusion_in_stone_soup"


def program(arguments: list[str] | None = None) -> int:
    """Run the experiment; returns its exit code."""
    figure = draw, (11, 4.6)
    parser = make_parser(NAME, __doc__, figure)
    parser.add_argument("--tune", action="store_true", help="only try the settings of each way on two other scenes")
    chosen = parser.parse_args(arguments)
    if chosen.tune:
        tune()
        return 0
    return run(parser, chosen, experiment, __doc__, figure)


if __name__ == "__main__":
    raise SystemExit(program())

"""Sensors as they are: trackers where views are limited, parameters wrong, or targets and clutter not as declared.

    python -m experiments.trackers.as_they_are [--seeds N] [--rows NAME,...] [--trackers NAME,...] [--quick] [--seed N]
                                               [--json FILE] [--publish]

Twelve targets, 40 scans of 4 s, three 3-D radars, default settings unless a row says otherwise. Each row runs through
the trackers, and through an oracle that is told which measurement is whose (same filter). GOSPA with a cutoff of 500 m
and its 95 % interval; false tracks and missed targets at an instant; identity switches and ids of reported tracks in a
scene.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from assoc._types import Array
from assoc.filters import ConstantVelocity, ExtendedKalmanFilter
from assoc.metrics import Trajectories, gospa_over_time, identity
from assoc.scene import Scene, Truth
from assoc.sensors import PositionSensor, Radar2D, Sensor
from assoc.simulation.observation import observe
from assoc.simulation.radars import on_circle, radar_over
from assoc.tracking import TRACKERS, Initiation
from assoc.tracking.filter_choice import make_filter
from experiments.common.claims import Claim
from experiments.common.command import make_parser, run, whole
from experiments.trackers.close_scenes import REGION, SETTINGS, Setting, radars, simulate
from experiments.trackers.judging import CUTOFF, mean_claim
from experiments.trackers.oracle import OracleTracker
from experiments.trackers.running import through
from experiments.trackers.sites import Sites

TARGETS, SCANS, INTERVAL = 12, 40, 4.0


class Case(NamedTuple):
    """One seed of a row.

    declared: Its measurements and the sensors that trackers are told of.
    known: The same with sensors as they are; left out where there is nothing to be known.
    options: Of every tracker and the oracle.
    level: Whether tracks are judged by their horizontal places alone.
    """

    declared: Scene
    known: Scene | None = None
    options: Mapping[str, Any] = {}
    level: bool = False


Row = Callable[[int], Case]


def short_radars(seed: int, detection_probability: float = 0.9) -> Case:
    """Six radars that reach 17 km each; all know it."""
    sensors = [_short(one, 17e3, detection_probability) for one in on_circle(np.zeros(3), 16e3, 6)]
    return Case(simulate(SETTINGS["separate"], seed, sensors=sensors))


def _short(place: Array, reach: float, detection_probability: float) -> Sensor:
    full = radar_over(
        REGION, place, range_noise=50.0, angle_noise=1e-3, detection_probability=detection_probability,
        false_alarm_rate=10.0, name=f"radar at {place[0] / 1e3:.0f}, {place[1] / 1e3:.0f} km",
    )  # fmt: skip
    return replace(full, field_of_view=np.concatenate([[[0.0, reach]], full.field_of_view[1:]]))


def dark_band(seed: int) -> Case:
    """Nothing is detected within 2 km of the plane x = 0, and nobody knows."""
    scene = simulate(SETTINGS["separate"], seed)
    assert scene.truth is not None
    hidden = [
        ids[np.abs(at[:, 0]) < 2e3] for ids, at in zip(scene.truth.target_ids, scene.truth.positions, strict=True)
    ]
    return Case(_without(scene, hidden))


def _without(scene: Scene, hidden: Sequence[Array]) -> Scene:
    """The scene without measurements of these targets, scan by scan."""
    assert scene.truth is not None and scene.truth.sources is not None
    kept = [[~np.isin(one, gone) for one in scan] for scan, gone in zip(scene.truth.sources, hidden, strict=True)]

    def left(arrays: Any) -> list[list[Array]]:
        return [[a[k] for a, k in zip(scan, keep, strict=True)] for scan, keep in zip(arrays, kept, strict=True)]

    truth = Truth(scene.truth.target_ids, scene.truth.positions, left(scene.truth.sources))
    return Scene(scene.sensors, scene.times, left(scene.measurements), scene.region, truth)


def splitting(seed: int) -> Case:
    """Six targets; a second one leaves each at half time, at 5 to 15 m/s."""
    rng = np.random.default_rng(seed)
    half, count, times = SCANS // 2, TARGETS // 2, INTERVAL * np.arange(SCANS)
    heading, speed = rng.uniform(-np.pi, np.pi, count), rng.uniform(150.0, 230.0, count)
    ahead = np.stack([np.cos(heading), np.sin(heading), np.zeros(count)], axis=1)
    aside = np.stack([-np.sin(heading), np.cos(heading), np.zeros(count)], axis=1)
    middle = rng.uniform([-12e3, -12e3, 4e3], [12e3, 12e3, 10e3], (count, 3))
    after = (times - times[half])[:, None, None]
    parents = middle + after * speed[:, None] * ahead
    parted = parents + np.maximum(after, 0.0) * rng.uniform(5.0, 15.0, (count, 1)) * aside
    ids = [np.arange(count if k <= half else TARGETS) for k in range(SCANS)]
    paths = [np.concatenate([parents[k], parted[k]])[: len(ids[k])] for k in range(SCANS)]
    return Case(observe(radars(SETTINGS["separate"]), times, ids, paths, rng, region=REGION))


def wind_farm(seed: int) -> Case:
    """Each radar has ten returns a scan from a patch of 3 x 3 km, 200 m high."""
    rng, scene = np.random.default_rng([seed, 1]), simulate(SETTINGS["separate"], seed)
    assert scene.truth is not None and scene.truth.sources is not None
    low = np.append(rng.uniform(-15e3, 12e3, 2), 0.0)
    measurements, sources = [], []
    for scan, source in zip(scene.measurements, scene.truth.sources, strict=True):
        more = [
            sensor.measure(rng.uniform(low, low + [3e3, 3e3, 200.0], (10, 3)))
            + rng.standard_normal((10, sensor.dim)) @ np.linalg.cholesky(sensor.covariance).T
            for sensor in scene.sensors
        ]
        measurements.append([np.concatenate(both) for both in zip(scan, more, strict=True)])
        sources.append([np.append(one, np.full(10, -1)) for one in source])
    truth = Truth(scene.truth.target_ids, scene.truth.positions, sources)
    return Case(Scene(scene.sensors, scene.times, measurements, scene.region, truth))


def ships(seed: int, reports: bool = True) -> Case:
    """Ships seen by a radar; with `reports`, each tells its position every 10 s, as a sensor that never looks."""
    rng, region = np.random.default_rng(seed), np.array([[-10e3, 10e3], [-10e3, 10e3], [0.0, 1.0]])
    times = INTERVAL * np.arange(SCANS)
    heading, speed = rng.uniform(-np.pi, np.pi, TARGETS), rng.uniform(3.0, 10.0, TARGETS)
    velocity = np.stack([speed * np.cos(heading), speed * np.sin(heading), np.zeros(TARGETS)], axis=1)
    middle = np.append(rng.uniform(-8e3, 8e3, (TARGETS, 2)), np.zeros((TARGETS, 1)), axis=1)
    paths = middle + (times - times.mean())[:, None, None] * velocity
    view = np.array([[0.0, 15e3], [-np.pi, np.pi]])
    radar = Radar2D(
        position=np.zeros(3), noise=np.array([50.0, 5e-3]), detection_probability=0.9, false_alarm_rate=10.0,
        field_of_view=view, name="radar",
    )  # fmt: skip
    ais = PositionSensor(
        position=np.zeros(3), noise=np.array([10.0, 10.0]), detection_probability=0.9, false_alarm_rate=0.1,
        field_of_view=region[:2], name="AIS",
    )  # fmt: skip
    ids = [np.arange(TARGETS)] * SCANS
    sensors: list[Sensor] = [radar, ais] if reports else [radar]
    scene = observe(sensors, times, ids, list(paths), rng, region=region)
    filter = ExtendedKalmanFilter(ConstantVelocity(0.1, dimensions=2, kind="continuous"))
    options = {"filter": filter, "initiation": Initiation(speed=8.0)}
    if not reports:
        return Case(scene, options=options)
    phase = rng.uniform(0.0, 10.0, TARGETS)
    turn = np.floor((times[:, None] + phase) / 10.0)
    due = np.diff(turn, axis=0, prepend=turn[:1] - (phase < INTERVAL)) > 0
    scene = _at_times(scene, 1, due)
    everywhere, nowhere = (-np.pi, np.pi), (0.0, 0.0)
    sectors = np.array([[everywhere, nowhere]] * SCANS)
    return Case(replace(scene, sectors=sectors), options=options)


def _at_times(scene: Scene, s: int, due: Array) -> Scene:
    """The scene in which sensor `s` has measurements of a target only when they are due, bool (K, T)."""
    assert scene.truth is not None and scene.truth.sources is not None
    measurements = [list(scan) for scan in scene.measurements]
    sources = [list(scan) for scan in scene.truth.sources]
    for k, row in enumerate(due):
        kept = np.append(row, True)[sources[k][s]]
        measurements[k][s], sources[k][s] = measurements[k][s][kept], sources[k][s][kept]
    truth = Truth(scene.truth.target_ids, scene.truth.positions, sources)
    return Scene(scene.sensors, scene.times, measurements, scene.region, truth)


def misdeclared(declared: Setting, true: Setting) -> Row:
    """Scenes of true sensors, of which trackers are told something else."""

    def row(seed: int) -> Case:
        known = simulate(true, seed)
        return Case(replace(known, sensors=radars(declared)), known)

    return row


def agile(seed: int) -> Case:
    """Targets of 250 m/s that now and then turn with 8 g for 2 to 6 s."""
    rng, fine, turn = np.random.default_rng(seed), 0.1, 8 * 9.81 / 250.0
    steps = round(SCANS * INTERVAL / fine)
    rate = np.zeros((steps, TARGETS))
    for target in range(TARGETS):
        k = 0
        while k < steps:
            k += round(rng.uniform(8.0, 30.0) / fine)
            length = round(rng.uniform(2.0, 6.0) / fine)
            rate[k : k + length, target] = turn * rng.choice([-1.0, 1.0])
            k += length
    heading = rng.uniform(-np.pi, np.pi, TARGETS) + np.cumsum(rate, axis=0) * fine
    velocity = 250.0 * np.stack([np.cos(heading), np.sin(heading), np.zeros_like(heading)], axis=-1)
    path = np.cumsum(velocity, axis=0) * fine
    middle = rng.uniform([-12e3, -12e3, 0.0], [12e3, 12e3, 1.0], (TARGETS, 3))
    middle[:, 2] = rng.permutation(np.linspace(1e3, 11e3, TARGETS))
    path = (path - path.mean(axis=0) + middle)[:: round(INTERVAL / fine)]
    times, ids = INTERVAL * np.arange(SCANS), [np.arange(TARGETS)] * SCANS
    return Case(observe(radars(SETTINGS["separate"]), times, ids, list(path), rng, region=REGION))


def one_planar(seed: int) -> Case:
    """One radar without heights, 100 false alarms a scan."""
    scene = simulate(Setting("separate", noise=(80.0,), false_alarms=100.0), seed)
    assert scene.truth is not None
    full, rng = scene.sensors[0], np.random.default_rng([seed, 1])
    radar = Radar2D(
        position=full.position, noise=full.noise[:2], detection_probability=0.9, false_alarm_rate=100.0,
        field_of_view=full.field_of_view[:2], name="radar",
    )  # fmt: skip
    truth = scene.truth
    return Case(observe([radar], scene.times, truth.target_ids, truth.positions, rng, region=scene.region), level=True)


def flat_radars(seed: int, height: float | None = None) -> Case:
    """Three radars without elevations, and the filter of the programs; with a height, all targets fly there."""
    sensors: list[Sensor] = [
        Radar2D(
            position=one.position, noise=one.covariance[:2, :2], detection_probability=one.detection_probability,
            false_alarm_rate=one.false_alarm_rate, field_of_view=one.field_of_view[:2], name=one.name,
        )
        for one in radars(SETTINGS["separate"])
    ]  # fmt: skip
    scene = simulate(SETTINGS["separate"], seed, sensors=sensors)
    assert scene.truth is not None
    if height is not None:
        paths = [np.column_stack([at[:, :2], np.full(len(at), height)]) for at in scene.truth.positions]
        rng = np.random.default_rng(seed)
        scene = observe(sensors, scene.times, scene.truth.target_ids, paths, rng, region=REGION)
    filter = make_filter("imm-cv", sensors, pace=INTERVAL, region=REGION)
    return Case(scene, options={"filter": filter}, level=True)


def abreast(seed: int, gap: float) -> Case:
    """Two targets side by side for the whole time."""
    rng, times = np.random.default_rng(seed), INTERVAL * np.arange(SCANS)
    heading = rng.uniform(-np.pi, np.pi)
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    side = np.array([[-0.5], [0.5]]) * gap * np.array([-ahead[1], ahead[0], 0.0])
    paths = [0.0, 0.0, 6e3] + side + (200.0 * (times - times.mean()))[:, None, None] * ahead
    return Case(observe(radars(SETTINGS["separate"]), times, [np.arange(2)] * SCANS, list(paths), rng, region=REGION))


SEPARATE, NOISY = SETTINGS["separate"], (160.0, 160.0, 160.0)

ROWS: dict[str, Row] = {
    "full views": lambda seed: Case(simulate(SETTINGS["separate"], seed)),
    "six radars of 17 km": short_radars,
    "six radars of 17 km, P_d 0.6": lambda seed: short_radars(seed, 0.6),
    "P_d 0.6": lambda seed: Case(simulate(Setting("separate", detection_probability=0.6), seed)),
    "P_d 0.6, declared 0.9": misdeclared(SEPARATE, Setting("separate", detection_probability=0.6)),
    "noise twice the declared": misdeclared(SEPARATE, Setting("separate", NOISY)),
    "noise three times the declared": misdeclared(SEPARATE, Setting("separate", (240.0, 240.0, 240.0))),
    "formations, noise twice the declared": misdeclared(SETTINGS["formations"], Setting("formations", NOISY)),
    "8 g": agile,
    "one 2-D radar, 100 false alarms": one_planar,
    "three 2-D radars": flat_radars,
    "three 2-D radars, all at 9 km": lambda seed: flat_radars(seed, 9e3),
    "formations": lambda seed: Case(simulate(SETTINGS["formations"], seed)),
    "100 m abreast": lambda seed: abreast(seed, 100.0),
    "200 m abreast": lambda seed: abreast(seed, 200.0),
    "dark band of 4 km": dark_band,
    "splitting": splitting,
    "wind farm": wind_farm,
    "ships, radar alone": lambda seed: ships(seed, reports=False),
    "ships, radar and AIS": ships,
}
ADAPTING = ", adapting"
SITES = "sites"
"""A tracker at each sensor, which sends tracks alone; see `experiments.trackers.sites`."""
NAMES = ("oracle", *TRACKERS, *(name + ADAPTING for name in TRACKERS), "GNN", SITES)


class Judged(NamedTuple):
    """A tracker's way through a scene."""

    gospa: float
    false: float
    missed: float
    switches: int
    ids: int
    gap: float
    """Of two targets: distance of the tracks over that of the targets, a mean; NaN for more targets."""


def make(name: str, scene: Scene, options: Mapping[str, Any]) -> Any:
    """Make a tracker of this name."""
    if name == "oracle":
        return OracleTracker(scene, **options)
    if name == "GNN":
        return TRACKERS["nearest-neighbour"].for_scene(scene, rule="assignment", **options)
    if name == SITES:
        return Sites(scene, **options)
    options = dict(options) | ({"adapt": True} if name.endswith(ADAPTING) else {})
    return TRACKERS[name.removesuffix(ADAPTING)].for_scene(scene, **options)


def _gap(truth: Trajectories, tracks: Trajectories) -> float:
    """See `Judged.gap`; of the second half, along the line through the targets."""
    if len(np.unique(truth.ids)) != 2:
        return float("nan")
    found = []
    for time in np.unique(truth.times)[SCANS // 2 :]:
        (a, b), places = truth.positions[truth.times == time], tracks.positions[tracks.times == time]
        near = places[np.linalg.norm(places - (a + b) / 2, axis=1) < CUTOFF]
        if len(near) == 2:
            found.append(abs((near[0] - near[1]) @ (a - b)) / ((a - b) @ (a - b)))
    return float(np.mean(found)) if found else float("nan")


def judge(name: str, scene: Scene, options: Mapping[str, Any], level: bool = False) -> Judged:
    """Run a tracker, or the oracle, over a scene."""
    truth, tracks = Trajectories.from_scene(scene), through(make(name, scene, options), scene).tracks
    if level:
        truth, tracks = (Trajectories(one.times, one.ids, one.positions * [1, 1, 0]) for one in (truth, tracks))
    values, unit = gospa_over_time(truth, tracks, CUTOFF)[1], CUTOFF**2 / 2
    return Judged(
        float(np.mean([one.distance for one in values])),
        float(np.mean([one.false for one in values])) / unit,
        float(np.mean([one.missed for one in values])) / unit,
        identity(truth, tracks, CUTOFF).switches,
        len(np.unique(tracks.ids)),
        _gap(truth, tracks),
    )


def claims_of(row: str, name: str, runs: Sequence[Judged]) -> list[Claim]:
    """What a tracker did on the scenes of a row."""
    gospa = mean_claim(f"{row}, {name}: GOSPA", "m", np.array([one.gospa for one in runs]))
    false, missed, switches, ids, gap = np.mean([one[1:] for one in runs], axis=0)
    low, high = gospa.interval or (gospa.ours, gospa.ours)
    half, label = (high - low) / 2, f"{row}, {name}"
    print(
        f"{label:48} {gospa.ours:7.1f} +- {half:5.1f} m  false {false:6.2f}  missed {missed:6.2f}  "
        f"switches {switches:5.1f}  ids {ids:5.1f}" + (f"  gap {gap:.2f}" if np.isfinite(gap) else ""), flush=True,
    )  # fmt: skip
    rest = {"false tracks": false, "missed targets": missed, "switches": switches, "ids": ids}
    rest |= {"gap of the tracks / true gap": gap} if np.isfinite(gap) else {}
    return [gospa, *(Claim(f"{label}: {what}", ours=float(value)) for what, value in rest.items())]


def experiment(rows: Sequence[str], names: Sequence[str], seeds: Sequence[int]) -> list[Claim]:
    """Run trackers over rows of the table."""
    claims = []
    for row in rows:
        cases = [ROWS[row](seed) for seed in seeds]
        for name in names:
            claims += claims_of(row, name, [judge(name, one.declared, one.options, one.level) for one in cases])
            known = [(one.known, one.options, one.level) for one in cases if one.known is not None]
            if known and name != "oracle" and not name.endswith(ADAPTING):
                claims += claims_of(row, f"{name} if known", [judge(name, *one) for one in known])
    return claims


NAME = "trackers.as_they_are"


def program(arguments: Sequence[str] | None = None) -> int:
    """Run the experiment; returns its exit code."""
    parser = make_parser(NAME, __doc__)
    parser.add_argument("--seeds", type=whole(1), default=20, metavar="N", help="scenes of each row (default 20)")
    parser.add_argument("--rows", default=",".join(ROWS), metavar="NAME,...", help="rows of the table (default: all)")
    default = "oracle,multi-sensor,multi-sensor, adapting,mht"
    parser.add_argument("--trackers", default=default, metavar="NAME,...", help=f"default: {default}")
    chosen = parser.parse_args(arguments)
    rows, names = (_chosen(parser, what, text, known) for what, text, known in (
        ("--rows", chosen.rows, ROWS), ("--trackers", chosen.trackers, NAMES)))  # fmt: skip

    def table(quick: bool, rng: np.random.Generator) -> list[Claim]:
        count = 2 if quick else chosen.seeds
        return experiment(rows, names, [chosen.seed + k for k in range(count)])

    return run(parser, chosen, table, f"{__doc__} {chosen.seeds} scenes of each row.")


def _chosen(parser: Any, option: str, text: str, known: Sequence[str] | Mapping[str, Any]) -> list[str]:
    """The names that a text lists; those of rows may have commas themselves."""
    found, rest = [], text
    while rest:
        name = max((one for one in known if rest == one or rest.startswith(one + ",")), key=len, default=None)
        if name is None:
            parser.error(f"{option}: expected names from {', '.join(map(repr, known))}, got {rest!r}")
        found.append(name)
        rest = rest[len(name) + 1 :]
    return found


if __name__ == "__main__":
    raise SystemExit(program())

"""Targets that return several plots a scan, and targets close together that do not."""

import numpy as np
import pytest
from scipy.stats import binom, nbinom

from assoc import track
from assoc._files.npz import save_npz
from assoc.errors import InvalidInputError
from assoc.filters import ConstantVelocity, Gaussian, KalmanFilter, LinearMeasurement
from assoc.scene import Scene
from assoc.sensors import PositionSensor
from assoc.simulation.observation import observe
from assoc.tracking import TRACKERS, Initiation
from assoc.tracking.file import FORMAT, VERSION, file_arrays
from assoc.tracking.filter_choice import two_speeds
from assoc.tracking.progress import Progress, Work
from assoc.tracking.records.extents import SPREADS, Extents, binomial, gamma_poisson
from assoc.tracking.stages.extents import _scatter
from assoc.tracking.stages.gathering import gather
from assoc.tracking.step import check
from tests.sizes import sample

SENSOR = PositionSensor(
    position=np.zeros(3), noise=[8.0, 8.0], detection_probability=0.9, false_alarm_rate=5.0,
    field_of_view=[[-4e3, 4e3], [-4e3, 4e3]],
)  # fmt: skip
REGION = [[-4e3, 4e3], [-4e3, 4e3], [0.0, 1.0]]
STARTS, COURSES = np.array([[-900.0, -900.0], [0.0, 700.0], [900.0, -300.0]]), np.radians([40.0, -10.0, 120.0])
LENGTH = 120.0


def paths(scans=50, speed=10.0):
    """Places of three ships every two seconds, and their courses; (K, 3, 2), (3, 2)."""
    ways = np.stack([np.cos(COURSES), np.sin(COURSES)], axis=1)
    return STARTS + 2.0 * np.arange(scans)[:, None, None] * speed * ways, ways


def harbour(seed=0):
    """Plots of three ships of 120 m: a Poisson number along each; times, plots scan by scan, places."""
    rng, (places, ways), scans = np.random.default_rng(seed), paths(), []
    for at in places:
        ships = rng.random(3) < 0.95
        counts = np.maximum(rng.poisson(3.0, 3), 1) * ships
        along = rng.uniform(-0.5, 0.5, counts.sum()) * LENGTH
        z = np.repeat(at, counts, axis=0) + along[:, None] * np.repeat(ways, counts, axis=0)
        false = rng.uniform(-4e3, 4e3, (rng.poisson(5.0), 2))
        z = np.concatenate([z + rng.normal(0.0, 8.0, z.shape), false])
        scans.append(rng.permutation(z))
    return 2.0 * np.arange(len(places)), scans, places


def made(name="multi-sensor", **options):
    return TRACKERS[name]([SENSOR], two_speeds(0.5, 2), region=REGION, initiation=Initiation(speed=10.0), **options)


def followed(tracker, times, scans):
    """Steps of all scans, and the reported tracks after each."""
    steps, tracks = [], []
    for time, z in zip(times, scans, strict=True):
        steps.append(tracker.step(time, [z]))
        tracks.append([track for track in tracker.tracks if track.reported])
    return steps, tracks


@sample("name", ["multi-sensor", "mht", "joint-probabilistic", "nearest-neighbour", "mht-hypothesis"], every=2)
def test_a_ship_with_several_plots_becomes_one_track(name):
    times, scans, places = harbour()
    tracker = made(name, extended=True)
    steps, tracks = followed(tracker, times, scans)
    assert [len(some) for some in tracks[-10:]] == [3] * 10
    off = np.linalg.norm(np.array([t.position[:2] for t in tracks[-1]])[:, None] - places[-1], axis=2)
    assert sorted(off.argmin(axis=1).tolist()) == [0, 1, 2] and off.min(axis=1).max() < 60.0
    # without it they have several each
    assert len(followed(made(name), times, scans)[1][-1]) > 5
    # every plot is decided once, and a ship's plots are its track's
    decided = {decision.scan: decision for step in steps for decision in step.final}
    decided |= {decision.scan: decision for decision in tracker.flush()}
    assert [len(decided[k].assigned[0]) for k in range(len(scans))] == [len(z) for z in scans]
    last = decided[len(scans) - 1].assigned[0]
    near = np.linalg.norm(scans[-1][:, None] - places[-1], axis=2).min(axis=1) < 0.5 * LENGTH
    assert (last[near] > 0).mean() > 0.9 and len(np.unique(last[near & (last > 0)])) == 3
    assert "3 with several plots each" in str(tracker.health)


def test_how_long_ships_are_is_told_and_a_saved_tracker_goes_on_alike(tmp_path):
    times, scans, _ = harbour(3)
    tracker, again = made("mht", extended=True), made("mht", extended=True)
    followed(tracker, times[:30], scans[:30])
    tracker.save(tmp_path / "tracker.npz")
    again.restore(tmp_path / "tracker.npz")
    for one in (tracker, again):
        followed(one, times[30:], scans[30:])
    assert [(t.track_id, *t.position) for t in tracker.tracks] == [(t.track_id, *t.position) for t in again.tracks]
    lengths = tracker.state.extents.of(np.array([t.track_id for t in tracker.tracks if t.reported])).lengths
    assert len(lengths) == 3 and (np.abs(lengths - LENGTH) < 60.0).all()
    arrays = file_arrays(tracker.settings, tracker.state)
    for field, value in (("weight", -1.0), ("covariance", np.nan), ("points", 0.7), ("ids", 5)):
        bad = np.full_like(arrays[f"extents.{field}"], value)
        save_npz(tmp_path / "bad.npz", FORMAT, VERSION, arrays | {f"extents.{field}": bad})
        with pytest.raises(InvalidInputError, match=f"'extents.{field}' is not that of a saved tracker"):
            again.restore(tmp_path / "bad.npz")


@sample("spacing,seed", [(25.0, 0), (25.0, 1), (40.0, 2), (60.0, 3)], every=4)
def test_targets_that_fly_close_together_stay_what_they_are(spacing, seed):
    grid = spacing * np.stack(np.meshgrid(np.arange(3.0), np.arange(2.0)), axis=-1).reshape(-1, 2)
    places = paths()[0][:, :1] + grid
    flat = [np.column_stack([at, np.zeros(len(at))]) for at in places]
    scene = observe(
        [SENSOR], 2.0 * np.arange(50.0), [np.arange(6)] * 50, flat, np.random.default_rng(seed), region=REGION
    )
    tracker, declared = made(extended=True), made()
    found = followed(tracker, scene.times, [z[0] for z in scene.measurements])[1]
    plain = followed(declared, scene.times, [z[0] for z in scene.measurements])[1]
    assert not tracker.state.extents.extended.any()
    assert np.mean([len(some) for some in found[20:]]) > np.mean([len(some) for some in plain[20:]]) - 0.2


def test_the_mean_of_plots_corrects_a_track_as_these_do():
    """Offset and widths against the update by each plot with the noise of its place on the target."""
    filter = KalmanFilter(ConstantVelocity(0.5, dimensions=2, kind="continuous"))
    tracker = TRACKERS["multi-sensor"]([SENSOR], filter, region=REGION, extended=True)
    start = Gaussian(np.array([[10.0, -20.0, 3.0, 1.0]]), np.diag([300.0, 200.0, 4.0, 5.0])[None])
    tracker.begin(0.0, start)
    tracker.step(0.0, [np.zeros((0, 2))])
    extent = np.diag([900.0, 400.0, 0.0])
    known = Extents.none(1).of(tracker.state.tracks.track_id)._replace(covariance=extent[None], weight=np.array([9.0]))
    z = np.array([[30.0, 0.0], [-10.0, -40.0], [25.0, -30.0], [3e3, 3e3]])
    progress = Progress(
        tracker.settings,
        tracker.state._replace(extents=known),
        check(tracker.settings, tracker.state, 2.0, [z], None, None, None),
        Work(tracker.settings, tracker.state),
    )
    found = gather(progress)
    assert [len(z) for z in found.scan.measurements] == [2] and found.gathered.numbers[0].tolist() == [0, 0, 0, 1]
    predicted = filter.predict(tracker.state.tracks.states, 2.0)
    mine = filter.update(predicted, found.scan.measurements[0][:1], SENSOR).state
    theirs, wide = predicted, LinearMeasurement(np.eye(4)[:2], SENSOR.covariance + extent[:2, :2])
    for plot in z[:3]:
        theirs = filter.update(theirs, plot[None], wide).state
    np.testing.assert_allclose(mine.mean, theirs.mean, rtol=1e-9)
    np.testing.assert_allclose(mine.covariance + found.gathered.wider, theirs.covariance, rtol=1e-8, atol=1e-8)


def test_scatter_of_plots_is_the_extent_without_noise():
    rng = np.random.default_rng(0)
    z = rng.multivariate_normal([5.0, 9.0], np.diag([400.0, 100.0]) + SENSOR.covariance, 20_000)
    found = _scatter(SENSOR, z, np.ones((1, len(z))), SENSOR.jacobian(np.zeros((1, 3)))[0][:, :2])[0]
    np.testing.assert_allclose(found[:2, :2] / (len(z) - 1.0), np.diag([400.0, 100.0]), atol=12.0)


def test_numbers_of_plots_tell_an_extent_from_points():
    """Poisson numbers speak for an extent, those of points against it, whatever their rate."""
    rng, sides = np.random.default_rng(3), []
    for numbers in (rng.poisson(4.0, 40), rng.binomial(5, 0.9, 40)):
        extents = Extents.none(1).of(np.array([1])).opened(0, 2)
        for n in numbers.tolist():
            plots = np.full(len(SPREADS), float(n))
            extents = extents.weighed(0, 0, 0.9, np.zeros(len(SPREADS)), plots, np.zeros((len(SPREADS), 3, 3)))
        sides.append(extents.evidence[0, 0])
    assert sides[0] > 8.0 and sides[1] < -8.0


def test_a_target_is_a_point_again_when_it_returns_one_plot():
    extents = Extents.none(1).of(np.array([1]))._replace(covariance=np.eye(3)[None] * 900.0, weight=np.array([9.0]))
    for _ in range(60):
        extents = extents.spread(0, 0, 1, None)
    assert len(extents.kept().ids) == 0


def test_programs_track_ships_with_several_plots(tmp_path, capsys):
    times, scans, _ = harbour(2)
    scene = Scene([SENSOR], times, [[z] for z in scans], REGION)
    scene.save(tmp_path / "harbour.npz")
    words = [str(tmp_path / "harbour.npz"), "-o", str(tmp_path / "tracks.csv"), "--targets", "ship", "--speed", "10"]
    assert track.main([*words, "--extended", "--check"]) == 0
    assert "3 with several plots each" in capsys.readouterr().out
    assert track.main([*words, "--extended", "--no-adapt"]) == 2
    assert "--extended: nothing is estimated with --no-adapt" in capsys.readouterr().err


def test_numbers_of_plots_are_those_of_scipy():
    number, points, P = np.arange(30.0)[:, None, None], np.arange(1.0, 25.0)[:, None], np.array([0.3, 0.9, 1.0])
    np.testing.assert_allclose(binomial(number, points, P), binom.pmf(number, points, P), rtol=1e-10, atol=1e-300)
    for shape, rate in ((1.0, 1.0), (3.7, 9.0), (200.0, 61.0)):
        expected = nbinom.pmf(np.arange(30.0), shape, rate / (1.0 + rate))
        np.testing.assert_allclose(gamma_poisson(np.arange(30.0), shape, rate), expected, rtol=1e-9)

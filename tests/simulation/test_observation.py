"""The simulator's statistics against theory: detections, noise, clutter, fields of view."""

import math

import numpy as np
import pytest
from scipy import stats

from assoc.errors import InvalidInputError
from assoc.sensors import BearingSensor, PositionSensor, Radar2D, Radar3D
from assoc.simulation.observation import observe
from assoc.simulation.radars import azimuth_interval, elevation_interval, radar_over, range_interval

REGION = np.array([[-20e3, 30e3], [10e3, 40e3], [0.0, 12e3]])
SCANS, TARGETS, RATE, DETECTION = 400, 5, 2.5, 0.8
FULL = [-math.pi, math.pi]


def sensors():
    common = {"detection_probability": DETECTION, "false_alarm_rate": RATE}
    correlated = np.array([[900.0, 500.0, 0.0], [500.0, 400.0, 50.0], [0.0, 50.0, 100.0]])
    return [
        Radar3D(position=[0, 0, 0], noise=[30, 0.002, 0.004], field_of_view=[[0, 60e3], FULL, [0, 1.5]], **common),
        Radar2D(position=[5e3, -5e3, 100], noise=[30, 0.002], field_of_view=[[0, 60e3], FULL], **common),
        BearingSensor(position=[-9e3, 0, 0], noise=[0.01], field_of_view=[FULL], **common),
        PositionSensor(position=[0, 0, 0], noise=correlated, field_of_view=REGION, **common),
    ]


@pytest.fixture(scope="module")
def scene():
    rng = np.random.default_rng(5)
    places = [rng.uniform(REGION[:, 0], REGION[:, 1], size=(TARGETS, 3)) for _ in range(SCANS)]
    return observe(sensors(), np.arange(SCANS), [np.arange(TARGETS) + 7] * SCANS, places, rng, region=REGION)


@pytest.mark.parametrize("s", range(4))
def test_detection_rate(scene, s):
    hits = sum(int((scene.truth.sources[k][s] >= 0).sum()) for k in range(SCANS))
    trials = SCANS * TARGETS
    assert abs(hits - DETECTION * trials) < 4 * math.sqrt(trials * DETECTION * (1 - DETECTION))


@pytest.mark.parametrize("s", range(4))
def test_clutter_is_poisson_and_uniform_in_measurement_space(scene, s):
    counts = np.array([int((scene.truth.sources[k][s] == -1).sum()) for k in range(SCANS)])
    assert abs(counts.mean() - RATE) < 4 * math.sqrt(RATE / SCANS)
    # variance over mean of a Poisson law is 1, with standard error sqrt(2 / n)
    assert abs(counts.var(ddof=1) / counts.mean() - 1) < 4 * math.sqrt(2 / SCANS)
    clutter = np.concatenate([scene.measurements[k][s][scene.truth.sources[k][s] == -1] for k in range(SCANS)])
    for axis, (low, high) in enumerate(scene.sensors[s].field_of_view):
        assert stats.kstest(clutter[:, axis], "uniform", args=(low, high - low)).pvalue > 1e-3


@pytest.mark.parametrize("s", range(4))
def test_noise_has_the_stated_covariance(scene, s):
    sensor = scene.sensors[s]
    residuals = []
    for k in range(SCANS):
        source = scene.truth.sources[k][s]
        real = source >= 0
        places = scene.truth.positions[k][source[real] - 7]
        residuals.append(sensor.residual(scene.measurements[k][s][real], sensor.measure(places)))
    z = np.concatenate(residuals) @ np.linalg.inv(np.linalg.cholesky(sensor.covariance)).T
    n = len(z)
    assert np.abs(z.mean(axis=0)).max() < 4 / math.sqrt(n)
    assert np.abs(z.T @ z / n - np.eye(sensor.dim)).max() < 5 * math.sqrt(2 / n)
    assert stats.kstest(z[:, 0], "norm").pvalue > 1e-3


def test_what_is_out_of_view_is_not_detected():
    sensor = BearingSensor(
        position=[0, 0, 0],
        noise=[0.001],
        detection_probability=0.999,
        false_alarm_rate=1e-9,
        field_of_view=[[0.0, 1.0]],
    )
    places = np.array([[1e3, 1e3, 0.0], [-1e3, 1e3, 0.0]])
    scene = observe([sensor], np.arange(50), [np.array([1, 2])] * 50, [places] * 50, np.random.default_rng(0))
    seen = np.concatenate([scene.truth.sources[k][0] for k in range(50)])
    assert set(seen) == {1}


@pytest.mark.parametrize("seed", range(12))
def test_field_of_view_is_the_smallest_box_around_the_region(seed):
    """Thousands of points of the region: all are in the intervals, and some come near every end of them."""
    rng = np.random.default_rng(seed)
    place = rng.uniform([-60e3, -60e3, 0.0], [60e3, 60e3, 15e3])
    points = rng.uniform(REGION[:, 0], REGION[:, 1], size=(40_000, 3))
    corners = np.array([[x, y, z] for x in REGION[0] for y in REGION[1] for z in REGION[2]])
    away = np.concatenate([points, corners]) - place
    ground = np.hypot(away[:, 0], away[:, 1])
    distance = np.linalg.norm(away, axis=1)
    elevation = np.arctan2(away[:, 2], ground)
    azimuth = np.arctan2(away[:, 1], away[:, 0])
    low, high = azimuth_interval(place, REGION)
    turned = low + np.mod(azimuth - low + 1e-9, 2 * math.pi)
    for values, (least, most) in (
        (distance, range_interval(place, REGION)),
        (elevation, elevation_interval(place, REGION)),
        (turned, (low, high)),
    ):
        span = most - least
        assert values.min() >= least - 1e-6 and values.max() <= most + 1e-6
        assert values.min() <= least + 0.12 * span and values.max() >= most - 0.12 * span
    radar = radar_over(
        REGION,
        place,
        range_noise=50.0,
        angle_noise=0.001,
        detection_probability=0.9,
        false_alarm_rate=1.0,
        name="",
    )
    assert radar.in_view(radar.measure(points)).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"positions": [np.zeros((3, 2))]}, r"positions of scan 0 must have shape \(3, 3\), got \(3, 2\)"),
        ({"positions": []}, "positions: 0 scans, but target_ids has 1"),
        ({"velocities": [np.zeros((2, 3))]}, r"velocities of scan 0 must have shape \(3, 3\), got \(2, 3\)"),
        ({"velocities": []}, "velocities: 0 scans"),
        ({"times": [0.0, 1.0]}, "target_ids: 1 scans, but times has 2"),
    ],
)
def test_targets_that_do_not_agree_are_refused(changes, words):
    given = {"times": [0.0], "target_ids": [[1, 2, 3]], "positions": [np.ones((3, 3))], **changes}
    with pytest.raises(InvalidInputError, match=words):
        observe(sensors(), rng=np.random.default_rng(0), **given)

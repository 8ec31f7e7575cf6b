"""Radars beside each other: what registration cannot find is found, and what nothing was compared with is not right."""

from dataclasses import replace

import numpy as np
import pytest

from assoc.recordings import Recording, radar_of
from assoc.recordings.on_earth import placed
from assoc.registration.agreement import Change, compare, noise_of, standing_still
from assoc.scene.geodesy import east_north_up, geodetic
from tests.sizes import sample

TURNS = (5.0, 4.0)
PLACES = ((0.83, 0.14, 300.0), (0.818, 0.15, 500.0))
ORIGIN = PLACES[0]


def plots_of(place, turn, seed, duration=240.0):
    """What a radar that turns clockwise measures of twelve straight flights, and false plots; exact geometry."""
    rng, flights = np.random.default_rng(seed), np.random.default_rng(5)
    start = flights.uniform([-60e3, -90e3, 2e3], [80e3, 60e3, 11e3], (12, 3))
    way = flights.uniform(0, 2 * np.pi, 12)
    velocity = 220.0 * np.stack([np.cos(way), np.sin(way), np.zeros(12)], axis=1)
    rows = []
    for k in range(int(duration / turn)):
        times = np.full(12, turn * (k + 0.5))
        for _ in range(4):
            lat, lon, height = geodetic(start + times[:, None] * velocity, ORIGIN).T
            away = east_north_up(lat, lon, height, place)
            azimuth = np.arctan2(away[:, 1], away[:, 0])
            times = turn * (k + np.mod(np.pi / 2 - azimuth, 2 * np.pi) / (2 * np.pi))
        seen = rng.random(12) < 0.85
        far = np.linalg.norm(away, axis=1) + rng.normal(0, 60, 12)
        rows += np.stack([times, far, azimuth + rng.normal(0, 1e-3, 12), height], axis=1)[seen].tolist()
        false = rng.uniform(-np.pi, np.pi)
        when = turn * (k + np.mod(np.pi / 2 - false, 2 * np.pi) / (2 * np.pi))
        rows.append([when, rng.uniform(2e4, 1.4e5), false, np.nan])
    times, ranges, azimuths, heights = np.array(sorted(rows)).T
    return Recording(times, ranges, azimuths, altitudes=heights)


@pytest.fixture(scope="module")
def plots():
    return [plots_of(place, turn, seed) for seed, (place, turn) in enumerate(zip(PLACES, TURNS, strict=True))]


def agreements(recordings):
    found = [
        placed(one, radar_of(one, range_noise=60.0, azimuth_noise=1e-3), place, ORIGIN)
        for one, place in zip(recordings, PLACES, strict=True)
    ]
    return compare([one for one, _ in found], [radar for _, radar in found], TURNS, ORIGIN)


def test_radars_that_agree(plots):
    for one in agreements(plots):
        assert one.change == Change() and one.common > 0.5 * one.places > 100
        assert abs(one.turn[0]) < 4 * one.turn[1] < 2e-3 and abs(one.length[0]) < 4 * one.length[1] < 150.0
    for one, turn in zip(plots, TURNS, strict=True):
        noise = noise_of(one, turn)
        assert noise.range == pytest.approx(60.0, rel=0.3) and noise.azimuth == pytest.approx(1e-3, rel=0.3)


@sample("degrees", [-12.0, 1.0, 180.0, 90.0], every=4)
def test_north_turned(plots, degrees):
    """Bearings too large by some degrees are azimuths too small: the change adds to azimuths."""
    first, second = agreements([replace(plots[0], azimuths=plots[0].azimuths - np.radians(degrees)), plots[1]])
    turned = np.degrees(first.change.turn + first.turn[0])
    assert abs((turned - degrees + 180) % 360 - 180) < 0.1
    assert second.change == Change()


@sample(
    "changed,change",
    [
        (lambda one: replace(one, ranges=one.ranges / 1.852), Change(scale=1.852)),
        (lambda one: replace(one, ranges=1e3 * one.ranges), Change(scale=1e-3)),
        (lambda one: replace(one, times=one.times - 60.0), Change(shift=60.0)),
        (lambda one: replace(one, azimuths=np.pi - one.azimuths), Change(mirrored=True)),
    ],
    every=4,
)
def test_units_clocks_and_directions(plots, changed, change):
    first, second = agreements([plots[0], changed(plots[1])])
    assert first.change == Change() and replace(second.change, turn=0.0) == change
    # far off by ranges in a wrong unit, a plot's azimuth in the plane of the scene is wrong, too
    assert abs(second.change.turn) < 0.03


@pytest.mark.slow
def test_an_hour_off():
    """Half an hour of both is left when one clock is an hour ahead."""
    slow = [plots_of(place, turn, 3, duration=4000.0) for place, turn in zip(PLACES, TURNS, strict=True)]
    found = agreements([slow[0], replace(slow[1], times=slow[1].times + 3600.0)])
    assert {one.change for one in found} & {Change(shift=3600.0), Change(shift=-3600.0)}


def test_what_is_compared_with_nothing(plots):
    """One radar alone; radars of other targets; false plots."""
    rng = np.random.default_rng(0)
    assert (
        compare([plots[0]], [radar_of(plots[0], range_noise=60.0, azimuth_noise=1e-3)], [5.0], ORIGIN)[0].change is None
    )
    noise = replace(plots[1], azimuths=rng.uniform(-np.pi, np.pi, len(plots[1])), altitudes=None)
    assert [one.change for one in agreements([plots[0], noise])] == [None, None]
    assert noise_of(plots[0].take(np.arange(10)), 5.0).plots < 3


def test_turbines_are_no_flights(plots):
    """A farm that one radar sees in two thirds of its turns: without it the radar is what it is without the farm."""
    rng = np.random.default_rng(1)
    east, north = np.meshgrid(12e3 + 600.0 * np.arange(6), -20e3 + 600.0 * np.arange(6))
    far, azimuth = np.hypot(east, north).ravel(), np.arctan2(north, east).ravel()
    turn, farm = np.nonzero(rng.random((48, 36)) < 0.67)
    times = 5.0 * (turn + np.mod(np.pi / 2 - azimuth[farm], 2 * np.pi) / (2 * np.pi))
    noise = rng.normal(0, [60.0, 1e-3], (len(farm), 2))
    plot = np.column_stack([times, far[farm] + noise[:, 0], azimuth[farm] + noise[:, 1], np.full(len(farm), np.nan)])
    alone = np.column_stack([plots[0].times, plots[0].ranges, plots[0].azimuths, plots[0].altitudes])
    rows = np.concatenate([alone, plot])
    order = np.argsort(rows[:, 0], kind="stable")
    times, ranges, azimuths, heights = rows[order].T
    both = Recording(times, ranges, azimuths, altitudes=heights)
    still = standing_still(both, 5.0)
    of_farm = order >= len(alone)
    assert still[of_farm].mean() > 0.97 and still[~of_farm].mean() < 0.02
    assert not standing_still(plots[0], 5.0).any()
    moving = both.take(np.flatnonzero(~still))
    assert noise_of(moving, 5.0).range == pytest.approx(60.0, rel=0.3)
    assert [one.change for one in agreements([moving, plots[1]])] == [Change(), Change()]


def test_noise_beside_clutter_that_is_dense(plots):
    """Eight returns a turn from anywhere in a rain of four kilometres: some line fits each of them."""
    rng, count = np.random.default_rng(2), 8 * 48
    far, azimuth = rng.uniform(28e3, 32e3, count), rng.uniform(0.4, 0.53, count)
    times = 5.0 * (np.repeat(np.arange(48), 8) + np.mod(np.pi / 2 - azimuth, 2 * np.pi) / (2 * np.pi))
    rows = np.column_stack([np.append(plots[0].times, times), np.append(plots[0].ranges, far),
                            np.append(plots[0].azimuths, azimuth)])  # fmt: skip
    noise = noise_of(Recording(*rows[np.argsort(rows[:, 0], kind="stable")].T), 5.0)
    assert noise.range == pytest.approx(60.0, rel=0.3) and noise.azimuth == pytest.approx(1e-3, rel=0.3)

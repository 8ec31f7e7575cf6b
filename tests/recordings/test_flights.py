"""Reports cleaned and resampled: spoiled flights against the flights that they were."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from assoc.errors import AssocWarning, InvalidInputError
from assoc.recordings.flights.cleaning import ALTITUDES, JUMPS, REPEATED, clean
from assoc.recordings.flights.positions import read_positions
from assoc.recordings.flights.reports import Reports
from assoc.scene.geodesy import east_north_up
from assoc.simulation import simulate
from assoc.simulation.scenarios.from_tracks import frame_velocities, resample

ORIGIN = (0.8, 0.1, 0.0)
NONE = np.full((1, 3), np.nan)


def flight(target=0, count=30, start=0.0, height=9000.0, climb=0.0):
    """Northeast at some 230 m/s, a report every 10 s."""
    time = start + 10.0 * np.arange(count)
    away = 2.5e-5 * (time - start)
    heights, unknown = height + climb * (time - start), np.full(count, np.nan)
    return Reports(time, np.full(count, target), 0.8 + away, 0.1 + away, heights, np.full((count, 3), np.nan), unknown)


def joined(*parts):
    return Reports(*(np.concatenate([getattr(one, name) for one in parts]) for name in vars(parts[0])))


def test_clean_reports_stay():
    reports = joined(flight(), flight(1, climb=20.0), flight(3, 2))
    kept, found = clean(reports)
    assert found == {}
    for name in vars(reports):
        np.testing.assert_array_equal(getattr(kept, name), getattr(reports, name))


@pytest.mark.parametrize("known", [True, False])
def test_positions_repeated_after_the_last_one_received(known):
    """An aircraft vanishes after 20 reports; the network goes on with the last one for 10 more."""
    whole = flight()
    stale = np.minimum(np.arange(30), 19)
    rows = whole.rows(stale)
    seen = replace(rows, time=whole.time, updated=whole.time[stale] if known else whole.updated)
    kept, found = clean(seen)
    assert found == {REPEATED: 10} and len(kept) == 20
    np.testing.assert_array_equal(kept.time, whole.time[:20])


def test_positions_have_the_time_when_they_were_received():
    reports = flight()
    kept, _ = clean(replace(reports, updated=reports.time - 3.0))
    np.testing.assert_allclose(kept.time, reports.time - 3.0)
    # a time after the row's own does not count
    kept, _ = clean(replace(reports, updated=reports.time + 5.0))
    np.testing.assert_array_equal(kept.time, reports.time)


def test_altitudes_are_mended_and_climbs_are_not():
    plain = joined(flight(climb=15.0), flight(2, climb=-20.0))
    heights = plain.height.copy()
    wrong = [0, 5, 6, 29, 30, 44]
    heights[wrong] = [0.0, 0.0, -300.0, 25_000.0, 0.0, 12_800.0]
    kept, found = clean(replace(plain, height=heights))
    assert found == {ALTITUDES: 6}
    inner = [5, 6, 44]
    np.testing.assert_allclose(kept.height[inner], plain.height[inner], atol=1.0)
    # at the ends there is nothing to draw a line to: the next height
    np.testing.assert_allclose(kept.height, plain.height, atol=201.0)
    good = np.setdiff1d(np.arange(60), wrong)
    np.testing.assert_array_equal(kept.height[good], plain.height[good])


def test_places_far_off_are_left_out():
    plain = flight()
    latitude = plain.latitude.copy()
    latitude[12] += 0.02
    kept, found = clean(replace(plain, latitude=latitude))
    assert found == {JUMPS: 1} and 12 * 10.0 not in kept.time and len(kept) == 29


def turning(times):
    """A turn of 3 degrees a second at 200 m/s: places and velocities in the plane."""
    rate, speed = np.radians(3.0), 200.0
    angle = rate * times
    place = speed / rate * np.stack([np.sin(angle), 1 - np.cos(angle), np.zeros(len(times))], axis=1)
    return place, speed * np.stack([np.cos(angle), np.sin(angle), np.zeros(len(times))], axis=1)


def reports_at(times):
    return replace(flight(count=len(times)), time=times)


def errors(velocities):
    own, wanted = np.arange(0.0, 61.0, 10.0), np.arange(10.0, 50.1, 1.0)
    place, velocity = turning(own)
    _, found = resample(reports_at(own), place, wanted, 60.0, velocity if velocities else None)
    truth, _ = turning(wanted)
    return np.linalg.norm(np.concatenate(found) - truth, axis=1)


def test_curves_follow_turns():
    """Chords are off by up to v w dt^2 / 8 = 131 m; a cubic with velocities by (w dt)^4 r / 384 = 0.75 m."""
    assert errors(velocities=True).max() < 1.5
    assert errors(velocities=False).max() < 25.0


def test_velocities_in_the_frame():
    """East, north, up far from the origin, against differences of places a second apart along a great circle."""
    lat, lon = np.array([0.8, 0.83, 0.78]), np.array([0.1, 0.16, 0.05])
    velocity = np.tile([120.0, 180.0, -7.0], (3, 1))
    reports = replace(flight(count=3), target=np.arange(3), latitude=lat, longitude=lon, velocity=velocity)
    places = east_north_up(lat, lon, reports.height, ORIGIN)
    found = frame_velocities(reports, places, ORIGIN)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), np.linalg.norm([120.0, 180.0, -7.0]), rtol=1e-4)
    np.testing.assert_allclose(found[0], [120.0, 180.0, -7.0], atol=0.05)
    # elsewhere the plane of the horizon is another: up there is not up here
    assert abs(found[1, 2] + 7.0) > 1.0
    hidden = replace(reports, velocity=np.concatenate([NONE, reports.velocity[1:]]))
    assert np.isnan(frame_velocities(hidden, places, ORIGIN)[0]).all()


@pytest.mark.parametrize(
    ("dates", "order"),
    [
        (["31/07/2026 23:59:50", "01/08/2026 00:00:10"], None),
        (["07/31/2026 23:59:50", "08/01/2026 00:00:10"], None),
        (["31.07.2026 23:59:50", "01.08.2026 00:00:10"], None),
        (["11/12/2026 23:59:50", "12/12/2026 00:00:10"], "day/month"),
        (["12/11/2026 23:59:50", "12/12/2026 00:00:10"], "month/day"),
    ],
)
def test_dates_of_ais_by_day_and_month(tmp_path, dates, order):
    """Those of the Danish authority's files, and where both readings can be, the one that takes less time, told."""
    path = tmp_path / "ais.csv"
    rows = "".join(f"{date},235000100,50.{k},1.0\n" for k, date in enumerate(dates))
    path.write_text("# Timestamp,MMSI,Latitude,Longitude\n" + rows)
    with pytest.warns(AssocWarning, match=f"taken as {order}") if order else nullcontext():
        times = read_positions(str(path)).times
    assert np.diff(times).tolist() == [20.0]


def test_times_that_are_none_are_named(tmp_path):
    path = tmp_path / "ais.csv"
    path.write_text("Time [s],MMSI,Latitude,Longitude\nnoon,235000100,50.0,1.0\n")
    with pytest.raises(InvalidInputError, match=r"column 'Time \[s\]': expected seconds or ISO dates, got 'noon'"):
        read_positions(str(path))


def test_a_file_of_opensky(tmp_path):
    """One aircraft that vanishes after 100 s and is repeated for 100 s more, with an altitude of 0 in between."""
    rows = ["time,icao24,lat,lon,velocity,heading,vertrate,geoaltitude,lastposupdate"]
    for k in range(21):
        n = min(k, 10)
        height = 0 if k == 5 else 9000
        rows.append(f"{1000 + 10 * k},aa,{50 + 0.02 * n},8.0,222.5,0,0,{height},{1000 + 10 * n - 0.5}")
    path = tmp_path / "states.csv"
    path.write_text("\n".join(rows) + "\n")
    scene = simulate("from-tracks", file=str(path), interval=10.0)
    assert [len(one) for one in scene.truth.target_ids] == [1] * 10 + [0] * 11
    assert scene.notes["rows left out, repeating an older position"] == 10
    assert scene.notes["altitudes mended, far from those before and after"] == 1
    heights = np.array([one[0, 2] for one in scene.truth.positions[:10]])
    assert np.ptp(heights) < 60.0
    raw = simulate("from-tracks", file=str(path), interval=10.0, clean=False)
    assert [len(one) for one in raw.truth.target_ids] == [1] * 21
    assert raw.truth.positions[5][0, 2] < 100.0 and not any("repeating" in what for what in raw.notes)

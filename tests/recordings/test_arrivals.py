"""Tables of arrival times and of stations, and the program that finds what was emitted."""

import csv
from datetime import UTC, datetime

import numpy as np
import pytest

from assoc.errors import AssocWarning, InvalidInputError
from assoc.recordings.arrivals import read_arrivals, read_stations, scene_of_arrivals
from assoc.scene.geodesy import geodetic
from tests.running import here

LIGHT = 299_792_458.0
ORIGIN = (np.radians(46.5), np.radians(8.0), 0.0)
SITES = np.array(
    [[-30e3, -25e3, 400.0], [28e3, -30e3, 90.0], [31e3, 22e3, 700.0], [-25e3, 30e3, 0.0], [2e3, -4e3, 1500.0],
     [-45e3, 1e3, 200.0]]
)  # fmt: skip
PLACES = np.array([[4e3, 9e3, 9e3], [-12e3, -8e3, 6e3], [15e3, -11e3, 10e3]])


def write(path, header, rows):
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n")
    return str(path)


def stations_file(folder):
    rows = [(f"R{k}", *np.degrees(place[:2]), place[2]) for k, place in enumerate(geodetic(SITES, ORIGIN))]
    return write(folder / "stations.csv", "Receiver,Latitude,Longitude,Height [m]", rows)


def stamp(nanoseconds):
    whole, rest = divmod(nanoseconds, 10**9)
    return f"{datetime.fromtimestamp(1_700_000_000 + whole, UTC):%Y-%m-%dT%H:%M:%S}.{rest:09d}Z"


def test_emissions_of_aircraft_by_dates_to_the_nanosecond(tmp_path):
    rng, rows = np.random.default_rng(3), []
    for event, place in enumerate(PLACES):
        for k, site in enumerate(SITES):
            away = np.linalg.norm(place - site) / LIGHT + rng.normal(0.0, 20e-9)
            rows.append((stamp(round((0.5 + 0.2 * event + away) * 1e9)), f"R{k}"))
    rows += [(stamp(round(at * 1e9)), f"R{k}") for k, at in enumerate(rng.uniform(0.0, 1.0, 6))]
    order = rng.permutation(len(rows))
    file = write(tmp_path / "plots.csv", "Time,Receiver", [rows[k] for k in order])
    out, picks = tmp_path / "events.csv", tmp_path / "picks.csv"
    done = here(
        "assoc.locate", file, "--stations", stations_file(tmp_path), "--wave-speed", str(LIGHT), "--noise", "20e-9",
        "--heights", "0,13000", "-o", str(out), "--picks", str(picks),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "3 emissions of 18 arrivals at 6 stations, 6 false" in done.stdout
    events = list(csv.DictReader(out.read_text().splitlines()))
    for event, at, place in zip(events, (0.5, 0.7, 0.9), geodetic(PLACES, ORIGIN), strict=True):
        assert abs(datetime.fromisoformat(event["time"][:26] + "Z").timestamp() - 1.7e9 - at) < 5e-6
        assert abs(float(event["latitude"]) - np.degrees(place[0])) < 50.0 / 111e3
        assert abs(float(event["altitude"]) - place[2]) < 5.0 * float(event["sd_up"]) < 1000.0
    of = [int(row["event"]) for row in csv.DictReader(picks.read_text().splitlines())]
    assert of == [(k // 6 + 1) % 4 for k in order]


def quakes(folder, header="time,station,phase"):
    """Arrivals of one earthquake as P and S at five stations in x and y."""
    sites = write(folder / "sites.csv", "station,x,y", [(f"S{k}", *site[:2]) for k, site in enumerate(SITES[:5])])
    place, flat = np.array([3e3, -7e3, -8e3]), SITES[:5] * [1, 1, 0]
    rows = [(repr(100.0 + float(np.linalg.norm(place - site)) / speed), f"S{k}", phase)
            for k, site in enumerate(flat) for phase, speed in (("P", 6000.0), ("S", 3464.0))]  # fmt: skip
    return sites, write(folder / "picks.csv", header, rows), rows, place


def test_phases_are_waves_of_their_own_speed(tmp_path):
    sites, file, _, place = quakes(tmp_path)
    out = tmp_path / "events.csv"
    done = here(
        "assoc.locate", file, "--stations", sites, "--wave-speed", "P=6000,S=3464", "--noise", "0.01",
        "--heights=-20000,0", "-o", str(out),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    (event,) = csv.DictReader(out.read_text().splitlines())
    assert event["arrivals"] == "10"
    assert float(event["time"]) == pytest.approx(100.0, abs=0.01)
    assert [float(event[axis]) for axis in "xyz"] == pytest.approx(place, abs=60.0)


def test_units_of_times_repeats_and_strangers(tmp_path):
    sites = read_stations(quakes(tmp_path)[0])
    rows = [("1700000000123456789", "S0"), ("1700000000123456789", "S0"), ("1700000001000000001", "S1"),
            ("nan", "S1"), ("1700000002000000000", "X")]  # fmt: skip
    file = write(tmp_path / "ns.csv", "timestamp_ns,station", rows)
    with pytest.warns(AssocWarning, match=r"1 rows without a time; 1 arrivals at unknown stations \(X\); 1 repeated"):
        found = read_arrivals(file, sites)
    assert found.start == 1_700_000_000
    assert found.times.tolist() == [0.123456789, 1.000000001]
    assert list(found.rows) == [1, 3]


def test_scans_end_where_no_wave_can_be_on_its_way(tmp_path):
    sites, file, rows, _ = quakes(tmp_path)
    stations = read_stations(sites)
    later = [(repr(float(time) + 500.0), *rest) for time, *rest in rows]
    made = scene_of_arrivals(
        read_arrivals(write(tmp_path / "two.csv", "time,station,phase", [*later, *rows]), stations),
        stations, {"P": 6000.0, "S": 3464.0}, 0.01, (-20e3, 0.0),
    )  # fmt: skip
    assert [sum(map(len, scan)) for scan in made.rows] == [10, 10]
    assert made.scene.sensors[0].field_of_view[0, 1] == pytest.approx(made.scene.sensors[-1].field_of_view[0, 1])
    with pytest.warns(AssocWarning, match="left out: 10 arrivals of phases without a speed .'S'."):
        only = scene_of_arrivals(read_arrivals(str(tmp_path / "two.csv"), stations), stations, {"P": 6000.0}, 0.01,
                                 (-20e3, 0.0))  # fmt: skip
    assert len(only.scene.sensors) == 5


@pytest.mark.parametrize(
    ("stations", "arrivals", "message"),
    [
        ("station,lat\nA,1\n", "time,station\n1,A\n", "no column lon or long or lng or longitude for the longitude"),
        ("station,lat,lon\nA,95,1\n", "time,station\n1,A\n", "row 1: station A has no place that can be"),
        ("station,x,y\nA,0,0\nA,1,1\n", "time,station\n1,A\n", "station A is there more than once"),
        ("station,x,y\nAB1,0,0\n", "time,station\n1,AB2\n", "station AB2 is not among the stations"),
        ("station,x,y\nA,0,0\n", "time,station\nsoon,A\n", "no row has a time"),
        ("station,x,y\nA,0,0\n", "when,station\n1,A\n", "no column time or"),
    ],
)
def test_what_cannot_be_read_is_one_line(tmp_path, stations, arrivals, message):
    first, second = tmp_path / "stations.csv", tmp_path / "arrivals.csv"
    first.write_text(stations)
    second.write_text(arrivals)
    with pytest.raises(InvalidInputError, match=message) as caught:
        read_arrivals(str(second), read_stations(str(first)))
    assert "\n" not in str(caught.value)


def test_options_that_are_missing_or_wrong(tmp_path):
    sites, file, *_ = quakes(tmp_path)
    out = str(tmp_path / "events.csv")
    base = [file, "--stations", sites, "--noise", "0.01", "-o", out]
    for more, message in (
        (["--wave-speed", "6000"], "--heights: is needed"),
        (["--wave-speed", "P=6000,300", "--heights", "0,1"], "--wave-speed: expected metres a second"),
        (["--wave-speed", "6000", "--heights", "3,1"], "--heights: expected the lowest and the highest"),
    ):
        done = here("assoc.locate", *base, *more)
        assert done.returncode == 2
        assert message in done.stderr

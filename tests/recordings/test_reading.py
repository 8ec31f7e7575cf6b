"""Plots from CSV: the paper's table as it is, units, what is mended, and one clear line for what is not."""

import math
import os
import warnings

import numpy as np
import pytest

from assoc.errors import AssocWarning, InvalidInputError
from assoc.recordings import Recording, garbled_altitudes, read_plots, write_plots
from tests.recordings.common import TABLE_2_1, circling


def written(folder, text):
    path = folder / "plots.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def test_the_papers_table(tmp_path):
    recording = read_plots(written(tmp_path, TABLE_2_1))
    assert len(recording) == 20
    assert recording.times[0] == 13 * 60 + 6
    assert recording.times[-1] - recording.times[0] == 23.0
    assert recording.ranges[:2] == pytest.approx([117 * 1852, 21 * 1852])
    # 220.8 deg from north: south-west
    assert recording.positions[0] == pytest.approx(
        117 * 1852 * np.array([math.sin(math.radians(220.8352)), math.cos(math.radians(220.8352))])
    )
    assert (recording.positions[0] < 0).all()
    assert np.degrees(recording.bearings[:3]) == pytest.approx([220.8352, 235.2527, 248.6154])
    assert recording.lines.tolist() == list(range(2, 22))
    assert recording.identities[recording.decoded].min() == 902
    assert np.flatnonzero(~recording.decoded).tolist() == [3]
    assert recording.altitudes[0] == pytest.approx(22_000 * 0.3048)
    # 2 for an aircraft that is at 400 in the next turn, and twice where 79 follows
    assert np.flatnonzero(recording.garbled).tolist() == [3, 4, 11]
    assert np.isnan(recording.trusted_altitudes).sum() == 3
    assert "1 plots not decoded" in recording.summary()
    assert "3 garbled" in recording.summary()
    assert sum(recording.notes.values()) == 0


@pytest.mark.parametrize(
    ("text", "options"),
    [
        ("time,range_km,bearing_rad\n5,1.852,0.5\n", {}),
        ("t;r;b\n5;1;28.64788976\n", {"columns": {"time": "t", "range": "r", "bearing": "b"}}),
        ("TIME\tRange\tBEARING\tother\n5\t1852\t28.64788976\tx\n", {"units": {"range": "m"}}),
        ('"time","range_nm","bearing_deg"\r\n"5"," 1 ",28.64788976\r\n\r\n', {}),
        ("\ufefftime,range,bearing\n0:00:05,1,28.64788976", {}),
        ("time,range,bearing\n1970-01-01T00:00:05Z,1,28.64788976", {}),
        ("time,range,bearing\n1970-01-01T01:00:05+01:00,1,388.64788976", {}),
    ],
)
def test_columns_units_and_times(tmp_path, text, options):
    recording = read_plots(written(tmp_path, text), **options)
    assert recording.times.tolist() == [5.0]
    assert recording.ranges == pytest.approx([1852.0])
    assert recording.bearings == pytest.approx([0.5])
    assert not recording.decoded.any()
    assert np.isnan(recording.altitudes).all()


HEAD = "time,range,bearing,mode3,altitude\n"


def test_disorder_repeats_fillers_and_midnight(tmp_path):
    text = HEAD + (
        "23:59:50,10,5,1,100\n23:59:56,10,5,1,100\n23:59:53,11,5,2,100\n0:00:02,12,5,1,100\n"
        "0:00:02,12,5,1,100\n0,0,0,0,0\n23:59:59,13,5,3,100\n0:00:04,14,5,1,100\n"
    ).replace("0,0,0,0,0", "0:00:03,0,0,0,0")
    recording = read_plots(written(tmp_path, text))
    assert np.diff(recording.times).tolist() == [3, 3, 3, 3, 2]
    assert recording.lines.tolist() == [2, 4, 3, 8, 5, 9]
    assert {what: count for what, count in recording.notes.items() if count} == {
        "late plots sorted in": 2,
        "repeated rows left out": 1,
        "rows of zeros left out": 1,
        "midnights passed": 1,
    }
    assert "midnights passed: 1" in recording.summary()


@pytest.mark.parametrize("unit", [1, 1000])
def test_seconds_of_the_day_as_numbers_go_on_over_midnight(tmp_path, unit):
    """Days that pass, plots out of order at midnight, and the last plot alone."""
    times = 86_400.0 * 2 - 36_000.0 + 9.5 * np.arange(4000)
    times[[3789, 3790]] = times[[3790, 3789]]
    bearings = np.linspace(0, 40.0 * 360.0, len(times)) % 360
    told = np.round(times % 86_400.0 * unit, 3) if unit == 1 else np.round(times % 86_400.0 * unit).astype(int)
    if unit == 1000:
        # milliseconds are told by the antenna's turns
        bearings = times / 9.7 % 1 * 360
    rows = "".join(f"{t},{10 + k % 7},{b:.3f},1,100\n" for k, (t, b) in enumerate(zip(told, bearings, strict=True)))
    recording = read_plots(written(tmp_path, HEAD + rows))
    np.testing.assert_allclose(recording.times - recording.times[0], np.sort(times) - times.min(), atol=1e-2)
    assert recording.notes["midnights passed"] == 1
    short = written(tmp_path, HEAD + "86390,10,5,1,100\n86395,10,6,1,100\n86399,10,7,1,100\n3,10,8,1,100\n")
    assert read_plots(short).times.tolist() == [86390, 86395, 86399, 86403]


def test_a_jump_back_is_an_error_with_its_line(tmp_path):
    later = "".join(f"{time},10,5,1,100\n" for time in (7200, 7201, 7202, 3600, 3601, 3602))
    path = written(tmp_path, HEAD + "100,10,5,1,100\n" + later)
    with pytest.raises(InvalidInputError, match="line 6: the time jumps back by 3602 s, expected at most 30"):
        read_plots(path)
    recording = read_plots(path, max_disorder=4000.0)
    # gaps of hours are no error
    assert recording.times.tolist() == [100, 3600, 3601, 3602, 7200, 7201, 7202]
    assert recording.lines.tolist() == [2, 6, 7, 8, 3, 4, 5]


@pytest.mark.parametrize("clock", [False, True])
@pytest.mark.parametrize("wrong", [[1], [5], [12], [5, 6], [19], [3, 9]])
def test_a_wrong_time_neither_moves_nor_delays_the_plots_after_it(tmp_path, clock, wrong):
    """Near midnight, too, where a fall by half a day would begin a day."""
    times = 86_340.0 + 4.0 * np.arange(20)
    told = times % 86_400.0
    told[wrong] = np.mod(told[wrong] - 50_000.0, 86_400.0)
    if not clock:
        told = np.where(np.isin(np.arange(20), wrong), 50_000.0, times)

    def cell(second):
        return f"{second // 3600:02.0f}:{second // 60 % 60:02.0f}:{second % 60:06.3f}" if clock else f"{second:g}"

    rows = "".join(f"{cell(second)},{10 + k},5,1,100\n" for k, second in enumerate(told))
    recording = read_plots(written(tmp_path, HEAD + rows))
    kept = np.delete(times, wrong)
    assert recording.notes["plots left out whose time no other supports"] == len(wrong)
    assert (recording.times - recording.times[0]).tolist() == (kept - kept[0]).tolist()
    assert recording.notes.get("midnights passed", 0) == int(clock)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "has no header line"),
        (HEAD, "holds no plots"),
        (
            "time,range\n1,2\n",
            "no column bearing or .* or brg for the bearing; it has: 'time, range'",
        ),
        ("time,time,range,bearing\n", "the column 'time' is there 2 times"),
        (HEAD + "1,2,3,4,5\nx,2,3,4,5\n", "line 3, column 'time': expected seconds or an ISO date, got 'x'"),
        (HEAD + "0:00:01,2,3,4,5\n2,2,3,4,5\n", "line 3, column 'time': expected h:mm:ss, got '2'"),
        (HEAD + "1,two,3,4,5\n", "line 2, column 'range': expected a number, got 'two'"),
        (HEAD + "1,-2,3,4,5\n", "holds no plots: 1 rows left out whose time, range or bearing cannot be"),
        (HEAD + "1,2\n\n,2,3,4,5\n", "holds no plots: 2 rows without time, range or bearing left out"),
        (HEAD + "1,٢,3,4,5\n", "line 2, column 'range': expected a number"),
        (HEAD + "1,2,3,4," + "5" * 20_000, "line 2 is longer than 10000 bytes"),
        (
            HEAD.replace(",", " ") + "1 2 3 4 5\n",
            "no column time .* expected columns between commas, semicolons or tabs",
        ),
        (HEAD.encode("utf-16"), "line 1 is UTF-16, expected UTF-8: save it so"),
        (HEAD + "1,185200,3,4,5\n" * 10, "column 'range': 185200 nmi are 342,990 km: metres. .name the column range_m"),
        (HEAD.encode() + b"1,2,3,4,5\n1,\x00,3,4,5\n", "line 3 holds a NUL byte, expected text .UTF-8.$"),
        (bytes([48, 0, 9, 0x80, 25, 201, 0, 0, 1]), "line 1 holds a NUL byte.*asterix.read_asterix"),
        (HEAD.encode() + b"1,2,\xff\xfe,4,5\n", "line 2, column 'bearing': expected a number"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "no column time or .*; it has: '.PNG'; if it is ASTERIX"),
    ],
)
def test_what_is_no_recording_is_refused_in_one_line(tmp_path, text, message):
    path = written(tmp_path, text)
    with pytest.raises(InvalidInputError, match=message) as error:
        read_plots(path)
    assert str(error.value).startswith(str(path))
    assert len(str(error.value).splitlines()) == 1
    assert len(str(error.value)) < 400


@pytest.mark.parametrize(("unit", "far"), [("km", 2000), ("m", 2_000_000)])
@pytest.mark.filterwarnings("ignore")
def test_ranges_as_far_as_satellites_are_read_where_their_unit_is_stated(tmp_path, unit, far):
    rows = "".join(f"{k},{far},{k},4,5\n" for k in range(20))
    path = written(tmp_path, HEAD.replace("range", f"range_{unit}") + rows)
    assert read_plots(path).measurements[:, 0] == pytest.approx(2e6)


def test_what_is_written_is_read_back(tmp_path):
    recording = circling()
    write_plots(tmp_path / "out.csv", recording)
    back = read_plots(tmp_path / "out.csv")
    assert back.times == pytest.approx(recording.times, abs=1e-6)
    assert back.measurements == pytest.approx(recording.measurements, abs=1e-2)
    assert back.identities.tolist() == recording.identities.tolist()
    assert back.sources.tolist() == recording.sources.tolist()
    assert os.listdir(tmp_path) == ["out.csv"]


def test_garbled_altitudes():
    levels = [300, 302, 2, 304, 512, 305, 120, 306, np.nan, 307, 100, 2, 90]
    identities = [5] * 10 + [0, 0, 6]
    found = np.flatnonzero(garbled_altitudes(levels, identities)).tolist()
    # 120 is no known code, but nobody falls that far and comes back
    assert found == [2, 4, 6, 11]
    assert np.flatnonzero(garbled_altitudes(levels, identities, codes=[])).tolist() == [2, 4, 6]
    # a steady climb is none
    assert not garbled_altitudes(np.arange(50.0, 350.0, 10.0), np.ones(30, dtype=int)).any()


def test_codes_are_garbled_only_where_neighbours_disagree():
    """Which is worked out here one plot at a time."""
    rng = np.random.default_rng(4)
    levels = np.concatenate([rng.integers(0, 4, 40), 250 + np.arange(40) // 3, rng.integers(100, 120, 40)]).astype(
        float
    )
    levels[rng.integers(40, 120, 20)] = rng.choice([0, 257, 513], 20)
    identities, times = rng.integers(0, 4, 120), np.sort(rng.uniform(0, 2000, 120))
    codes = {*range(4), 256, 257, 258, 513}

    def step(k, among):
        same = [i for i in range(120) if i != k and identities[i] == identities[k] and among(i)]
        beside = [i for i in same if i < k][-3:] + [i for i in same if i > k][:3]
        near = [levels[i] for i in beside if abs(times[i] - times[k]) <= 300]
        return abs(levels[k] - np.median(near)) if len(near) >= 3 else None

    found = garbled_altitudes(levels, identities, [*codes], times)
    for k in range(120):
        coded = levels[k] in codes
        steps = [step(k, lambda i: levels[i] not in codes), step(k, lambda i: True) if coded else None]
        steps = [one for one in steps if one is not None] if identities[k] else []
        assert found[k] == (any(one > 30 for one in steps) or (coded and not steps)), k
    # on the ground, and climbing through 256 to 258: not garbled
    assert not garbled_altitudes([0, 1, 0, 2, 0], [7] * 5).any()
    assert not garbled_altitudes([253, 254, 256, 257, 258, 260], [7] * 6).any()
    assert garbled_altitudes([350, 351, 0, 352, 353], [7] * 5).tolist() == [False, False, True, False, False]
    assert garbled_altitudes([0, 0, 0, 0], [0] * 4).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"times": [1.0, 0.0]}, "times must not decrease, plot 1 does"),
        ({"ranges": [1.0, -1.0]}, "ranges must be 0 or more"),
        ({"ranges": [1.0]}, "ranges must have shape"),
        ({"identities": [1.5, 2.0]}, "identities must be whole numbers"),
        ({"identities": [-1, 2]}, "identities must be 0 or more"),
        ({"addresses": [-1, 2]}, "addresses must be 0 or more"),
        ({"altitudes": [np.inf, 1.0]}, "altitudes must be numbers or NaN"),
        ({"sources": [1]}, "sources must be whole numbers of shape"),
    ],
)
def test_a_recording_is_checked(change, message):
    with pytest.raises(InvalidInputError, match=message):
        Recording(**{"times": [0.0, 1.0], "ranges": [1.0, 1.0], "azimuths": [0.0, 0.0], **change})


def test_octal_codes(tmp_path):
    head = "time,range,bearing,{}\n1,1,1,{}\n"
    for name, told in (("squawk", "7700"), ("mode3_oct", "7700.0"), ("Mode3A_OCT", "7700")):
        assert read_plots(written(tmp_path, head.format(name, told))).identities.tolist() == [0o7700]
    assert read_plots(written(tmp_path, head.format("squawk", ""))).identities.tolist() == [0]
    assert read_plots(written(tmp_path, head.format("squawk", "902")), units={"mode3": "dec"}).identities[0] == 902
    with pytest.warns(AssocWarning, match="'squawk': 1 codes have an 8 or 9"):
        assert read_plots(written(tmp_path, head.format("squawk", "7780"))).notes["invalid codes"] == 1
    for told in ("10000", "-1", "7.5"):
        assert read_plots(written(tmp_path, head.format("squawk", told))).notes["invalid codes"] == 1
    with pytest.raises(InvalidInputError, match="expected dec or oct for the mode3"):
        read_plots(written(tmp_path, head.format("mode3", 1)), units={"mode3": "hex"})


@pytest.mark.parametrize(
    ("head", "ranges", "bearings", "message"),
    [
        (
            "time,range,bearing",
            [20_000, 5_000],
            [10, 200],
            "'range': 20000 nmi are 37,040 km",
        ),
        (
            "time,range,bearing",
            range(20, 32),
            [0.5 * k for k in range(12)],
            "'bearing': all within 5.5 deg",
        ),
        ("time,range_m,bearing", [20_000, 5_000], [1, 2], None),
        ("time,range,bearing", range(20, 32), [3 + 0.2 * k for k in range(12)], None),  # a sector
    ],
)
def test_units_that_are_hardly_meant_are_told(tmp_path, head, ranges, bearings, message):
    rows = "".join(f"{t},{r},{b}\n" for t, (r, b) in enumerate(zip(ranges, bearings, strict=True)))
    file = written(tmp_path, f"{head}\n{rows}")
    with warnings.catch_warnings() if message is None else pytest.warns(AssocWarning, match=message):
        read_plots(file)


# as tools of several makes write them: time, nautical miles, degrees, code, flight level
NOON = 1626098402.5
FOUND = [
    ("time;Range [NM];Azimuth (°);Mode 3/A;Flight Level\r\n12:00:01,5;20,5;45,25;4521;85\r\n", (43201.5, 0o4521, 85)),
    ("\ufeffTimestamp,Range (km),brg,squawk,FL\n2021-07-12T14:00:02.5Z,37.966,45.25,4521,85\n", (NOON, 0o4521, 85)),
    ("utc\trho_m\taz\tMode A\tAlt_feet\n2021-07-12 14:00:02,5\t37966\t45,25\t4521\t8500\n", (NOON, 0o4521, 85)),
    ("time;rho_m;az;squawk;FL\n12.07.2021 14:00:02,5;37966;45,25;4521;85\n", (NOON, 0o4521, 85)),
    ("Zürich;time;range;theta;mode_c\n12:00;1,5;20,5;45,25;\n", (1.5, 0, math.nan)),
]


@pytest.mark.parametrize(("text", "expected"), FOUND)
@pytest.mark.parametrize("encoding", ["utf-8", "cp1252"])
def test_files_as_people_have_them(tmp_path, text, expected, encoding):
    found = read_plots(written(tmp_path, text.encode(encoding, "ignore")))
    assert (found.times[0], found.identities[0], found.altitudes[0] / 30.48) == pytest.approx(expected, nan_ok=True)
    assert (found.ranges[0] / 1852, np.degrees(found.bearings[0])) == pytest.approx((20.5, 45.25))

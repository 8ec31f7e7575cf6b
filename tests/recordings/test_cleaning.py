"""Plots as people have them: one file of plots, spoiled in each way, gives the plots of the clean one, and says so."""

import gzip
from datetime import datetime

import numpy as np
import pandas as pd
import pytest

from assoc import track
from assoc.recordings import read_plots
from assoc.recordings.flights.table import seconds_of
from tests.recordings.common import circling


@pytest.fixture(scope="module")
def rows():
    """Plots of a turning radar from noon on: seconds, nautical miles, degrees, octal digits, flight levels."""
    recording = circling()
    return [
        (43_200 + round(time, 3), round(distance / 1852, 4), round(float(bearing), 4), f"{code:04o}", 200 + code)
        for time, distance, bearing, code in zip(
            recording.times.tolist(), recording.ranges.tolist(), np.degrees(recording.bearings), recording.identities,
            strict=True,
        )
    ]  # fmt: skip


def table(rows, head="time,range,bearing,squawk,fl", separator=","):
    return "\n".join([head, *(separator.join(map(str, row)) for row in rows)]) + "\n"


def read(folder, text, **options):
    (folder / "plots.csv").write_text(text)
    return read_plots(folder / "plots.csv", **options)


def same(found, expected):
    for name in ("times", "ranges", "azimuths", "identities", "altitudes"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(expected, name), atol=0.1 if name == "ranges" else 2e-3, err_msg=name
        )


def test_repeats_exact_and_by_another_line_of_the_feed(rows, tmp_path):
    clean = read(tmp_path, table(rows))
    assert not clean.notes and len(clean) == len(rows)
    later = [(round(time + 0.04, 3), *rest) for time, *rest in rows]
    found = read(tmp_path, table(sorted([*rows, *later[::2], *rows[::4]])))
    same(found, clean)
    assert found.notes == {
        "repeated rows left out": len(rows[::4]),
        "repeated rows left out, with times up to 0.25 s later": len(later[::2]),
    }
    # what stands there again after a turn is measured again
    assert len(read(tmp_path, table([(time, 20, 30, "1200", 50) for time in (1, 5, 9)]))) == 3


@pytest.mark.parametrize(
    ("step", "start", "head"),
    [(1e-3, 0, "time"), (1e-3, 0, "time_ms"), (1e-3, 0, "Time [ms]"), (1e-3, 1.7e9, "t"), (1e-6, 1.7e9, "t"),
     (1e-9, 1.7e9, "utc"), (1.0, 1.7e9, "time_utc"), (1.0, 0, "Time [s]")],
)  # fmt: skip
def test_times_in_milliseconds_of_the_day_or_of_an_epoch(rows, tmp_path, step, start, head):
    start = int(start)
    told = [(round((start + time) / step) if step < 1 else start + time, *rest) for time, *rest in rows]
    found = read(tmp_path, table(told, f"{head},range,bearing,squawk,fl"))
    np.testing.assert_allclose(found.times - start, [row[0] for row in rows], atol=2e-3)
    assert any("steps of" in what for what in found.notes) == (step < 1 and "ms" not in head)


def test_dates_far_away_are_seconds_as_others_are():
    """Nanoseconds of 64 bits end in the year 2262: pandas raised an error of its own."""
    dates = pd.Series(["2024-01-01 00:00:00.5", "3024-01-01T02:00:00+02:00", "soon"])
    there = "2024-01-01 00:00:00.5+00:00", dates[1]
    seconds = [datetime.fromisoformat(date).timestamp() for date in there]
    assert seconds_of(dates)[:2].tolist() == seconds and np.isnan(seconds_of(dates)[2])


def test_seconds_of_some_days_are_no_milliseconds(rows, tmp_path):
    told = [(round(time) + 86_400 * 3, *rest) for time, *rest in rows]
    assert read(tmp_path, table(told)).times[0] == told[0][0]


@pytest.mark.parametrize("blank", ["", "NaN", "nan", "NA", "N/A", "null", "None", "-"])
def test_blanks_in_all_spellings(rows, tmp_path, blank):
    spoiled = [(time, blank if k == 7 else r, b, blank if k == 3 else c, blank if k == 5 else fl)
               for k, (time, r, b, c, fl) in enumerate(rows)]  # fmt: skip
    found = read(tmp_path, table(spoiled))
    assert len(found) == len(rows) - 1 and found.notes == {"rows without time, range or bearing left out": 1}
    assert found.identities[3] == 0 and np.flatnonzero(np.isnan(found.altitudes)).tolist() == [5]


def test_values_that_cannot_be(rows, tmp_path):
    wrong = [(rows[4][0], -5, 10, 1200, 50), (rows[4][0], 20, 99999, 1200, 50), (rows[4][0], 30, 40, 1200, 1e9)]
    found = read(tmp_path, table([*rows[:5], *wrong, *rows[5:]]))
    assert len(found) == len(rows) + 1 and np.isnan(found.altitudes).sum() == 1
    assert found.notes == {
        "rows left out whose time, range or bearing cannot be": 2,
        "altitudes that cannot be, taken for missing": 1,
    }


@pytest.mark.parametrize(
    ("head", "before", "separator"),
    [
        ("Time,Slant Range (NM),Azimuth [deg],Mode3A,FlightLevel", "", ","),
        ("TIME;RANGE;BEARING;ModeA;ModeC", "sep=;\n", ";"),
        ("time|range|bearing|squawk|fl", "sep=|\n", "|"),
        ("time,range,bearing,SSR code,Mode-C", "# recorded at noon\n# of one radar\n\n", ","),
        ("# time range_nmi bearing squawk fl".replace(" ", ",").replace("#,", "# "), "", ","),
        ("t,RangeNM,az,Mode 3/A,Alt FL\n[s],[NM],[deg],,FL", "", ","),
    ],
)
def test_names_comments_and_separators(rows, tmp_path, head, before, separator):
    clean = read(tmp_path, table(rows))
    text = before + table(rows, head, separator).replace("\n43", "\n# by hand\n43", 1)
    found = read(tmp_path, text)
    same(found, clean)
    lines = text.splitlines()
    assert [float(lines[line - 1].split(separator)[0]) for line in found.lines] == [row[0] for row in rows]


def test_a_row_of_units_counts_where_names_and_callers_say_none(rows, tmp_path):
    head = "time,range,bearing,squawk,alt\ns,km,deg,,ft"
    found = read(tmp_path, table([(t, round(r * 1.852, 4), b, c, 100 * fl) for t, r, b, c, fl in rows], head))
    same(found, read(tmp_path, table(rows)))
    assert read(tmp_path, table(rows, head), units={"range": "m"}).ranges[0] == rows[0][1]


def test_a_flight_level_in_letters_is_a_height(rows, tmp_path):
    for head, step in (("fl", 30.48), ("altitude_ft", 30.48), ("altitude_m", 30.48)):
        found = read(tmp_path, table([(*row[:4], "FL298") for row in rows], f"time,range,bearing,squawk,{head}"))
        assert found.altitudes == pytest.approx(298 * step)


def test_columns_that_are_not_read_are_named(rows, tmp_path):
    found = read(tmp_path, table([(*row, 1, 2) for row in rows], "time,range,bearing,squawk,flightlvel,speed,site"))
    assert found.notes == {"columns not read (flightlvel (flight_level?), speed, site)": 3}
    assert "columns not read" in found.summary()


def test_the_kind_of_a_file_is_found_by_its_content(rows, tmp_path):
    clean, text = read(tmp_path, table(rows)), table(rows).encode()
    for name, content in (("plots.csv", gzip.compress(text)), ("plots", text), ("plots.gz", text), ("a.ast", text)):
        (tmp_path / name).write_bytes(content)
        same(read_plots(tmp_path / name), clean)
    pytest.importorskip("pyarrow")
    import pandas as pd

    frame = pd.DataFrame(rows, columns=["time", "range", "bearing", "squawk", "fl"])
    frame.to_parquet(tmp_path / "table.parquet")
    (tmp_path / "table.parquet").rename(tmp_path / "table.bin")
    same(read_plots(tmp_path / "table.bin"), clean)


def test_errors_of_all_files_in_one_round(tmp_path, capsys):
    for name, text in (("a.csv", "time,range\n"), ("b.csv", "time,range,bearing\n1,x,2\n"), ("c.csv", "")):
        (tmp_path / name).write_text(text)
    files = [str(tmp_path / name) for name in ("a.csv", "b.csv", "c.csv")]
    assert track.main([*files, "-o", str(tmp_path / "tracks.csv")]) == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 3 and all(file in line for file, line in zip(files, told, strict=True))
    (tmp_path / "radars.toml").write_text(
        "".join(f"[[radar]]\nfile = '{name}.csv'\nplace = [50, 8, 0]\n" for name in "abc")
    )
    assert track.main([str(tmp_path / "radars.toml"), "-o", str(tmp_path / "tracks.csv")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 3

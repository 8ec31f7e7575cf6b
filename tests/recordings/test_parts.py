"""A recording read and grouped part by part is the same as one read and grouped at once."""

import numpy as np
import pandas as pd
import pytest

from assoc.errors import InvalidInputError
from assoc.recordings import clustering_time_window, estimate_rotation, radar_of, read_plots, reading
from assoc.recordings.recording import RECORDED
from assoc.recordings.survey import StoredPlots, Survey
from assoc.recordings.windows import windows_in_turn
from assoc.simulation import simulate_recording
from tests.recordings.common import circling


@pytest.fixture(scope="module")
def table():
    """Rows with all that reading must mend, over some turns with a gap of minutes."""
    recording = simulate_recording("rotating-radar", 3).recording
    rng = np.random.default_rng(1)
    times = np.round(recording.times + np.where(recording.times > 600, 300.0, 0.0), 3)
    frame = pd.DataFrame({
        "time": times, "range": np.round(recording.ranges / 1852.0, 3), "bearing": np.degrees(recording.bearings),
        "squawk": [int(f"{code:o}") for code in recording.identities], "altitude": recording.altitudes / 30.48,
    })  # fmt: skip
    frame = frame.iloc[np.argsort(times + rng.uniform(0, 20, len(times)), kind="stable")]
    return frame.iloc[np.sort(np.append(np.arange(len(frame)), np.arange(0, len(frame), 37)))].reset_index(drop=True)


def same(one, other):
    for name in (*RECORDED, "sources"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    assert one.notes == other.notes


@pytest.mark.parametrize("rows", [50, 1000])
def test_parts_change_nothing(table, tmp_path, rows):
    paths = [tmp_path / "p.csv", tmp_path / "p.parquet", tmp_path / "comma.csv"]
    table.to_csv(paths[0], index=False)
    table.to_parquet(paths[1], index=False)
    table.to_csv(paths[2], index=False, sep=";", decimal=",")
    # cell by cell, as a table with quotes is read
    quoted = tmp_path / "quoted.csv"
    table.to_csv(quoted, index=False, quoting=1, quotechar='"')
    expected = read_plots(quoted)
    assert expected.notes["late plots sorted in"] > 100 and expected.notes["repeated rows left out"] > 10
    for path in paths:
        same(reading.PlotReader(path, at_once=rows).together(), expected)
    parts = [*reading.PlotReader(paths[0], at_once=rows)]
    assert len(parts) > 1
    stored = StoredPlots(parts)
    for part, again in zip(parts, stored, strict=True):
        same(part, again)
    surveys = [Survey([expected]), stored.survey]
    assert surveys[0].summary({}) == surveys[1].summary({})
    assert estimate_rotation(stored) == estimate_rotation(expected)
    given = {"range_noise": None, "azimuth_noise": 1e-3}
    assert radar_of(stored.survey, **given) == radar_of(expected, **given)
    for by in ("antenna", "time"):
        one, other = clustering_time_window(expected, 9.5, by=by), [*windows_in_turn(stored, stored.survey, 9.5, by=by)]
        assert [window.number for window in one] == [window.number for window in other]
        for a, b in zip(one, other, strict=True):
            np.testing.assert_array_equal(a.rows, b.rows)
            np.testing.assert_array_equal(a.measurements, b.measurements)


def test_windows_are_made_as_plots_come():
    recording, taken = circling(turns=60), []

    def parts():
        for rows in np.array_split(np.arange(len(recording)), 20):
            taken.append(len(rows))
            yield recording.take(rows)

    windows = windows_in_turn(parts(), Survey([recording]), 9.5)
    next(windows)
    assert len(taken) <= 6


@pytest.mark.parametrize("line", ["1,2,x,1,5", "1,,3,1,5", "0,0,0,0,0", "1,2,3,1,nan", "5,-2,3,1,5", "1,2,3,1.5,5"])
def test_an_unusual_row_is_treated_alike_wherever_it_stands(tmp_path, line):
    rows = [f"{k},{10 + k},{k % 360},1,100" for k in range(30)]
    found = []
    for count in (30_000, 7):
        (tmp_path / "p.csv").write_text("\n".join(["time,range,bearing,mode3,altitude", *rows[:20], line, *rows[20:]]))
        try:
            found.append({**reading.PlotReader(tmp_path / "p.csv", at_once=count).together().notes})
        except InvalidInputError as error:
            found.append(str(error))
    assert found[0] == found[1]
    assert isinstance(found[0], dict) or "line 22" in found[0]

"""Windows hold each aircraft once, as the antenna does; rotation times are found; other groupings are as described."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from assoc.errors import InvalidInputError
from assoc.recordings import (
    clustering_time_window,
    estimate_rotation,
    irregular_groups,
    read_plots,
)
from tests.recordings.common import GROUPS_WITH_WINDOW, TABLE_2_1, circling


def table(folder):
    path = folder / "table.csv"
    path.write_text(TABLE_2_1)
    return read_plots(path)


def test_the_papers_windows(tmp_path):
    recording = table(tmp_path)
    windows = clustering_time_window(recording, 9.5, by="time")
    found = [
        {(round(z[0] / 1852), int(one)) for z, one in zip(w.measurements, w.identities, strict=True)} for w in windows
    ]
    assert found[:2] == GROUPS_WITH_WINDOW
    assert [len(w) for w in windows] == [8, 6, 6]
    # by the antenna, 906 (bearing 212 deg, before 902's 221) opens the second turn and not ends the first
    assert [len(w) for w in clustering_time_window(recording, 9.5)] == [7, 7, 6]
    assert estimate_rotation(recording) == pytest.approx(9.5, abs=0.15)


def holds_each_once(recording, windows):
    rows = np.concatenate([w.rows for w in windows])
    assert np.sort(rows).tolist() == list(range(len(recording)))
    assert all(len(np.unique(recording.sources[w.rows])) == len(w) for w in windows)
    assert all((np.diff(w.times) >= 0).all() for w in windows)
    assert [w.number for w in windows] == sorted({w.number for w in windows})
    for w in windows:
        assert (w.times == recording.times[w.rows]).all()
        assert (w.measurements == recording.measurements[w.rows]).all()


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.sampled_from([4.0, 9.5, 12.0]), st.sampled_from([0.0, 0.1]))
def test_each_aircraft_once_in_a_window(seed, turn, jitter):
    # the sector from 100 to 160 deg stays empty, and is found
    bearings = np.radians(160 + 300 * np.random.default_rng(seed).random(8))
    recording = circling(turn=turn, turns=20, seed=seed, jitter=jitter * turn, bearings=bearings)
    windows = clustering_time_window(recording, turn)
    holds_each_once(recording, windows)
    assert len(windows) <= 21


def test_stamps_in_whole_seconds_and_an_estimated_rotation():
    recording = circling(turns=60, step=1.0, bearings=np.radians([170, 200, 240, 280, 300, 350, 10, 40, 60]))
    estimated = estimate_rotation(recording)
    assert estimated == pytest.approx(9.5, abs=0.01)
    windows = clustering_time_window(recording)
    holds_each_once(recording, windows)
    # cut by time alone, rounded stamps put an aircraft into a window twice
    by_time = clustering_time_window(recording, 9.5, by="time")
    assert any(len(np.unique(recording.sources[w.rows])) < len(w) for w in by_time)


@pytest.mark.parametrize("turn", [2.5, 4.8, 9.5, 12.0, 28.0])
def test_the_rotation_is_found(turn):
    assert estimate_rotation(circling(turn=turn, turns=60)) == pytest.approx(turn, rel=1e-3)


def test_bearings_that_count_the_other_way_are_named():
    recording = circling(turns=60)
    mirrored = replace(recording, azimuths=np.pi - recording.azimuths)
    with pytest.raises(InvalidInputError, match="no rotation time .* fits the plots .* if bearings count counter-cl"):
        estimate_rotation(mirrored)
    noise = replace(recording, azimuths=np.random.default_rng(1).uniform(-3, 3, len(recording)))
    with pytest.raises(InvalidInputError, match=r"of 1\): give it$"):
        estimate_rotation(noise)


def test_groups_without_a_window():
    recording = circling(turns=400)
    groups = irregular_groups(recording, np.random.default_rng(3))
    assert np.concatenate([g.rows for g in groups]).tolist() == list(range(len(recording)))
    span = recording.times[-1] - recording.times[0]
    assert span / (groups[-1].number + 1) == pytest.approx(6.2, rel=0.15)
    # some are longer than a rotation: an aircraft is in them twice
    assert any(len(np.unique(recording.sources[g.rows])) < len(g) for g in groups)
    again = irregular_groups(recording, np.random.default_rng(3))
    assert [g.rows.tolist() for g in again] == [g.rows.tolist() for g in groups]
    with pytest.raises(InvalidInputError, match="mean, shape"):
        irregular_groups(recording, np.random.default_rng(0), mean=-1.0)

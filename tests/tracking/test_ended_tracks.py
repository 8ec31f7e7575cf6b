"""Tracks that are written as they end are those of a table that holds them all."""

import weakref

import numpy as np
import pandas as pd
import pytest

from assoc import track
from assoc.errors import LimitExceededError
from assoc.recordings import radar_of, write_plots
from assoc.recordings.windows import windows_of
from assoc.simulation import simulate_recording
from assoc.tracking import TRACKERS
from assoc.tracking.filter_choice import make_filter
from assoc.tracking.offline import plots
from assoc.tracking.offline.ended_smoothing import EndedSmoothing
from assoc.tracking.offline.ended_tracks import EndedTracks
from assoc.tracking.state import may_return

WORDS = ["-q", "--range-noise", "300", "--bearing-noise", "0.1", "--rotation", "9.5"]


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    recording = simulate_recording("rotating-radar", 4, aircraft=8, duration=850.0).recording
    # tracks end, and others begin
    half = (recording.azimuths > 0) == (recording.times < 250.0)
    write_plots("plots.csv", recording.take(half))
    return tmp_path


@pytest.mark.slow
def test_rows_are_those_of_a_whole_table(here):
    """A report needs all tracks at once."""
    for words in (["-o", "t.csv"], ["-o", "whole.csv", "--report", "r.html"]):
        assert track.main(["plots.csv", *words, *WORDS]) == 0
    texts = {"mode3_oct": str, "address_hex": str, "target": str}
    found, expected = (pd.read_csv(name, dtype=texts) for name in ("t.csv", "whole.csv"))
    assert len(found) > 80 and found.track_id.nunique() > 5
    order = ["time", "track_id"]
    again = found.sort_values(order, ignore_index=True)
    pd.testing.assert_frame_equal(again, expected.sort_values(order, ignore_index=True), check_exact=True)
    # track by track, those that ended first before those of the end
    assert (np.diff(found.track_id) != 0).sum() == found.track_id.nunique() - 1
    assert (found.groupby("track_id").time.diff().dropna() > 0).all()
    ends = found.groupby("track_id", sort=False).time.max()
    assert ends.iloc[0] < 500.0 and ends.iloc[-1] > 750.0
    assert track.main(["plots.csv", "-o", "t.parquet", *WORDS]) == 0
    table = pd.read_parquet("t.parquet")
    assert [*table.columns] == [*found.columns]
    for name in found:
        if table[name].dtype.kind in "fib":
            np.testing.assert_array_equal(table[name].to_numpy(), found[name].to_numpy())
        else:
            assert (table[name].astype(str) == found[name].fillna("")).all()


def test_tracks_are_smoothed_as_they_end(here, monkeypatch, capsys):
    """To the same bytes as all at once, for a report; measurements of tracks that have ended are gone."""
    monkeypatch.setattr(plots, "FORGET", 2)
    taken, seen = [], []

    class Seen(EndedSmoothing):
        def take(self, step, measurements, *rest):
            super().take(step, measurements, *rest)
            taken.append(weakref.ref(measurements[0]))

        def end(self, living):
            table = super().end(living)
            seen.append((len(table), sum(one() is not None for one in taken)))
            return table

    words = ["plots.csv", "--smooth", "--tracker", "mht", *WORDS, "-o"]
    assert track.main([*words, "whole.csv", "--report", "r.html"]) == 0
    monkeypatch.setattr("assoc.tracking.offline.ended_smoothing.EndedSmoothing", Seen)
    capsys.readouterr()
    assert track.main([*words, "t.csv"]) == 0
    assert "warning" not in capsys.readouterr().err
    assert (here / "t.csv").read_bytes() == (here / "whole.csv").read_bytes()
    assert sum(rows for rows, _ in seen[:-1]) > 30 and seen[-1][0] > 30
    assert seen[-2][1] < 0.9 * len(taken)


def test_nothing_half_written_takes_the_name(here, monkeypatch, capsys):
    """Tracking is made to fail in the middle: no small recording ends the memory there."""
    (here / "t.csv").write_text("before\n")
    plain = plots.follow

    def broken(*arguments, **options):
        for number, one in enumerate(plain(*arguments, **options)):
            if number == 40:
                raise LimitExceededError("no more memory")
            yield one

    monkeypatch.setattr(plots, "follow", broken)
    assert track.main(["plots.csv", "-o", "t.csv", *WORDS]) == 3
    assert (here / "t.csv").read_text() == "before\n"
    assert sorted(path.name for path in here.iterdir()) == ["plots.csv", "t.csv"]


class Parts:
    """Takes parts of a table."""

    parquet = True

    def __init__(self):
        self.ids = []

    def add(self, part):
        self.ids += part.track_id.tolist()


def test_a_track_is_written_when_it_has_ended_and_not_before():
    parts = Parts()
    table = EndedTracks(parts, None, False)
    living = [{1, 2}, {2}, {2}, {2, 3}, {3}, {3}]
    written = []
    for time, ids in enumerate(living):
        rows = sorted(ids)
        columns = dict.fromkeys(("x", "nis"), 0.0) | {"confirmed": True, "consistent": True, "status": "confirmed"}
        table.add_frame(pd.DataFrame({"track_id": rows, "time": float(time), **columns}))
        table.end(ids)
        written.append([*parts.ids])
    # one call later, so that a track that comes back soon is still one
    assert written == [[], [], [1], [1], [1], [1, 2, 2, 2, 2]]
    table.finish()
    assert parts.ids == [1, 2, 2, 2, 2, 3, 3, 3]
    assert len(table) == 8 and table.confirmed_ids() == {1, 2, 3}


def test_a_track_that_may_return_has_not_ended():
    """In a multiple hypothesis tracker tracks leave the best hypothesis, and come back."""
    recording = simulate_recording("rotating-radar", 0, aircraft=20, duration=300.0).recording
    recording = recording.take(np.random.default_rng(0).random(len(recording)) < 0.6)
    radar = radar_of(recording, range_noise=300.0, azimuth_noise=2e-3)
    tracker = TRACKERS["mht"]([radar], make_filter("ekf", [radar], None, 0))
    listed, seen, ended, left = set(), set(), set(), set()
    groups = windows_of(recording, ((recording.times - recording.times[0]) / 3.0).astype(np.int64))
    for followed in plots.follow(tracker, groups):
        before, listed = listed, {*followed.listed(False)[0].track_id.tolist()}
        assert not listed & ended
        left |= before - listed
        seen |= listed
        ended |= seen - may_return(tracker.state)
    assert left - ended and ended

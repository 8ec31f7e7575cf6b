"""Recordings of several files, tracked in slices of time: the tracks of one process, and what becomes of damage."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest

from assoc import solve, track
from assoc.recordings import fixed_groups, radar_of, write_plots
from assoc.simulation import simulate, simulate_recording
from assoc.tracking import TRACKERS
from assoc.tracking.offline.slices import Stitching, TrackSlice, _same, slices_of
from tests.running import process
from tests.sizes import sample

WORDS = ["--no-adapt", "-q", "--range-noise", "300", "--bearing-noise", "0.1", "--rotation", "9.5"]


@pytest.fixture(scope="module")
def recording():
    return simulate_recording("rotating-radar", 4, aircraft=8, duration=420.0).recording


@pytest.fixture
def here(tmp_path, monkeypatch, recording):
    monkeypatch.chdir(tmp_path)
    write_plots("all.csv", recording)
    return tmp_path


def run(words, output, capsys):
    """Exit code, the tracks, and what was said of errors."""
    code = track.main([*words, "-o", output, *WORDS])
    said = capsys.readouterr()
    return code, pd.read_csv(output) if os.path.exists(output) else None, said.out + said.err


def check_same(one, other):
    """The same tracks under other ids: at each time as many, each near its own, each with its start and its hits."""
    assert len(one) == len(other)
    pairs = one.merge(other, on="time", suffixes=("", "_other"))
    pairs["off"] = np.hypot(pairs.x - pairs.x_other, pairs.y - pairs.y_other)
    pairs = pairs.sort_values("off").drop_duplicates(["time", "track_id"])
    assert len(pairs) == len(one) and pairs.off.max() < 20.0 and pairs.off.median() < 0.01
    assert (pairs.groupby("track_id").track_id_other.nunique() == 1).all()
    assert (pairs.groupby("track_id_other").track_id.nunique() == 1).all()
    for column in ("hits", "started", "last_detection", "status", "altitude"):
        assert (pairs[column] == pairs[f"{column}_other"]).all(), column
    assert (pairs.score - pairs.score_other).abs().max() < 0.01


@sample("tracker", ["nearest-neighbour", "mht"], every=2)
def test_slices_make_the_tracks_of_one_process(here, capsys, tracker):
    code, one, _ = run(["all.csv", "--tracker", tracker], "one.csv", capsys)
    assert code == 0
    code, cut, _ = run(["all.csv", "--tracker", tracker, "--slice", "120"], "cut.csv", capsys)
    assert code == 0 and not os.path.exists("cut.csv.slices")
    # most tracks cross borders
    assert (one.groupby("track_id").time.agg(lambda times: times.max() - times.min()) > 240.0).sum() >= 5
    check_same(one, cut)


def test_slices_tell_odd_identities_once(here, capsys):
    plots = pd.read_csv("all.csv")
    one, other = plots.mode3[plots.mode3 > 0].value_counts().index[:2]
    plots.loc[plots.mode3 == one, "mode3"] = other
    plots.to_csv("all.csv", index=False)
    said, code = [], f"code {other:04o} is that of tracks "
    for more in ([], ["--slice", "120"]):
        words = ["all.csv", "--tracker", "nearest-neighbour", "-o", "t.csv", *more, *WORDS]
        assert track.main([word for word in words if word != "-q"]) == 0
        said.append([line for line in capsys.readouterr().out.splitlines() if code in line])
    assert len(said[0]) == len(said[1]) == 1
    assert said[0][0].rpartition(", ")[2] == said[1][0].rpartition(", ")[2]


def test_stitching_is_by_as_many_common_plots_as_possible():
    before, early = np.repeat([7, 8, 8, 9, -1], [3, 1, 3, 4, 2]), np.repeat([1, 1, 2, 3, 3], [3, 1, 3, 4, 2])
    assert _same(before, early) == {1: 7, 2: 8, 3: 9}
    # greedily 2 would be 7, and 1 nothing
    before, early = np.repeat([7, 8, 7], [3, 2, 4]), np.repeat([1, 1, 2], [3, 2, 4])
    assert _same(before, early) == {1: 8, 2: 7}
    assert _same(np.array([-1, 3]), np.array([4, -1])) == {}


def test_what_is_done_is_kept_and_what_is_missing_is_named(here, capsys, monkeypatch):
    """A slice is made to fail: no small recording makes one of its slices alone too large."""
    tracked, broken = [], {2}

    def call(self, part):
        tracked.append(part.number)
        return (part.number, "the disk is damaged") if part.number in broken else self._tracked(part)

    words = ["all.csv", "--tracker", "nearest-neighbour", "--slice", "100"]
    assert run(words, "whole.csv", capsys)[0] == 0
    monkeypatch.setattr(TrackSlice, "__call__", call)
    code, cut, said = run(words, "cut.csv", capsys)
    assert code == 3 and "written without the slice from" in said and "the disk is damaged" in said
    assert said.count("\n") == 1 and set(tracked) == set(range(max(tracked) + 1))
    whole = pd.read_csv("whole.csv")
    gap = whole[~whole.time.isin(cut.time)]
    assert 60.0 < np.ptp(gap.time) < 100.0 and len(whole) == len(cut) + len(gap)
    # a slice that was damaged meanwhile is done again
    (folder,) = os.listdir("cut.csv.slices")
    with open(f"cut.csv.slices/{folder}/00001.npz", "r+b") as file:
        file.truncate(1000)
    tracked.clear()
    broken.clear()
    code, cut, _ = run(words, "cut.csv", capsys)
    assert code == 0 and tracked == [1, 2] and not os.path.exists("cut.csv.slices")
    pd.testing.assert_frame_equal(cut, whole)


def test_damaged_empty_and_overlapping_files_are_named_and_the_rest_is_tracked(here, capsys, recording):
    words = ["--tracker", "nearest-neighbour"]
    _, one, _ = run(["all.csv", *words], "one.csv", capsys)
    code, many, said = run([*in_hours(recording), *words], "many.csv", capsys)
    assert code == 3 and all(said.count(line) == 2 for line in OF_FILES)
    pd.testing.assert_frame_equal(one[["track_id", "time", "hits"]], many[["track_id", "time", "hits"]])
    code, _, said = run(["empty.csv", "damaged.parquet", *words], "none.csv", capsys)
    assert code == 2 and "empty.csv: holds no plots" in said and not os.path.exists("none.csv")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["all.csv", "--slice", "100", "--smooth"], "--slice, --jobs, --scheduler: leave out --smooth"),
        (["all.csv", "--jobs", "2", "--scheduler", "tcp://127.0.0.1:9"], "give --jobs or --scheduler, not both"),
        (["all.csv", "scene.npz"], "scene.npz: only recorded plots may be in several files"),
        (["all.csv", "--slice", "0"], "--slice: expected a number above 0"),
    ],
)
def test_refusals(here, capsys, words, message):
    (here / "scene.npz").write_bytes(b"PK\x03\x04")
    code, tracks, said = run(words, "t.csv", capsys)
    assert code == 2 and tracks is None and message in said and said.count("\n") == 1


def test_ids_of_slices_with_a_gap_are_new(recording):
    tracker = TRACKERS["nearest-neighbour"]([radar_of(recording)])
    first, second, third, *_ = map(TrackSlice(tracker, True), slices_of(fixed_groups(recording, 9.5), 100.0, 60.0))
    shared = []
    for parts in ((first, second), (first, third)):
        stitching = Stitching()
        one, other = ({*stitching.add(part).frame.track_id} for part in parts)
        shared.append(len(one & other))
    assert shared[0] >= 5 and shared[1] == 0


SLICED = ["all.csv", "--tracker", "nearest-neighbour", "--slice", "60"]


def at_first(monkeypatch, do):
    """Do something when the first slice is done."""
    plain, done = os.replace, []

    def replace(source, target):
        plain(source, target)
        if target.endswith(".npz") and not done:
            done.append(do())

    monkeypatch.setattr(os, "replace", replace)


def test_slices_are_kept_until_the_tracks_are_written(here, capsys, monkeypatch):
    plain, saved = os.replace, []

    def replace(source, target):
        saved.append(os.path.basename(target))
        if saved[-1] == "t.csv":
            raise OSError(28, "No space left on device")
        plain(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", replace)
        code, tracks, said = run([*SLICED, "--rates", "r.csv"], "t.csv", capsys)
    assert code == 2 and tracks is None and "t.csv: cannot be written (No space left on device)" in said
    assert saved[:2] == ["00000.npz", "00001.npz"] and saved[-2:] == ["t.csv", "r.csv"]
    changed = {path: path.stat().st_mtime_ns for path in here.glob("t.csv.slices/*/*.npz")}
    assert len(changed) == len(saved) - 2
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", lambda source, target: saved.append(target) or plain(source, target))
        saved.clear()
        assert run(SLICED, "t.csv", capsys)[0] == 0
    assert len(saved) == 1 and not os.path.exists("t.csv.slices")


INTERRUPTED = """
import os, signal, sys, time
from assoc import track

plain = os.replace

def replace(source, target):
    plain(source, target)
    if target.endswith("00001.npz"):
        os.kill(os.getpid(), signal.SIGINT)
        for _ in range(1000):
            time.sleep(0.05)

os.replace = replace
sys.exit(track.start())
"""


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="needs POSIX signals")
@pytest.mark.parametrize("output", ["t.csv", "-"])
def test_after_an_interrupt_it_is_said_what_is_kept(here, capsys, monkeypatch, output):
    (here / "temporary").mkdir()
    monkeypatch.setenv("TMPDIR", str(here / "temporary"))
    done = process("-c", INTERRUPTED, *SLICED, *WORDS, "-o", output)
    kept = "; 2 slices are kept; the same command goes on from there" if output == "t.csv" else ""
    assert (done.returncode, done.stderr) == (130, f"assoc.track: interrupted{kept}\n")
    assert os.listdir("temporary") == []
    assert len([*here.glob("t.csv.slices/*/*.npz")]) == (2 if kept else 0)


def in_hours(recording):
    """Files of a day: in the wrong order, one without plots, one that is no table, and one that reaches back."""
    thirds = np.array_split(np.arange(len(recording)), 3)
    for name, rows in (("a", thirds[2]), ("b", np.append(thirds[1], thirds[2][:40])), ("c", thirds[0])):
        write_plots(f"{name}.csv", recording.take(rows))
    with open("empty.csv", "w") as file:
        file.write("time,range,bearing\n")
    with open("damaged.parquet", "wb") as file:
        file.write(b"PAR1 is not a table PAR1")
    return ["a.csv", "empty.csv", "b.csv", "damaged.parquet", "c.csv"]


OF_FILES = ("empty.csv: holds no plots", "damaged.parquet: is not a readable", "40 plots of a.csv, which are before")


@pytest.mark.slow
def test_on_a_cluster_what_is_missing_is_named_and_the_rest_goes_on(
    here, capsys, monkeypatch, recording, scheduler, start_worker
):
    files, tracker = in_hours(recording), SLICED[1:]
    workers = [start_worker(), start_worker()]
    assert run(SLICED, "one.csv", capsys)[0] == 0
    one = pd.read_csv("one.csv")
    # a worker is lost, and the slices that it had are done by the other
    with monkeypatch.context() as patch:
        at_first(patch, workers[0].kill)
        code, many, said = run([*files, *tracker, "--scheduler", str(scheduler)], "many.csv", capsys)
    assert code == 3 and all(said.count(line) == 2 for line in OF_FILES) and "the slice" not in said
    assert workers[0].wait(100) == -signal.SIGKILL
    pd.testing.assert_frame_equal(many[["track_id", "time", "hits"]], one[["track_id", "time", "hits"]])
    # the scheduler is lost, too; one of the slices that were done is damaged: other processes make good what is missing
    at_first(monkeypatch, scheduler.process.kill)
    code, part, said = run([*files, *tracker, "--scheduler", str(scheduler)], "rest.csv", capsys)
    assert code == 3 and "written without" in said and "the slice from" in said and len(part) < len(one)
    assert all(line in said for line in OF_FILES)
    (folder,) = os.listdir("rest.csv.slices")
    kept = sorted(os.listdir(f"rest.csv.slices/{folder}"))
    with open(f"rest.csv.slices/{folder}/{kept[0]}", "r+b") as file:
        file.truncate(100)
    code, rest, said = run([*files, *tracker, "--jobs", "2"], "rest.csv", capsys)
    assert code == 3 and "the slice" not in said and not os.path.exists("rest.csv.slices")
    pd.testing.assert_frame_equal(rest, many)


@pytest.mark.slow
def test_a_killed_program_is_resumed(here, capsys, recording, scheduler, start_worker):
    words = [*SLICED, "--scheduler", str(scheduler), *WORDS]
    start_worker()
    assert run(SLICED, "one.csv", capsys)[0] == 0
    process = subprocess.Popen([sys.executable, "-m", "assoc.track", *words, "-o", "many.csv"])
    deadline = time.monotonic() + 300
    while not [*here.glob("many.csv.slices/*/00000.npz")]:
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    process.kill()
    assert process.wait(100) == -signal.SIGKILL and not os.path.exists("many.csv")
    plain, written = os.replace, []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "replace", lambda source, target: written.append(target) or plain(source, target))
        code, many, _ = run([*SLICED, "--scheduler", str(scheduler)], "many.csv", capsys)
    # what was done is not done again
    assert code == 0 and os.path.basename(written[-1]) == "many.csv" and not os.path.exists("many.csv.slices")
    assert not any(target.endswith("00000.npz") for target in written)
    pd.testing.assert_frame_equal(many, pd.read_csv("one.csv"))


@pytest.mark.slow
def test_a_lost_process_is_made_good(here, capsys, monkeypatch):
    import psutil

    assert run(SLICED, "one.csv", capsys)[0] == 0

    def lose() -> None:
        # not the tracker of resources, which is a child, too
        workers = [one for one in psutil.Process().children() if any("_system.processes" in w for w in one.cmdline())]
        workers[0].kill()

    at_first(monkeypatch, lose)
    code, two, said = run([*SLICED, "--jobs", "2"], "two.csv", capsys)
    assert (code, said) == (0, "")
    pd.testing.assert_frame_equal(two, pd.read_csv("one.csv"))


@pytest.mark.slow
def test_a_real_cluster_gives_the_same_and_survives_losses(here, capsys, monkeypatch, scheduler, start_worker):
    workers = [start_worker(), start_worker()]
    assert run(SLICED, "one.csv", capsys)[0] == 0
    one = pd.read_csv("one.csv")
    with monkeypatch.context() as patch:
        at_first(patch, workers[0].kill)
        code, many, _ = run([*SLICED, "--scheduler", str(scheduler)], "many.csv", capsys)
    assert code == 0 and workers[0].wait(100) == -signal.SIGKILL
    pd.testing.assert_frame_equal(many, one)
    scene = simulate("crowd", 1, targets=60, scans=40)
    scene.save("scene.npz")
    results = []
    for words in ([], ["--scheduler", str(scheduler)], ["--scheduler", str(scheduler), "--tiles", "4"]):
        assert solve.main(["scene.npz", "--json", "r.json", "-q", *words]) == 0
        results.append(json.loads((here / "r.json").read_text())["scans"])
    for scans in results[1:]:
        assert [scan["tuples"] for scan in scans] == [scan["tuples"] for scan in results[0]]
        assert [scan["cost"] for scan in scans] == pytest.approx([scan["cost"] for scan in results[0]])
    capsys.readouterr()
    # the scheduler goes: what is missing is named, and other processes do it
    at_first(monkeypatch, scheduler.process.kill)
    code, part, said = run([*SLICED, "--scheduler", str(scheduler)], "rest.csv", capsys)
    assert code == 3 and "written without the slice from" in said and 0 < len(part) < len(one)
    code, rest, _ = run([*SLICED, "--jobs", "2"], "rest.csv", capsys)
    assert code == 0
    pd.testing.assert_frame_equal(rest, one)

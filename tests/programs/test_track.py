"""`python -m assoc.track` as a program."""

import os
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from assoc import track
from assoc._cli.track import options as track_options
from assoc.recordings import Recording, write_plots
from assoc.scene import Scene
from assoc.tracking import TRACKERS, MultiSensorTracker
from assoc.tracking.filter_choice import FILTERS, make_filter

NOISE = ["--range-noise", "100", "--bearing-noise", "0.115"]
COLUMNS = ["track_id", "time", "x", "y", "z", "vx", "vy", "vz"]


def plots(path, turns=20):
    """Two aircraft on straight paths, a radar that turns in 10 s, and some false plots."""
    rng = np.random.default_rng(0)
    rows = []
    start, velocity = np.array([[30e3, 10e3], [-40e3, 20e3]]), np.array([[-150.0, 60.0], [120.0, 100.0]])
    for k in range(turns):
        for i in range(2):
            t = 10.0 * k
            for _ in range(2):
                x, y = start[i] + t * velocity[i]
                t = 10.0 * k + 10.0 * (np.arctan2(x, y) % (2 * np.pi)) / (2 * np.pi)
            rows.append((t, np.hypot(x, y) + rng.normal(0, 100), np.arctan2(y, x) + rng.normal(0, 2e-3), 100 + i))
        if k % 3 == 0:
            bearing = rng.uniform(0, 2 * np.pi)
            rows.append((10.0 * k + 10 * bearing / (2 * np.pi), rng.uniform(1e4, 1e5), np.pi / 2 - bearing, 0))
    times, ranges, azimuths, ids = np.array(sorted(rows)).T
    write_plots(path, Recording(times, ranges, azimuths, ids.astype(int)))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_what_comes_by_a_pipe_is_read_once(tmp_path):
    pipe = tmp_path / "plots.csv"
    os.mkfifo(pipe)
    end = os.open(pipe, os.O_RDWR | os.O_NONBLOCK)
    try:
        os.write(end, b"time,range,bearing\n")
        assert not track._is_npz(str(pipe))
        assert os.read(end, 100) == b"time,range,bearing\n"
    finally:
        os.close(end)


def test_a_scene_as_a_program(run, scene_file, tmp_path):
    done = run("assoc.track", scene_file, "--tracker", "multi-sensor", "--solver", "aco", "--filter", "ekf",
               "-o", tmp_path / "tracks.csv")  # fmt: skip
    assert done.returncode == 0 and done.stderr == ""
    assert "3 confirmed tracks" in done.stdout and "GOSPA" in done.stdout
    assert re.search(r" ms a scan; \d+\.\d\d s more compiling$", done.stdout, re.M)
    table = pd.read_csv(tmp_path / "tracks.csv")
    assert list(table.columns[:8]) == COLUMNS
    assert table.track_id.nunique() == 3 and table.confirmed.all()


def test_program_and_online_use_agree(scene_file, tmp_path, capsys):
    words = [
        str(scene_file),
        "-o",
        str(tmp_path / "tracks.csv"),
        "--seed",
        "3",
        "--solver",
        "tabu",
        "--birth-rate",
        "0.3",
    ]
    assert track.main(words) == 0
    table = pd.read_csv(tmp_path / "tracks.csv")
    from assoc.tracking import Initiation

    scene = Scene.load(scene_file)
    tracker = MultiSensorTracker.for_scene(scene, solver="tabu", seed=3, initiation=Initiation(birth_rate=0.3))
    rows = []
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        tracker.step(scan.time, scan.measurements)
        rows += [(t.track_id, t.time, *t.position, *t.velocity) for t in tracker.tracks if t.confirmed]
    np.testing.assert_allclose(table[COLUMNS].to_numpy(), np.array(rows), rtol=1e-12)


@pytest.mark.parametrize("name", list(TRACKERS))
def test_every_tracker(name, scene_file, tmp_path, capsys):
    assert track.main([str(scene_file), "--tracker", name, "-o", str(tmp_path / "tracks.csv"), "--all"]) == 0
    # the last line does not name a solver that was never asked
    asked = "exact" if name in ("multi-sensor", "static") else "no solver used"
    assert f"{name}, {asked}: " in capsys.readouterr().out
    table = pd.read_csv(tmp_path / "tracks.csv")
    assert table[table.confirmed].track_id.nunique() >= 3
    assert set(track_options.TRACKERS) == set(TRACKERS) and set(track_options.FILTERS) == set(FILTERS)


def test_what_a_scene_does_not_allow_is_refused_before_it_is_tracked(scene_file, tmp_path, capsys):
    scene = Scene.load(scene_file)
    replace(scene, truth=None).save(tmp_path / "blind.npz")
    for file, option, message in (
        ("blind.npz", ["--cutoff", "100"], "blind.npz has no truth with which tracks are compared"),
        (scene_file, ["--registration", "online"], "exists no longer: trackers find biases by themselves"),
    ):
        assert track.main([str(tmp_path / file), *option, "-o", str(tmp_path / "tracks.csv")]) == 2
        told = capsys.readouterr()
        assert message in told.err and told.err.count("\n") == 1 and not (tmp_path / "tracks.csv").exists()


def test_no_track_starts_in_areas_that_the_user_draws(scene_file, tmp_path, capsys):
    """A box with a corner below 0, and a triangle: what starts there elsewhere, starts nowhere."""
    out, x = [str(tmp_path / name) for name in ("all.csv", "some.csv")], {}
    areas = ["--closed", "-5,-5 25e3,60e3", "--closed", "16e3,-9e3 70e3,-9e3 70e3,45e3"]
    for file, more in zip(out, ([], areas), strict=True):
        assert track.main([str(scene_file), "-o", file, "-q", "--all", "--tracker", "nn", *more]) == 0
        frame = pd.read_csv(file)
        x[file] = frame.groupby("track_id")[["x", "y"]].first().to_numpy()

    def inside(first):
        return (first[:, 0] < 25e3) | (first[:, 1] < first[:, 0] - 25e3)

    assert inside(x[out[0]]).sum() > 5 and len(x[out[1]]) and not inside(x[out[1]]).any()
    capsys.readouterr()
    for area, line in (
        ("1,2", "expected 2 corners of a box, or 3 or more"),
        ("1,2 3,x", "--closed: expected a number, got 'x'"),
        ("1,2 3,inf", "expected 2 corners of a box"),
        ("1,2 3,4,5", "expected 2 corners of a box"),
        ("1,2 1,4", "--closed: the corners enclose nothing"),
        ("0,0 1,1 2,2", "--closed: the corners enclose nothing"),
    ):
        assert track.main([str(scene_file), "-o", out[0], "--closed", area]) == 2
        said = capsys.readouterr().err
        assert line in said and len(said.splitlines()) == 1


@pytest.mark.parametrize("window", ["ctw", "ctw-time", "none"])
@pytest.mark.parametrize("name", ["mht", "nearest-neighbour"])
def test_plots_from_csv(window, name, tmp_path, capsys):
    plots(tmp_path / "plots.csv")
    words = [str(tmp_path / "plots.csv"), "--tracker", name, "--window", window, "-o", str(tmp_path / "tracks.csv")]
    turn = [] if window == "none" else ["--rotation", "10"]
    assert track.main([*words, *turn, "--false-alarms", "0.5", *NOISE, "--process-noise", "2"]) == 0
    table = pd.read_csv(tmp_path / "tracks.csv")
    last = table[table.time == table.time.max()]
    if window != "none":
        # one plot at a time, every other aircraft counts as missed: only with windows is this fair
        assert table.track_id.nunique() == 2
        where = np.array([[30e3, 10e3], [-40e3, 20e3]]) + table.time.max() * np.array([[-150.0, 60.0], [120.0, 100.0]])
        away = np.linalg.norm(last[["x", "y"]].to_numpy()[:, None] - where[None], axis=2)
        assert away.min(axis=0).max() < 1500
        np.testing.assert_allclose(np.sort(last.vx), [-150, 120], atol=15)
    assert "plots over" in capsys.readouterr().out


BAD = {
    "no file": (["absent.npz"], "absent.npz: no such file"),
    "tracker": (["SCENE", "--tracker", "mth"], "--tracker: unknown name 'mth'; known: multi-sensor"),
    "window for a scene": (["SCENE", "--window", "ctw"], "--window: is only for plots, not for scenes"),
    "identity unused": (["PLOTS", "--code-shared", "0.1"], "--code-shared: is only for --identity use"),
    "option of another": (["SCENE", "--max-hypotheses", "5"], "--max-hypotheses: is only for --tracker mht-hypothesis"),
    "noise": (["SCENE", "--process-noise", "-1"], "--process-noise: expected a number >= 0"),
    "targets of plots": (
        ["PLOTS", "--range-noise", "9", "--bearing-noise", "1", "--targets", "auto"],
        "auto needs a scene",
    ),
    "plots for scenes' tracker": (["PLOTS", "--tracker", "static"], "--tracker: static takes scenes"),
    "no steps": (["PLOTS"], "--range-noise: the plots do not come in steps"),
    "rotation without turns": (
        ["PLOTS", "--window", "none", "--rotation", "9"],
        "--rotation: is only for --window ctw",
    ),
    "overwrites": (["SCENE", "-o", "SCENE"], "would overwrite an input file"),
}


def test_all_missing_files_are_named_at_once(capsys):
    assert track.main(["one.csv", "two.csv", "-o", "tracks.csv"]) == 2
    told = capsys.readouterr().err.splitlines()
    assert told == [f"assoc.track: error: {name}.csv: no such file" for name in ("one", "two")]


@pytest.mark.parametrize("case", list(BAD))
def test_bad_input_is_one_line_and_code_2(case, scene_file, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    words, message = BAD[case]
    if "PLOTS" in words:
        plots(tmp_path / "plots.csv", 6)
    words = [{"SCENE": str(scene_file), "PLOTS": "plots.csv"}.get(word, word) for word in words]
    if "-o" not in words:
        words += ["-o", "tracks.csv"]
    assert track.main(words) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
    assert not (tmp_path / "tracks.csv").exists()


def test_too_many_tuples_is_code_3(scene_file, tmp_path, capsys):
    """Two hundred measurements of a target by each of three sensors make eight million tuples."""
    scene, rng = Scene.load(scene_file), np.random.default_rng(0)
    seen = next(rows for rows in scene.scan(0).true_tuples() if rows.all())
    each = zip(scene.measurements[0], seen - 1, scene.sensors, strict=True)
    many = [[rng.multivariate_normal(z[row], sensor.covariance, 200) for z, row, sensor in each]]
    replace(scene.part(0, 1), measurements=many, truth=None).save(tmp_path / "many.npz")
    assert track.main([str(tmp_path / "many.npz"), "-o", str(tmp_path / "tracks.csv")]) == 3
    assert "more than max_tuples = " in capsys.readouterr().err


def test_plots_are_judged_where_their_aircraft_are_known(tmp_path, capsys):
    from assoc.metrics import ct_mt_it
    from assoc.recordings import clustering_time_window, radar_of, read_plots
    from assoc.tracking.offline.plots import track_plots

    plots(tmp_path / "plots.csv")
    words = [str(tmp_path / "plots.csv"), "-o", str(tmp_path / "tracks.csv"), *NOISE]
    words += ["--rates", str(tmp_path / "rates.csv"), "--report", str(tmp_path / "r.html")]
    assert track.main(words) == 0
    printed = capsys.readouterr().out
    figures = [float(one) for one in re.findall(r"(?:CT|MT|IT) ([\d.]+) %", printed)]
    assert "aircraft known by Mode 3" in printed
    rates = pd.read_csv(tmp_path / "rates.csv")
    assert list(rates.columns) == ["window", "time", "plots", "ct", "mt", "it"]
    assert rates[["ct", "mt", "it"]].mean().to_numpy() == pytest.approx(figures, abs=0.06)
    # both aircraft fly straight: once their tracks are confirmed every plot is theirs, and keeps its track
    assert (rates[["ct", "mt"]].iloc[6:] == 100.0).all().all()
    recording = read_plots(tmp_path / "plots.csv")
    windows = clustering_time_window(recording)
    assert rates.plots.sum() == len(recording) == sum(len(window) for window in windows)
    # the rates are those of the plots' tracks: a tracker that gives nothing away has none
    radar = radar_of(recording, range_noise=100.0, azimuth_noise=2e-3)
    tracker = TRACKERS["mht"]([radar], make_filter("ekf", [radar], None, 0))
    done = track_plots(tracker, recording, windows)
    rows = np.concatenate([window.rows for window in windows])
    number = np.repeat(np.arange(len(windows)), [len(window) for window in windows])
    nobody = ct_mt_it(number, recording.aircraft[rows], np.full(len(rows), -1), np.zeros(len(rows), dtype=bool))
    assert done.rates.ct > 70 and nobody.ct == 0
    page = (tmp_path / "r.html").read_text()
    assert "CT, MT and IT of the windows" in page and all(f'"name":"{rate}"' in page for rate in ("CT", "MT", "IT"))


def test_speed_heading_and_altitude(tmp_path, capsys):
    recording = Recording(
        10.0 * np.arange(12), np.hypot(1e5, 250.0 * 10 * np.arange(12)), np.arctan2(250.0 * 10 * np.arange(12), 1e5),
        identities=np.full(12, 5), altitudes=np.full(12, 9144.0),
    )  # fmt: skip
    write_plots(tmp_path / "plots.csv", recording)
    out = tmp_path / "tracks.csv"
    assert track.main([str(tmp_path / "plots.csv"), "-o", str(out), "--rotation", "10", *NOISE]) == 0
    capsys.readouterr()
    table = pd.read_csv(out)
    start = table.columns.get_loc("heading")
    assert [*table.columns[start : start + 6]] == ["heading", "altitude", "status", "parent", "nis", "consistent"]
    last = table.iloc[-1]
    # northward at 250 m/s, at flight level 300
    assert last.speed == pytest.approx(np.hypot(last.vx, last.vy)) and last.speed == pytest.approx(250, rel=0.1)
    assert min(last.heading, 360 - last.heading) < 10
    assert last.altitude == pytest.approx(9144)


def test_identities_judge_or_are_used_or_are_left_out(tmp_path, capsys):
    plots(tmp_path / "plots.csv")
    printed, tables = {}, {}
    for identity in (None, "score-only", "ignore", "use"):
        words = [str(tmp_path / "plots.csv"), "-o", str(tmp_path / "tracks.csv"), *NOISE]
        assert track.main(words + ([] if identity is None else ["--identity", identity])) == 0
        printed[identity], table = capsys.readouterr().out, pd.read_csv(tmp_path / "tracks.csv")
        names = {"target", "address_hex", "mode3_oct"} & {*table}
        assert len(names) == (0 if identity == "ignore" else 3)
        tables[identity] = table.drop(columns=names).to_csv()
    assert tables[None] == tables["score-only"] == tables["ignore"] != tables["use"]
    assert "2 of 2 tracks with an identity kept one\n" in printed[None] and "CT " in printed["score-only"]
    assert "kept one" not in printed["ignore"] and "CT " not in printed["ignore"]
    assert "kept one (identities were used to make them)" in printed["use"]
    for identity, told in (("score-only", True), ("ignore", False)):
        words = [str(tmp_path / "plots.csv"), "-o", str(tmp_path / "tracks.csv"), *NOISE, "--identity", identity]
        assert track.main([*words, "--report", str(tmp_path / "r.html")]) == 0
        assert ("CT, MT and IT of the windows" in (tmp_path / "r.html").read_text(encoding="utf-8")) == told
    rates = ["--identity", "ignore", "--rates", str(tmp_path / "rates.csv")]
    assert track.main([str(tmp_path / "plots.csv"), "-o", str(tmp_path / "t.csv"), *NOISE, *rates]) == 2
    assert (
        "--rates: is only for --identity use or score-only, not for ignore" in capsys.readouterr().err
        and not (tmp_path / "t.csv").exists()
    )

"""`python -m assoc.sweep` as a program: it goes on after every kind of end, and refuses in one line."""

import csv
import os
import re
import signal
import subprocess
import sys
import time

import pytest

from assoc.simulation import simulate
from assoc.sweeps import load

GRID = ["--solver", "aco", "--grid", "mode=paper", "alpha=1,2", "rho=0.3,0.9"]


def start(words, cwd, **how):
    command = [sys.executable, "-W", "error", "-m", "assoc.sweep", *map(str, words)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=cwd, text=True, **{"stdout": pipe, "stderr": pipe, **how})


def wait_for_runs(folder, process):
    """Wait until some runs are kept."""
    deadline = time.monotonic() + 600
    while not (folder / "study.json").exists() or len(load(folder)) < 100:
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)


@pytest.fixture(scope="module")
def whole(run, scene_file, tmp_path_factory):
    folder = tmp_path_factory.mktemp("sweep") / "study"
    figures = ["--heatmap", folder / "heatmap.png", "--convergence", folder / "convergence.png"]
    done = run("assoc.sweep", scene_file, *GRID, "--repeats", 2, "-o", folder, *figures, "--csv", folder / "t.csv")
    assert (done.returncode, done.stderr) == (0, "")
    return folder, done.stdout


def test_a_study_is_run_summarised_and_drawn(whole, run):
    folder, out = whole
    lines = out.splitlines()
    head = next(k for k, line in enumerate(lines) if line.split()[:3] == ["solver", "alpha", "rho"])
    assert "mean" in "".join(lines[: head + 1]) and lines[head + 2].split()[0] == "aco"
    assert "48 runs in" in lines[-1] and "48 new, 0 there before" in lines[-1]
    assert {"study.json", "study.sqlite", "heatmap.png", "convergence.png", "t.csv"} <= {*os.listdir(folder)}
    for name in ("heatmap.png", "convergence.png"):
        assert (folder / name).read_bytes().startswith(b"\x89PNG") and (folder / name).stat().st_size > 10_000
    done = run("assoc.sweep", "--summary", folder)
    assert (done.returncode, done.stderr) == (0, "") and done.stdout.splitlines()[:5] == lines[:5]
    rows = list(csv.DictReader((folder / "t.csv").read_text().splitlines()))
    frame = load(folder)
    assert len(rows) == 4 and float(rows[0]["cost"]) == pytest.approx(
        frame[frame["setting"] == rows[0]["setting"]]["cost"].mean()
    )


def test_two_settings_are_compared(whole, run, tmp_path):
    folder, _ = whole
    words = ["compare", folder, "alpha=1,rho=0.3", "alpha=2,rho=0.9"]
    done = run("assoc.sweep", *words, "--csv", tmp_path / "t.tex")
    assert (done.returncode, done.stderr) == (0, "")
    lines = done.stdout.splitlines()
    assert lines[0].split()[:3] == ["first", "second", "difference"] and "mean excess" in lines[1]
    assert lines[-1].startswith("first: alpha=1,rho=0.3; second: alpha=2,rho=0.9; ")
    assert (tmp_path / "t.tex").read_text().startswith(r"\begin{tabular}")
    for more, message in (
        ([*words[:3], "alpha=1"], "names 2 settings"),
        (["compare"], "FOLDER"),
        (["import"], "OLD NEW"),
    ):
        done = run("assoc.sweep", *more)
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1) and message in done.stderr


@pytest.mark.slow
def test_a_study_from_a_file(run, scene_file, tmp_path):
    (tmp_path / "study.toml").write_text(
        f'files = "{scene_file}"\noutput = "study"\nrepeats = 2\nscans = "0:2"\n'
        '[[aco]]\nmode = "paper"\nalpha = [1, 2.5, 3]\n[[aco]]\nrho = 0.5\n[greedy]\n'
    )
    done = run("assoc.sweep", "--config", "study.toml", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "") and "20 runs in study" in done.stdout
    frame = load(tmp_path / "study")
    assert set(frame["solver"]) == {"aco", "greedy"} and frame["alpha"].nunique() == 4


@pytest.fixture(scope="module")
def long_scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("long") / "scene.npz"
    simulate("three-radar", 3, scans=40).save(path)
    return path


LONG = [*GRID, "ants=60", "--repeats", "20", "-o", "study"]


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_killed_at_any_moment_it_goes_on(run, long_scene, tmp_path, jobs):
    (tmp_path / "temporary").mkdir()
    environment = {**os.environ, "TMPDIR": str(tmp_path / "temporary")}
    process = start([long_scene, *LONG, "--jobs", jobs], tmp_path, env=environment)
    wait_for_runs(tmp_path / "study", process)
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=300)
    assert not [*(tmp_path / "temporary").glob("assoc*")]
    kept = len(load(tmp_path / "study"))
    assert 0 < kept < 3200
    short = [*GRID, "ants=60", "--repeats", 1, "-o", "study", "--jobs", jobs]
    done = run("assoc.sweep", long_scene, *short, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "") and "160 runs in study" in done.stdout
    frame = load(tmp_path / "study")
    assert len(frame[frame["repeat"] == 0]) == 160 and len(frame) >= kept
    assert not frame.duplicated(["setting", "scene", "scan", "repeat"]).any()


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 2])
def test_interrupt_says_how_to_go_on(long_scene, tmp_path, jobs):
    process = start([long_scene, *LONG, "--jobs", jobs], tmp_path, start_new_session=True)
    wait_for_runs(tmp_path / "study", process)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: all processes get it
    out, err = process.communicate(timeout=300)
    kept = len(load(tmp_path / "study"))
    assert process.returncode == 130 and out == "" and 0 < kept < 3200
    said = re.fullmatch(
        r"assoc.sweep: interrupted; (\d+) of 3200 runs are kept in study; the same command goes on from there\n", err
    )
    # a batch may have been written while the message was on its way
    assert said is not None and kept - 200 < int(said[1]) <= kept


@pytest.mark.slow
def test_tuning_reports_on_what_was_held_out(run, scene_file, tmp_path):
    words = [scene_file, "--solver", "aco", "--grid", "mode=paper", "alpha=0.5:3", "ants=3:30:log", "-o", "tuned"]
    done = run("assoc.sweep", *words, "--tune", 4, "--target", "time", "--repeats", 2, cwd=tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "held out: scans that training did not see, with seeds 2 to 3" in done.stdout
    assert "default" in done.stdout and "PAR10, s" in done.stdout
    first = (tmp_path / "tuned" / "tuning.json").read_text()
    again = run("assoc.sweep", *words, "--tune", 4, "--target", "time", "--repeats", 2, cwd=tmp_path)
    assert again.stdout == done.stdout and (tmp_path / "tuned" / "tuning.json").read_text() == first


BAD = [
    (["--solver", "acoo"], "did you mean aco?"),
    (["--solver", "aco", "--grid", "alpha="], "no values given"),
    (["--solver", "aco", "--grid", "alpha=1:2"], "which only --tune takes"),
    (["--solver", "aco", "--grid", f"ants=1:1{'0' * 400}"], "ants: expected whole numbers within"),
    (["--solver", "aco", "--scans", "3:99"], "not within the scans"),
    (["--solver", "aco", "--jobs", "2", "--scheduler", "tcp://127.0.0.1:9"], "--jobs or --scheduler"),
    (["--solver", "aco", "--scheduler", "nonsense://"], "no scheduler answers at nonsense://"),
    (["--solver", "greedy", "--tune", "3"], "nothing to tune"),
    (["--target", "gap"], "only with --tune"),
    (["--summary", "study"], "--summary: runs nothing"),
    (["--solver", "aco", "-o", "/proc/nowhere"], "/proc/nowhere: cannot be made"),
    (["--solver", "aco", "-o", "a-file"], "is a file"),
    (["--heatmap", "t.csv"], "expected a name that ends in .png or .svg or .pdf"),
    (["--cpu-limit", "0"], "--cpu-limit"),
    (["--solver", "milp", "--cpu-limit", "1"], "milp cannot be stopped by its processor time"),
]


@pytest.mark.parametrize(("words", "message"), BAD, ids=[" ".join(words) for words, _ in BAD])
def test_bad_input_is_one_line(scene_file, tmp_path, monkeypatch, capsys, words, message):
    from assoc.sweep import main

    monkeypatch.chdir(tmp_path)
    (tmp_path / "a-file").write_text("")
    assert main([str(scene_file), "-o", "study", *words]) == 2
    captured = capsys.readouterr()
    assert captured.out == "" and captured.err.count("\n") == 1
    assert captured.err.startswith("assoc.sweep: error: ") and message in captured.err


TOML = [
    ("alpha = ", "is not a TOML file"),
    ("colour = 1", "colour: unknown key"),
    ("[acoo]\nalpha = 1", "[acoo] is no solver"),
    ("[aco]\nalpha = 'x'", "expected a number"),
    (f"time_limit = 1{'0' * 400}", "time_limit: expected seconds > 0"),
    ("[aco]\nalpha = {low = 1, high = 2}", "s.toml: aco.alpha: expected a number"),
    ("random = 5\n[aco]\nalpha = 1", "s.toml: --random exists no longer"),
    ("grid = ['alpha=1:2']", "s.toml: grid: aco.alpha is a range"),
    ("scans = '3:99'", "s.toml: scans: 3:99 is not within"),
    ("target = 'gap'", "s.toml: target: can be given only"),
    (f"[aco]\nalpha = 1{'0' * 400}", "aco.alpha: expected a number within +-1.8e308"),
]


@pytest.mark.parametrize(("text", "message"), TOML)
def test_bad_files_are_one_line(scene_file, tmp_path, monkeypatch, capsys, text, message):
    from assoc.sweep import main

    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(text)
    assert main([str(scene_file), "-o", "study", "--config", "s.toml"]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1 and "s.toml: " in captured.err and message in captured.err
    assert not (tmp_path / "study").exists()

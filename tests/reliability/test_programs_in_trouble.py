"""Programs whose outputs would overwrite what they read, with strange names, closed streams, and signals."""

import importlib
import os
import shutil
import signal
import subprocess
import threading
import time
from operator import methodcaller
from pathlib import Path

import pytest

from assoc._system.processes import process_map
from assoc.errors import InvalidInputError
from assoc.simulation import simulate
from tests.reliability.test_faults import PYTHON, children
from tests.told import told

UNREADABLE = os.fsdecode(b"\xff \n-.npz")
"""A name that is no text, with a blank, a line break and a dash."""


def main(*words):
    """Run a program in this process; returns its exit code."""
    try:
        return importlib.import_module(words[0]).main([str(word) for word in words[1:]])
    except SystemExit as error:
        return error.code


@pytest.fixture
def work(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    simulate("three-radar", 2, scans=3).save("scene.npz")
    Path("tracks.csv").write_text("icao24,time,lat,lon,geoaltitude\na,0,1,1,9000\na,10,1.01,1,9000\na,20,1.02,1,9000\n")
    Path("sweep.toml").write_text('files = "scene.npz"\nsolver = "greedy"\noutput = "study"\n')
    return tmp_path


@pytest.mark.parametrize(
    "command",
    [
        "assoc.simulate from-tracks tracks.csv -o tracks.csv",
        "assoc.simulate rotating-radar -o p.csv --truth ./p.csv",
        "assoc.solve scene.npz --json link.npz",
        "assoc.solve scene.npz --json o --csv o",
        "assoc.sweep --config sweep.toml --report sweep.toml",
        "assoc.sweep scene.npz --solver greedy -o study --csv study/study.json",
        "assoc.sweep --summary study --csv study/study.sqlite",
    ],
)
def test_nothing_that_is_read_is_overwritten(work, capsys, command):
    Path("link.npz").symlink_to("scene.npz")
    names = sorted(os.listdir("."))
    content = {name: Path(name).read_bytes() for name in names}
    assert main(*command.split()) == 2
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err.count("\n") == 1, printed.err
    assert "would overwrite" in printed.err or "folder missing does not exist" in printed.err
    assert {name: Path(name).read_bytes() for name in sorted(os.listdir("."))} == content


def test_names_that_are_no_text(work, capsys):
    shutil.copy("scene.npz", UNREADABLE)
    outputs = ["--csv", "o.csv", "--report", "o.html"]
    assert main("assoc.solve", UNREADABLE, "scene.npz", "--solver", "greedy", "--json", "o.json", *outputs) == 0
    table = capsys.readouterr().out
    assert "\\n-.npz" in table and "\n-.npz" not in table
    for name in ("o.csv", "o.html", "o.json"):
        assert "\\udcff" in Path(name).read_text(encoding="utf-8"), name
    assert main("assoc.track", UNREADABLE, f"--output=-{UNREADABLE}.csv", "--report", "t.html") == 0
    assert Path(f"-{UNREADABLE}.csv").read_text().startswith("track_id")
    assert main("assoc.sweep", UNREADABLE, "--solver", "greedy", "-o", UNREADABLE + "s", *outputs) == 0
    assert main("assoc.solve", UNREADABLE + "x") == 2
    Path("nul.toml").write_text('files = "scene.npz"\nsolver = "greedy"\noutput = "a\\u0000b"\n')
    capsys.readouterr()
    assert main("assoc.sweep", "--config", "nul.toml") == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_what_cannot_be_written_leaves_the_rest(work, capsys):
    """A disk that is full costs one output, and not the answer."""
    assert main("assoc.solve", "scene.npz", "--solver", "greedy", "--json", "/dev/full", "--csv", "o.csv") == 2
    printed = capsys.readouterr()
    assert printed.err == "assoc.solve: error: /dev/full: cannot be written (No space left on device)\n"
    assert len(Path("o.csv").read_text().splitlines()) == 4 and "true tuples correct" in printed.out


def closed(*numbers):
    def close():
        for number in numbers:
            os.close(number)

    return close


@pytest.mark.slow
def test_closed_streams(work):
    """What is closed stays silent, and no file of ours gets its number and is printed into."""
    for numbers in [(0, 1, 2), (1,)]:
        words = ["assoc.solve", "scene.npz", "--solver", "greedy", "--json", "o.json"]
        done = subprocess.run([*PYTHON, *words], stderr=subprocess.PIPE, timeout=600, preexec_fn=closed(*numbers))
        assert (done.returncode, told(done.stderr.decode()).encode()) == (0, b"")
        assert Path("o.json").read_bytes().startswith(b'{"format"')
        Path("o.json").unlink()
    # without stdin no plot comes
    words = ["assoc.live", "scene.npz", "-o", "t.csv"]
    done = subprocess.run([*PYTHON, *words], stderr=subprocess.PIPE, timeout=600, preexec_fn=closed(0))
    assert done.returncode == 0 and b"0 plots in 0 steps" in done.stderr and b"Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="finds the workers through /proc")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGKILL", "SIGINT"])
def test_no_process_and_no_file_stays_behind(tmp_path, name):
    simulate("three-radar", 2, scans=400).save(tmp_path / "long.npz")
    (tmp_path / "tmp").mkdir()
    words = ["assoc.solve", "long.npz", "--solver", "aco", "--iterations", "100000", "--jobs", "3", "--json", "o.json"]
    with subprocess.Popen(
        [*PYTHON, *words], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "TMPDIR": str(tmp_path / "tmp")},
    ) as process:  # fmt: skip
        workers = []  # two, and the program itself works, too
        end = time.monotonic() + 60
        while len(workers) < 2 and time.monotonic() < end:
            time.sleep(0.05)
            workers = children(process.pid)
        process.send_signal(getattr(signal, name))
        process.wait(120)
        end = time.monotonic() + 300
        while any(alive(one) for one in workers) and time.monotonic() < end:
            time.sleep(0.1)
        assert len(workers) == 2 and not any(alive(one) for one in workers)
        complaint = told(process.stderr.read())
    assert os.listdir(tmp_path / "tmp") == [] and not (tmp_path / "o.json").exists()
    if name != "SIGKILL":
        word = {"SIGTERM": "terminated", "SIGINT": "interrupted"}[name]
        code = 128 + getattr(signal, name)
        assert (process.returncode, complaint) == (code, f"assoc.solve: {word}\n")


def alive(pid):
    try:
        return "\nState:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


@pytest.mark.parametrize(
    ("task", "item"),
    [(threading.Lock().acquire, True), (abs, threading.Lock()), (methodcaller("Lock"), threading)],
    ids=["task", "item", "result"],
)
def test_what_cannot_be_sent_is_one_clear_line(task, item):
    with pytest.raises(InvalidInputError, match="jobs: cannot be sent from one process to another"):
        list(process_map(task, [item, item], 2))

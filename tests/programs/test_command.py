"""The command `assoc`, `python -m assoc`, and what all programs have in common."""

import importlib
import io
import json
import os
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pandas as pd
import pytest

import assoc
from assoc import simulate, solve, sweep, track
from assoc._cli.values import cores, processes
from assoc.errors import MissingExtraError
from tests.sizes import sample

OWN = """
from dataclasses import dataclass, field
import numpy as np
from assoc.solvers import Outcome, Parameters, register

@dataclass(frozen=True)
class OwnParameters(Parameters):
    tries: int = field(default=5, metadata={"help": "number of tries"})

def first(packing, parameters, run):
    return Outcome(np.arange(min(1, packing.num_columns)), parameters.tries)

def nothing(packing, parameters, run):
    return None

register("first", OwnParameters, first)
register("nothing", OwnParameters, nothing)
"""


@pytest.fixture
def here(tmp_path, scene_file, monkeypatch):
    """A folder with a scene and a module of the user's own, which is the current one."""
    shutil.copy(scene_file, tmp_path / "s.npz")
    (tmp_path / "mine.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(capsys, main, words, message):
    with pytest.raises(SystemExit) as left:
        code = main([str(word) for word in words])
        raise SystemExit(code)
    err = capsys.readouterr().err
    assert left.value.code == 2 and err.count("\n") == 1 and message in err, err


def test_the_command_is_installed():
    with (Path(assoc.__file__).parents[1] / "pyproject.toml").open("rb") as file:
        module, _, name = tomllib.load(file)["project"]["scripts"]["assoc"].partition(":")
    assert callable(getattr(importlib.import_module(module), name))


@pytest.mark.slow
def test_subcommands_are_the_programs(run_program, here):
    done = run_program("assoc", "solve", "s.npz", "--solver", "greedy", "--json", "-")
    assert done.returncode == 0 and len(json.loads(done.stdout)["scans"]) == 6
    direct = run_program("assoc.solve", "s.npz", "--solver", "greedy", "--json", "-")
    costs = [[scan["cost"] for scan in json.loads(one.stdout)["scans"]] for one in (done, direct)]
    assert costs[0] == costs[1]
    done = run_program("assoc", "--version")
    assert (done.returncode, done.stdout, done.stderr) == (0, f"assoc {assoc.__version__}\n", "")
    for words in ([], ["--help"]):
        done = run_program("assoc", *words)
        assert done.returncode == 0 and all(name in done.stdout for name in ("simulate", "solve", "track", "sweep"))
    done = run_program("assoc", "slove", "s.npz")
    assert (done.returncode, done.stdout) == (2, "") and "unknown command 'slove'; did you mean solve" in done.stderr
    assert run_program("assoc", "--nothing").returncode == 2


@pytest.mark.slow
@sample("option", ["--json", "--csv"], every=2)
def test_data_alone_go_to_stdout(run_program, here, option):
    done = run_program("assoc.solve", "s.npz", option, "-")
    assert done.returncode == 0 and "scans certified optimal" in done.stderr
    if option == "--json":
        assert json.loads(done.stdout)["solver"] == "exact"
    else:
        assert len(pd.read_csv(io.StringIO(done.stdout))) == 6
    quiet = run_program("assoc", "-q", "solve", "s.npz", option, "-")
    assert quiet.returncode == 0 and quiet.stderr == "" and len(quiet.stdout) > 100
    # both at once are not one stream
    done = run_program("assoc.solve", "s.npz", "--json", "-", "--csv", "-")
    assert done.returncode == 2 and done.stdout == "" and "given twice" in done.stderr
    assert not (here / "-").exists()


def test_quiet_and_verbose(here, capsys):
    assert solve.main(["s.npz", "-q"]) == 0 and capsys.readouterr() == ("", "")
    assert track.main(["s.npz", "-o", "t.csv", "--quiet"]) == 0 and capsys.readouterr() == ("", "")
    assert simulate.main(["three-radar", "--scans", "1", "-o", "x.npz", "-q"]) == 0 and capsys.readouterr().out == ""
    assert simulate.main(["-v", "three-radar", "--scans", "1", "-o", "x.npz"]) == 0
    assert "three-radar: seed 0, " in capsys.readouterr().out
    words = ["s.npz", "--solver", "greedy", "--scans", "0:2", "-o", "study"]
    assert sweep.main([*words, "-v"]) == 0 and "2 of 2 runs" in capsys.readouterr().err
    assert sweep.main([*words, "-q"]) == 0 and capsys.readouterr() == ("", "")


MISTYPED = [
    (solve.main, ["s.npz", "--solvr", "aco"], "did you mean --solver"),
    (solve.main, ["s.npz", "--alpha", "2"], "--alpha belongs to aco (--solver aco), not to exact"),
    (solve.main, ["s.npz", "--solver", "tabu", "--alhpa=2"], "did you mean --alpha"),
    (track.main, ["s.npz", "-o", "t.csv", "--alpha", "2"], "--alpha belongs to aco"),
    (track.main, ["s.npz", "-o", "t.csv", "--dept", "2"], "did you mean --depth"),
    (sweep.main, ["s.npz", "--repeat", "2"], "did you mean --repeats"),
    (simulate.main, ["crowd", "-o", "x.npz", "--target", "2"], "did you mean --targets"),
    (simulate.main, ["thre-radar", "-o", "x.npz"], "did you mean three-radar"),
    (solve.main, ["s.npz", "--sovler", "aco"], "--sovler aco; did you mean --solver? "),
]


@pytest.mark.parametrize(("main", "words", "message"), MISTYPED, ids=[words[-2] for _, words, _ in MISTYPED])
def test_what_is_mistyped_gets_a_suggestion(here, capsys, main, words, message):
    refused(capsys, main, words, message)


ENDINGS = [
    (simulate.main, ["crowd", "-o", "x.csv"], "--output: x.csv: expected a name that ends in .npz"),
    (simulate.main, ["rotating-radar", "-o", "x.npz"], "expected a name that ends in .csv"),
    (simulate.main, ["rotating-radar", "-o", "x.csv", "--truth", "t.npz"], "--truth: t.npz: expected a name"),
    (track.main, ["s.npz", "-o", "t.xlsx"], "--output: t.xlsx: expected a name that ends in .csv or .parquet"),
    (track.main, ["s.npz", "-o", "t.csv", "--report", "r.pdf"], "--report: r.pdf: expected a name"),
    (solve.main, ["s.npz", "--json", "r.csv"], "--json: r.csv: expected a name that ends in .json"),
    (solve.main, ["s.npz", "--csv", "r.PARQUET"], "--csv: r.PARQUET: expected a name that ends in .csv"),
    (sweep.main, ["--summary", "s", "--report", "r.png"], "--report: r.png: expected a name that ends in .html"),
]


@pytest.mark.parametrize(("main", "words", "message"), ENDINGS, ids=[words[-1] for _, words, _ in ENDINGS])
def test_an_ending_that_promises_something_else_is_refused(here, capsys, main, words, message):
    before = {*os.listdir(here)}
    refused(capsys, main, words, message)
    assert {*os.listdir(here)} == before


EXTRAS = [
    (solve.main, ["s.npz", "--report", "r.html"], "plotly", "report"),
    (track.main, ["s.npz", "-o", "t.csv", "--report", "r.html"], "plotly", "report"),
    (track.main, ["s.npz", "-o", "t.parquet"], "pyarrow", "parquet"),
    (sweep.main, ["s.npz", "-o", "study", "--heatmap", "h.png"], "matplotlib", "plot"),
    (sweep.main, ["s.npz", "-o", "study", "--tune", "3"], "optuna", "tune"),
    (sweep.main, ["s.npz", "-o", "study", "--scheduler", "tcp://127.0.0.1:9"], "distributed", "dask"),
]


@pytest.mark.parametrize(("main", "words", "package", "extra"), EXTRAS, ids=[one[2] + one[1][1] for one in EXTRAS])
def test_extras_are_checked_before_the_work(here, capsys, monkeypatch, main, words, package, extra):
    monkeypatch.setitem(sys.modules, package, None)
    # to read it would be refused, too
    (here / "s.npz").write_bytes(b"no scene")
    refused(capsys, main, words, f"{package} is not installed: python -m pip install 'assoc[{extra}]'")
    assert issubclass(MissingExtraError, ImportError) and not (here / "study").exists()


def test_jobs_all(here, capsys):
    assert processes("all", "--jobs") == cores() >= 1
    (here / "o.toml").write_text('jobs = "all"\nsolver = "greedy"\n')
    assert solve.main(["s.npz", "--config", "o.toml", "--scans", "0", "-q"]) == 0
    assert solve.main(["s.npz", "--jobs", "all", "--scans", "0", "-q"]) == 0
    assert sweep.main(["s.npz", "--jobs", "some", "-o", "x"]) == 2
    assert "--jobs: expected a whole number >= 1 or 'all', got 'some'" in capsys.readouterr().err


@pytest.mark.slow
def test_solvers_of_the_users_own(run_program, here):
    words = ["s.npz", "--import", "mine", "--solver", "first", "--tries", "7", "--csv", "-"]
    one, two = (pd.read_csv(io.StringIO(run_program("assoc", "solve", *words, "--jobs", n).stdout)) for n in (1, 2))
    assert one.iterations.tolist() == [7] * 6 and one.cost.tolist() == two.cost.tolist()
    for jobs in ("1", "2"):
        done = run_program("assoc.solve", "s.npz", "--import", "mine", "--solver", "nothing", "--jobs", jobs)
        assert done.returncode == 2 and done.stderr.count("\n") == 1
        assert "solver 'nothing': expected it to return an Outcome, got NoneType" in done.stderr
    grid = ["--grid", "tries=1,2", "--scans", "0:2", "--jobs", "2", "-o", "study"]
    done = run_program("assoc.sweep", "s.npz", "--import", "mine", "--solver", "first", *grid)
    assert done.returncode == 0 and "4 runs in study: 4 new" in done.stdout
    done = run_program("assoc.track", "s.npz", "--import", "mine", "--solver", "first", "-o", "t.csv")
    assert done.returncode == 0 and "multi-sensor, first" in done.stdout


@pytest.mark.parametrize(
    ("text", "message"),
    [("none_such", "no module 'none_such'"), ("mine.py", "the name of a module (mine, not mine.py)"),
     ("bad", "bad cannot be imported (ZeroDivisionError: division by zero)"), ("needs", "No module named 'none_such'")],
)  # fmt: skip
def test_modules_that_cannot_be_imported(here, capsys, text, message):
    (here / "bad.py").write_text("1 / 0\n")
    (here / "needs.py").write_text("import none_such\n")
    refused(capsys, solve.main, ["s.npz", "--import", text], message)


COMPLETED = [
    (["so"], ["solve"]),
    (["solve", "--solver", "a"], ["aco"]),
    (["solve", "--js"], ["--json"]),
    (["solve", "--alp"], ["--alpha"]),
    (["track", "--tracker", "mht"], ["mht", "mht-hypothesis"]),
    (["simulate", "three"], ["three-radar"]),
    (["sweep", "--sum"], ["--summary"]),
    (["completion", "z"], ["zsh"]),
    (["solve", "sce"], []),  # names of files are left to the shell
]


@pytest.mark.slow
def test_bash_completes(run_program, tmp_path):
    bash = shutil.which("bash") or pytest.skip("bash is not installed")
    script = run_program("assoc", "completion", "bash").stdout
    for words, expected in COMPLETED:
        line = " ".join(["assoc", *words])
        ask = f"COMP_WORDS=({line}); COMP_CWORD={len(words)}; _shtab_assoc; printf '%s\\n' \"${{COMPREPLY[@]}}\""
        done = subprocess.run([bash, "-c", script + ask], capture_output=True, text=True, cwd=tmp_path)
        assert (done.stdout.split(), done.stderr) == (expected, ""), words

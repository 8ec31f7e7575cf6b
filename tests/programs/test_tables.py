"""Tables on terminals of several widths: no number is cut; into a pipe: plain columns."""

import importlib
import os
import re

import pytest

from assoc._cli.lines import fitted
from assoc._cli.sweep.tables import without_the_same
from assoc._cli.table import fitted_lines
from assoc.simulation import simulate
from tests.programs.terminal import shown, shown_at

WIDTHS = (60, 80, 120, 200)
HEADERS = ["solver", "alpha", "runs", "mean cost", "95 %", "mean gap", "95 %", "optimal %", "95 %", "ms", "95 %"]
ROWS = [
    ["aco", str(a), "400", f"{-107.3407 * a:.4f}", "-1121.8214 .. -1084.1626", "0.00123", "0.0011 .. 0.0013",
     "99.75", "99.25 .. 100.00", "0.73", "0.685 .. 0.772"]
    for a in range(1, 5)
]  # fmt: skip


def table_lines(text):
    """Lines of what a program showed, without what moves the cursor and without its summary."""
    text = re.sub(r"\x1b\[[?0-9;]*[A-Za-z]", "", text.replace("\r\n", "\n"))
    lines = [line.rpartition("\r")[2] for line in text.split("\n")]
    last = next(i for i, line in enumerate(lines) if re.match(r"\.\.\. and|\d+ scans,", line))
    return lines[:last]


@pytest.mark.parametrize("width", WIDTHS)
def test_no_cell_is_cut(width):
    lines = [*fitted_lines(HEADERS, ROWS, width, keys=2, joined=["95 %"])]
    assert max(map(len, lines)) <= width
    text = "\n".join(lines)
    for row in ROWS:
        for cell in row:
            assert re.search(rf"(?<!\S){re.escape(cell)}(?!\S)", text), cell
    # an interval stands behind its value
    for value, interval in zip(ROWS[0][3::2], ROWS[0][4::2], strict=True):
        assert re.search(rf"{re.escape(value)} +{re.escape(interval)}", text)


@pytest.mark.parametrize("width", [3, 80])
def test_control_characters_are_printed_as_escapes(width):
    lines = [*fitted_lines(["name", "n"], [["a\x1b[31m\n", "1"]], width)]
    assert lines[-1 if width == 80 else 0].split()[-2 if width == 80 else -1] == r"a\x1b[31m\n"


def test_a_narrow_terminal_gets_lists():
    lines = [*fitted_lines(HEADERS, ROWS, 30, keys=2, joined=["95 %"])]
    assert lines[0].split() == ["solver", "aco"] and lines[3].split() == ["mean", "cost", "-107.3407"]
    assert lines.count("") == len(ROWS) - 1


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a pseudo terminal")
@pytest.mark.slow
@pytest.mark.parametrize("width", [60, 80, 120, 200])
def test_solve_shows_twenty_scans(run_program, tmp_path, width):
    simulate("three-radar", 1, scans=23).save(tmp_path / "s.npz")
    words = ["assoc.solve", "s.npz", "--solver", "greedy"]
    piped = run_program(*words, cwd=tmp_path).stdout.splitlines()
    assert [line.split()[0] for line in piped[1:24]] == [str(k) for k in range(23)] and piped[24] == ""
    headers = "scan measurements targets false alarms cost lower bound gap status ms correct".split()
    assert piped[0].split() == headers
    text = shown(words, columns=width, cwd=tmp_path)
    assert "... and 3 more scans (--all shows them)" in text
    lines = table_lines(text)
    assert max(map(len, lines)) <= width
    costs = [line.split()[6] for line in piped[1:21]]
    assert all(any(cost in line.split() for line in lines) for cost in costs)
    if width == 80:
        everything = table_lines(shown([*words, "--all"], columns=width, cwd=tmp_path))
        assert len([line for line in everything if re.match(r" *\d+ ", line)]) == 23


@pytest.fixture(scope="module")
def places(tmp_path_factory):
    """Folder with scenes."""
    folder = tmp_path_factory.mktemp("places")
    simulate("three-radar", 1, scans=23).save(folder / "s.npz")
    simulate("crowd", 1, scans=1, targets=40).save(folder / "a-crowd-of-forty.npz")
    return folder


@pytest.fixture(scope="module")
def study(run_program, places):
    """A study in that folder."""
    grid = ["--grid", "alpha=1,1.5,2", "rho=0.1,0.2,0.3,0.4,0.5,0.6,0.7,0.9"]
    done = run_program("assoc.sweep", "s.npz", "--solver", "aco", *grid, "--scans", "0:2", "-o", "study", cwd=places)
    assert done.returncode == 0, done.stderr


PROGRAMS = {
    "several files": ["assoc.solve", "s.npz", "a-crowd-of-forty.npz", "--solver", "greedy", "--scans", "0"],
    "ranked": ["assoc.solve", "s.npz", "--kbest", "3", "--scans", "0:3"],
    "study": ["assoc.sweep", "--summary", "study"],
    "track": ["assoc.track", "s.npz", "-o", "t.csv"],
    "simulate": ["assoc.simulate", "three-radar", "--scans", "2", "-o", "new.npz"],
}


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a pseudo terminal")
@pytest.mark.slow
@pytest.mark.parametrize("name", PROGRAMS)
def test_every_program_fits_every_terminal(run_program, places, name, request):
    """No line is longer than the terminal, and every number that a pipe gets is there, or dropped as a whole."""
    if name == "study":
        request.getfixturevalue("study")
    piped = run_program(*PROGRAMS[name], cwd=places)
    words = {word for line in piped.stdout.splitlines() for word in line.split()}
    for width, text in shown_at(WIDTHS, PROGRAMS[name], cwd=places).items():
        lines = [line.rpartition("\r")[2] for line in text.splitlines()]
        assert max(map(len, lines)) <= width and "…" not in text
        # times differ from run to run
        seen = {word for line in lines for word in line.split() if re.fullmatch(r"-?\d+\.\d{4}", word)}
        assert seen <= words, (width, seen - words)
        assert name == "track" or name == "simulate" or seen


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a pseudo terminal")
@pytest.mark.usefixtures("study")
def test_a_study_shows_twenty_settings_and_once_what_is_the_same(run_program, places):
    piped = run_program("assoc.sweep", "--summary", "study", cwd=places).stdout
    assert len([line for line in piped.splitlines() if line.strip().startswith("aco ")]) == 24
    text = shown_at([80], ["assoc.sweep", "--summary", "study"], cwd=places)[80]
    assert len(re.findall(r"^ *aco ", text, re.M)) == 20 and "... and 4 more settings (--all shows them)" in text
    # every setting proves the optimum of these scans: said once
    assert "in all settings: runs 2, mean cost" in text and "optimal % 100.00" in text.replace("\n", " ")
    everything = shown_at([80], ["assoc.sweep", "--summary", "study", "--all"], cwd=places)[80]
    assert len(re.findall(r"^ *aco ", everything, re.M)) == 24 and "more settings" not in everything


def test_what_is_the_same_goes_with_its_interval():
    headers = ["solver", "runs", "mean cost", "95 %", "mean gap", "95 %", "ms", "95 %"]
    rows = [["aco", "4", "-1.5", "-2 .. -1", "0.1", "0 .. 1", "3", "2 .. 4"],
            ["tabu", "4", "-1.5", "-2 .. -1", "0.1", "0 .. 2", "5", "2 .. 4"]]  # fmt: skip
    left, cells, same = without_the_same(headers, rows, 1)
    assert left == ["solver", "mean gap", "95 %", "ms", "95 %"] and cells[1] == ["tabu", "0.1", "0 .. 2", "5", "2 .. 4"]
    assert same == "runs 4, mean cost -1.5 (95 %: -2 .. -1)"
    # one setting keeps its columns
    assert without_the_same(headers, rows[:1], 1) == (headers, rows[:1], "")


@pytest.mark.parametrize("width", WIDTHS)
def test_text_breaks_between_words(width):
    line = "against the truth (cutoff 1000 m): GOSPA 1234.5678 m, 3 identity switches; see [--filter NAME] " * 2
    parts = fitted(line.strip(), width).split("\n")
    assert max(map(len, parts)) <= width and " ".join(parts).split() == line.split()
    assert not any(part.endswith("[--filter") for part in parts)
    entry = fitted("  multi-sensor       " + "words of the second column " * 5, width).split("\n")
    assert all(part.startswith(" " * 21) for part in entry[1:])
    assert fitted("short", width) == "short" and fitted("", width) == ""


@pytest.mark.parametrize("program", ["simulate", "solve", "track", "sweep"])
def test_help_fits(monkeypatch, capsys, program):
    main = importlib.import_module(f"assoc.{program}").main
    for width in WIDTHS:
        monkeypatch.setenv("COLUMNS", str(width))
        with pytest.raises(SystemExit):
            main(["--help"])
        assert max(map(len, capsys.readouterr().out.splitlines())) <= width

"""Tables on terminals of several widths: no number is cut; into a pipe: plain columns."""

from __future__ import annotations

import os
import re

import pytest

from assoc._cli.table import fitted_lines
from assoc.simulation import simulate
from tests.programs.terminal import shown

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


def test_a_narrow_terminal_gets_lists():
    lines = [*fitted_lines(HEADERS, ROWS, 30, keys=2, joined=["95 %"])]
    assert lines[0].split() == ["solver", "aco"] and lines[3].split() == ["mean", "cost", "-107.3407"]
    assert lines.count("") == len(ROWS) - 1


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a pseudo terminal")
@pytest.mark.parametrize("width", [80, *(pytest.param(width, marks=pytest.mark.slow) for width in (60, 120, 200))])
def test_solve_shows_twenty_scans(run, tmp_path, width):
    simulate("three-radar", 1, scans=23).save(tmp_path / "s.npz")
    words = ["assoc.solve", "s.npz", "--solver", "greedy"]
    piped = run(*words, cwd=tmp_path).stdout.splitlines()
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


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a pseudo terminal")
def test_summary_of_a_study_at_80_columns(run, scene_file, tmp_path):
    words = [scene_file, "--solver", "aco", "--grid", "alpha=1,2", "rho=0.3,0.9", "--scans", "0:2", "-o", "study"]
    piped = run("assoc.sweep", *words, cwd=tmp_path).stdout.splitlines()
    text = shown(["assoc.sweep", "--summary", "study"], columns=80, cwd=tmp_path).replace("\r\n", "\n")
    lines = text.split("\n")
    assert max(map(len, lines)) <= 80 and "…" not in text
    for line in piped[1:5]:
        # the interval of what varies, and the numbers before it
        for cell in line.split():
            assert cell in text.split(), cell

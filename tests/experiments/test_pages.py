"""The tables on the pages are those of the published results, and every claim there names its source."""

import json
import re
import runpy
import warnings
from pathlib import Path

import pytest

from experiments.__main__ import programs
from experiments.common.results import RESULTS, Results
from experiments.pages import commands, verdicts
from experiments.pages.__main__ import FOLDER, TABLES, main, refresh

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
NAMES = {*programs()}


def test_tables_are_those_of_the_results_and_each_stands_on_a_page(capsys):
    assert main(["--check"]) == 0, capsys.readouterr().out
    pages = "".join(path.read_text(encoding="utf-8") for path in DOCS.glob("*.md"))
    included = re.findall(r"^```\{include\} _tables/([\w-]+)\.md\n```$", pages, flags=re.MULTILINE)
    # the long runs of tests/reliability write their own
    assert sorted(included) == sorted([*TABLES, "reliability"]) == sorted(path.stem for path in FOLDER.iterdir())


def test_every_row_of_the_coverage_says_whether_it_holds_and_what_shows_it(monkeypatch, capsys):
    programs: dict[str, set[tuple[str, ...]]] = {}
    text = "".join(path.read_text(encoding="utf-8") for path in FOLDER.glob("papers-*.md"))
    rows = [line[2:-2].split(" | ") for line in text.splitlines() if line.startswith("| ")]
    rows = [row for row in rows if row[0] not in ("element", "---")]
    assert len(rows) > 100 and {row[3].strip() for row in rows} == {"", *verdicts.CHANGES}
    for element, _, result, _, command in rows:
        assert re.match("holds|does not hold|absent", result), element
        shown = re.findall(r"`(pytest|python -m) ([^`]+)`", command)
        # where something is absent there may be nothing to show it with
        assert shown or result.startswith("absent"), element
        for program, what in shown:
            module, *words = what.removeprefix("experiments.").split()
            assert (ROOT / what).exists() if program == "pytest" else module in NAMES, element
            if program == "python -m":
                programs.setdefault(module, set()).add(tuple(words))
    for module, given in programs.items():
        monkeypatch.setattr("sys.argv", ["program", "--help"])
        with warnings.catch_warnings(), pytest.raises(SystemExit):
            warnings.simplefilter("ignore", RuntimeWarning)
            runpy.run_module(f"experiments.{module}", run_name="__main__")
        # what follows the options must be given
        usage = capsys.readouterr().out.split("\n\n")[0]
        assert given == {tuple(usage.rpartition("]")[2].split())}, module


@pytest.mark.slow
def test_the_commands_of_the_rows_are_run_small(capsys, tmp_path):
    assert len(commands.commands()) > 25 and sum(commands.commands().values()) > 110
    folder = "python -m experiments.papers.clustering_time_window.tables FOLDER"
    quick = commands.small("python -m experiments.papers.modified_ekf", None, tmp_path)
    assert commands.small(folder, None, tmp_path) is None and commands.small(folder, "x", tmp_path)[-1] == "x"
    assert quick[1:] == ["-m", "experiments.papers.modified_ekf", "--quick"]
    # no test is collected, the list of experiments knows no --quick
    assert commands.run({"pytest tests/sizes.py": 1, "python -m experiments": 2, folder: 9}, None) == 2
    assert re.findall(r"^(failed|left out) +(\d)", capsys.readouterr().out, re.MULTILINE) == [
        ("failed", "1"), ("failed", "2"), ("left out", "9"),
    ]  # fmt: skip


def test_the_coverage_names_the_reading_that_is_nearest_to_the_paper():
    readings = [c for c in Results("papers.ant_colony").starting("reading, ") if c.quantity.endswith("mean cycles")]
    off = [abs(one.ours - one.paper) for one in readings]
    nearest = readings[off.index(min(off))]
    row = next(line for line in TABLES["papers-ant-colony"]().splitlines() if line.startswith("| table 1, mean cycles"))
    words = nearest.quantity.split(": ")[0].removeprefix("reading, ")
    assert f" {nearest.ours:.2f} ({verdicts.interval(nearest)}) against 4.03, {words};" in row


def test_a_table_that_is_out_of_date_is_seen_and_written(tmp_path, capsys):
    path = tmp_path / "x.md"
    path.write_text("old\n")
    files = {path: lambda: "| a |"}
    assert refresh(files, check=True) == 1 and path.read_text() == "old\n"
    assert refresh(files, check=False) == 1 and path.read_text() == "| a |\n"
    assert refresh(files, check=True) == 0
    capsys.readouterr()


@pytest.mark.parametrize("path", sorted(RESULTS.glob("*.json")), ids=lambda path: path.stem)
def test_result_files_are_small_dated_and_name_their_sources(path):
    assert path.stat().st_size < 200_000
    data = json.loads(path.read_text())
    assert data["experiment"] == path.stem
    assert path.stem in NAMES
    assert isinstance(data["seed"], int) and re.fullmatch(r"20\d\d-\d\d-\d\d", data["date"])
    assert data["about"]
    for claim in data["claims"]:
        if claim["paper"] is not None:
            # a page, table, figure, equation or section of the paper
            assert re.search(r"(table|figure|equation|section|conclusion|abstract)s?\b", claim["source"]), claim
        if claim["band"] is not None:
            assert claim["source"], claim["quantity"]

"""The figures on the pages are those of the published results, and every claim there names its source."""

import json
import re
import runpy
import warnings
from functools import cache
from pathlib import Path

import pytest

from experiments.__main__ import programs
from experiments.common.claims import Claim
from experiments.common.results import RESULTS, Results, number
from experiments.pages import commands, prose, verdicts
from experiments.pages.__main__ import FOLDER, TABLES, main, refresh
from tests.release import licences

BY_HAND = ("choosing", "registration")
"""Pages without slots: what is measured stands in their tables."""
FIXED = {
    "air_traffic": "0.06 0.1 0.5 0.9 0.95 1 5 6 8 10 15 20 40 60 66 137 250 300 3,704",
    "choosing": "0.5 0.7 0.87 0.95 0.98 1 2 12 87 100 128 300 4096",
    "concepts": "0.99 0.999 01 1 2",
    "probabilities": "0 0.02 0.5 1 2 3 4 14 20 22 80 2,048",
    "scaling": "0.001 4 500 1,000 3,000 10,000",
    "tracking_measured": "0 0.6 1 2 5 10 15 20 30 80 219 400 500",
    "which_solver": "0.001",
}
"""Numbers that are no measurements, on pages of which every part is tested: those of definitions and formulas, of
units and dates, goals, defaults of options, what we advise and the examples of it."""
ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
NAMES = {*programs()}
# files of parameters that experiments write with their scores
PARAMETERS = {
    "filters.tune": ROOT / "assoc" / "filters" / "fuzzy" / "tuned_parameters.json",
    "papers.fuzzy_ekf.tune_published": ROOT / "experiments" / "papers" / "fuzzy_ekf" / "published_rules.json",
}
WORD = r"(?:equations?|tables?|figures?|fig\.|eqs?\.|sections?|rows?|conclusions?|rules|appendix|step|place)"
REFERENCES = re.compile(rf"{WORD}\s+[\d.]*\d(?:(?:,| and| to|,? but)\s+(?:{WORD}\s+)?[\d.]*\d)*", re.IGNORECASE)
NUMBER = re.compile(r"(?<![\w.^])\d+(?:,\d{3})*(?:\.\d+)?(?:e-?\d+)?(?![\w^]|\.\d)")


def parts(name: str) -> list[str]:
    """Parts of a page, as it is written, that have figures of results or name an experiment that has published some."""
    path = DOCS / f"{name}.md" if name in BY_HAND else prose.FOLDER / f"{name}.md"
    # another test checks the table of versions
    text = path.read_text(encoding="utf-8").partition(licences.MARK)[0]
    every = re.split(r"^## ", text, flags=re.MULTILINE)
    return [part for part in every if name in FIXED or sources(part) or prose.SLOT.search(part)]


def sources(text: str) -> set[str]:
    """Experiments that a part of a page names and that have a file of results."""
    flat = " ".join(text.split())
    named = set(re.findall(r"python -m experiments\.([\w.]*\w)", flat))
    return {one for one in named if (RESULTS / f"{one}.json").exists() or one in PARAMETERS}


def numbers(*texts: str) -> list[float]:
    return [float(one.replace(",", "")) for text in texts for one in NUMBER.findall(text)]


@cache
def settings(name: str) -> list[float]:
    """What an experiment set: the numbers of its description and of its claims' names, its goals and its seed."""
    if name in PARAMETERS:
        return numbers(PARAMETERS[name].read_text())
    results = Results(name)
    # the ends of "band of 10 %" follow from the paper's figure
    bands = [claim.band for claim in results.claims if claim.band and "band of 10 %" not in claim.source]
    goals = [end for band in bands for end in band if end is not None]
    # long tables have names with too many numbers
    names = [one.quantity for one in results.claims if not re.match(r"setting |\w+, groups \d", one.quantity)]
    return [results.head["seed"], *goals, *numbers(results.head["about"], *names)]


def unnamed(part: str) -> list[str]:
    """Figures of a part of a page that name no claim and are not settings.

    Among what has slots, and in the lists beside it, only the numbers in the names of the claims are settings;
    elsewhere those of the experiments that the part names.
    """
    found, rest = [], part
    slots = prose.SLOT.search(part)
    for item in prose.ITEM.findall(part):
        if prose.SLOT.search(item) or (slots and item.startswith("- ")):
            rest = rest.replace(item, " ")
            named = [one for slot in prose.SLOT.findall(item) for one in NUMBER.findall(" ".join(slot[1].split()))]
            found += [one for one in figures(prose.SLOT.sub(" ", item)) if one not in named]
    assert not prose.SLOT.search(rest)
    known = [one for name in sources(part) for one in settings(name)]
    return found + [one for one in figures(rest) if not is_one_of(one, known)]


def figures(text: str) -> list[str]:
    """Numbers in a part of a page, those of code, links, references to papers left out."""
    text = re.sub(r"```.*?```|(?<=\n\n)(?:    [^\n]*\n?)+", " ", text, flags=re.DOTALL)
    text = re.sub(r"<!--.*?-->", " ", text, flags=re.DOTALL)
    text = re.sub(r"`[^`]*`", " ", text)
    text = re.sub(r"\]\([^)]*\)", "] ", text)
    text = REFERENCES.sub(" ", " ".join(text.split()))
    # years of papers, names such as 3-D, what intervals are of
    text = re.sub(r"\b(?:19|20)\d\d\b|\b\d-D\b|\b95 % interval", " ", text)
    return NUMBER.findall(text)


def is_one_of(figure: str, known: list[float]) -> bool:
    """Whether a printed figure is one of the numbers, rounded to its digits."""
    plain = figure.replace(",", "")
    decimals = len(plain.partition(".")[2])
    half = 0.5 * 10.0**-decimals
    return any(abs(abs(one) - float(plain)) <= half * 1.000001 for one in known)


@pytest.mark.parametrize("name", [*prose.PAGES, *BY_HAND])
def test_every_figure_of_a_page_names_its_claim(name):
    assert parts(name)
    # neither a figure without a claim nor a fixed number that the page has no longer
    assert {one for part in parts(name) for one in unnamed(part)} == {*FIXED.get(name, "").split()}


def test_each_page_that_names_an_experiment_is_tested():
    named = {path.stem for path in DOCS.glob("*.md") if sources(path.read_text(encoding="utf-8"))}
    assert {"papers", "registration"} < named <= {*prose.PAGES, *BY_HAND}


def test_a_figure_that_is_written_by_hand_is_found():
    (part,) = (one for one in parts("solvers_measured") if prose.SLOT.search(one))
    slots = list(prose.SLOT.finditer(part))
    assert len(slots) > 60
    for slot in slots:
        by_hand = prose.figure(slot).lstrip("-")
        assert by_hand in unnamed(part[: slot.start()] + by_hand + part[slot.end() :])
    # a paragraph without slots, too
    assert unnamed(f"{part}\n\nDives are worth {by_hand} %.\n") == [by_hand]


def test_a_slot_names_one_claim():
    def filled(slot):
        return prose.SLOT.sub(prose.figure, slot)

    claim = Results("papers.modified_ekf")["simulation 1, reading mixed: modified / EKF, RMSE of the position"]
    slot = "{{modified_ekf: simulation 1, reading mixed:\n  modified / EKF, RMSE of the position"
    assert filled(f"{slot}}}}}") == number(claim.ours) and filled(f"{slot} | low 2}}}}") == number(claim.interval[0], 2)
    assert filled(f"{slot} | paper 2}}}}") == "0.71"
    for wrong, words in (
        ("{{modified_ekf: simulation 1}}", "begins"),
        ("{{modified_ekf: simulation 7}}", "no claim"),
        ("{{modified_ekf: B1: RMSE of the EKF | paper}}", "has no paper"),
    ):
        with pytest.raises(KeyError, match=words):
            filled(wrong)


def test_the_check_finds_a_wrong_figure():
    known = [0.354, 2086.6, 12.0]
    assert [is_one_of(one, known) for one in ("0.354", "0.35", "2,087", "12", "0.36", "2,086", "12.1")] == [
        True, True, True, True, False, False, False,
    ]  # fmt: skip
    text = "Table 4.3 has 0.71, equations 4.1 to 4.15 and tables 2.1 and 2.2 not; `x=5` and 3-D neither, 2,087 m does."
    assert figures(text) == ["0.71", "2,087"]


def test_tables_are_those_of_the_results_and_each_stands_on_a_page(capsys):
    assert main(["--check"]) == 0, capsys.readouterr().out
    pages = "".join(path.read_text(encoding="utf-8") for path in DOCS.glob("*.md"))
    included = re.findall(r"^```\{include\} _tables/([\w-]+)\.md\n```$", pages, flags=re.MULTILINE)
    assert sorted(included) == sorted(TABLES) == sorted(path.stem for path in FOLDER.iterdir())


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
    assert f" {nearest.ours:.2f} ({verdicts.interval(nearest)}) against 4.03, {words} |" in row


def test_verdicts_say_no_more_than_the_intervals():
    def claim(ours, low, high, band):
        return Claim(f"RMS of {ours:g}", "", None, ours, (low, high), band, source="table 1")

    sure, crossing = claim(0.9, 0.85, 0.95, (None, 1.0)), claim(0.99, 0.97, 1.01, (None, 1.0))
    assert verdicts.verdict(sure, crossing) == "holds"
    assert verdicts.below_one([sure, crossing]) == "holds in 1 of 2" and verdicts.below_one([crossing]) == verdicts.NOT
    assert verdicts.at_the_edge(sure, crossing) == "0.99 at the edge"
    assert verdicts.at_the_edge(sure) == "none at the edge"


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
    assert path.stat().st_size < 150_000
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


def test_numbers():
    assert [number(one) for one in (2086.63, 88.54, 1.0, 0.00942, 521.13, 9.4079)] == [
        "2,087", "88.5", "1.00", "0.00942", "521", "9.41",
    ]  # fmt: skip
    assert number(521.13, 4) == "521.1" and number(0.0) == "0.00" and number(-4.36) == "-4.36"

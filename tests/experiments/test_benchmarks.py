"""The benchmark's machinery: rows and report on numbers made for the purpose."""

import math
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from experiments.benchmarks import markdown, ranking, rows
from experiments.benchmarks.__main__ import main
from experiments.benchmarks.families import Case, Entry, Instance, on_one_core
from experiments.benchmarks.rows import Row
from experiments.benchmarks.run import run_all, run_case, timed
from experiments.common.instances import FIRST_SEED, synthetic

ROW = Row("gated", "3x300", 1000, 0, 9000, "exact", False, 60.0, -100.0, -100.0, 0.01, "optimal", -100.0, True)
PEER = replace(ROW, solver="highs", peer=True, seconds=0.3)


def test_rows_round_trip(tmp_path: Path) -> None:
    path = tmp_path / "rows.csv"
    some = [ROW, replace(PEER, cost=math.inf, bound=-math.inf, status="none", proven=False)]
    rows.save(path, some)
    assert rows.load(path) == some
    assert path.read_text().splitlines()[0].endswith(",gap,excess")


def test_rows_of_several_runs_share_the_best_reference() -> None:
    known = [replace(ROW, reference=-100.0, proven=False), replace(PEER, reference=-101.0, proven=True)]
    other = replace(ROW, seed=1001, reference=-90.0, proven=False)
    ranked = replace(ROW, family="kbest", reference=math.nan)
    merged = rows.with_common_reference([*known, other, ranked])
    assert [(row.reference, row.proven) for row in merged[:3]] == [(-101.0, True), (-101.0, True), (-90.0, False)]
    assert math.isnan(merged[3].reference)


def test_gap_excess_and_hit() -> None:
    row = replace(ROW, cost=-99.0, bound=-101.0)
    assert row.gap == pytest.approx(2 / 99)
    assert row.excess == pytest.approx(0.01)
    assert not row.hit
    assert ROW.hit


def test_the_fastest_peer_is_one_that_proved_every_instance() -> None:
    peers = [PEER, replace(PEER, seed=1001, seconds=0.5)]
    results = rows.Results([ROW, *peers, replace(PEER, seed=1001, solver="cp_sat", seconds=0.005)])
    assert results.fastest_proof("gated", "3x300") == (0.005, "cp_sat")
    assert [results.fastest_peer(replace(ROW, seed=seed)) for seed in (1000, 1001)] == [0.3, 0.005]
    # a peer that did not prove its answer is not in the race
    results = rows.Results([ROW, *peers, replace(PEER, solver="cp_sat", seconds=0.005, status="feasible")])
    assert results.fastest_proof("gated", "3x300") == (0.4, "highs") and results.fastest_peer(ROW) == 0.3


@pytest.mark.slow
def test_several_processes_measure_the_same_on_one_core_each() -> None:
    def make(seed: int):  # type: ignore[no-untyped-def]
        yield Instance(*synthetic.planted(3, seed, targets=4))

    peers = (Entry("cp_sat", 5.0), Entry("scip", 5.0), Entry("scip_1", 5.0), Entry("sequential", 5.0))
    case = Case("planted", "S=3", make, (*peers, Entry("exact", 5.0)), (1000, 1001, 1002))
    case = case.changed(on_one_core)
    assert [entry.solver for entry in case.entries] == ["cp_sat_1", "scip_1", "sequential", "exact"]
    assert [one.seeds for one in case.by_seed(2)] == [(1000,), (1001,)]
    other = replace(case, size="again", seeds=(7, 5))
    lines: list[str] = []
    found = list(run_all([case, other], None, 2, lines.append))
    alone = [run_case(one) for one in (case, other)]
    assert [[(r.size, r.seed, r.solver, r.cost) for r in rows] for rows in found] == [
        [(r.size, r.seed, r.solver, r.cost) for r in rows] for rows in alone
    ]
    assert len(lines) == 5 and "again seed 7" in lines[3]


def test_rankings_are_ascending_from_the_optimum() -> None:
    ranking.check_ranked([1.0, 2.0, 2.0, 4.0], 1.0)
    for costs, best in (([1.0, 3.0, 2.0], 1.0), ([1.0, 2.0], 0.5), ([1.0, 2.0], 1.5)):
        with pytest.raises(AssertionError, match="kbest"):
            ranking.check_ranked(costs, best)


def test_run_case_checks_and_compares() -> None:
    def make(seed: int):  # type: ignore[no-untyped-def]
        yield Instance(*synthetic.planted(3, seed, targets=6))

    entries = tuple(Entry(name, 5.0) for name in ("highs", "sequential", "greedy"))
    case = Case("planted", "S=3", make, entries, range(FIRST_SEED, FIRST_SEED + 2))
    found = run_case(case)
    assert {row.seed for row in found} == {FIRST_SEED, FIRST_SEED + 1}
    assert [row.solver for row in found[:3]] == ["highs", "sequential", "greedy"]
    for row in found:
        assert row.proven
        assert row.reference == pytest.approx(synthetic.planted(3, row.seed, targets=6)[1])
        assert row.cost >= row.reference - 1e-9
        assert row.bound <= row.reference + 1e-6
    assert all(row.hit for row in found if row.solver == "highs")


@pytest.mark.parametrize(("first", "runs", "counts"), [(0.01, 5, 0.02), (0.3, 1, 0.3)])
def test_the_median_of_short_runs_counts(first: float, runs: int, counts: float) -> None:
    # the fourth was interrupted
    times = iter([first, 0.02, 0.01, 0.9, 0.03, 0.5])
    done = []

    def run() -> Row:
        done.append(next(times))
        return replace(ROW, seconds=done[-1], cpu=2.0 * done[-1])

    row = timed(run)
    assert len(done) == runs
    assert row == replace(ROW, seconds=counts, cpu=2.0 * counts)


def test_program_refuses_and_reports(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["--families", "gatd"])
    assert stop.value.code == 2
    assert "gatd" in capsys.readouterr().err
    with pytest.raises(SystemExit) as stop:
        main(["--processes", "0"])
    assert stop.value.code == 2
    assert "--processes: expected at least 1, got 0" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "chszlablib", None)
    with pytest.raises(SystemExit) as stop:
        main([])
    assert stop.value.code == 2
    assert re.search(r"docs/benchmarks.csv is of all other solvers; not installed: chszlablib", capsys.readouterr().err)
    path = tmp_path / "b.csv"
    with pytest.raises(SystemExit):
        main(["--report-only", "--csv", str(path)])
    rows.save(path, [ROW, PEER])
    assert main(["--report-only", "--csv", str(path)]) == 0
    assert "**gated**" in (tmp_path / "b.md").read_text()


def test_a_run_goes_on_where_it_was_interrupted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "b.csv"
    rows.save(path, [replace(ROW, family="planted", size="S=3", seed=7)])
    words = ["--families", "planted", "--sizes", "S=3", "S=4", "--solvers", "greedy", "--seeds", "1"]
    assert main([*words, "--csv", str(path), "--resume"]) == 0
    assert [(row.size, row.seed) for row in rows.load(path)] == [("S=3", 7), ("S=4", FIRST_SEED)]
    assert main([*words, "--csv", str(path), "--update"]) == 0
    assert [(row.size, row.seed, row.solver) for row in rows.load(path)] == [
        ("S=3", 7, "exact"), ("S=3", FIRST_SEED, "greedy"), ("S=4", FIRST_SEED, "greedy"),
    ]  # fmt: skip


@pytest.mark.parametrize("name", ["README.md", "paper.md"])
def test_tables_of_a_page_are_written_with_the_report(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs").mkdir()
    page = tmp_path / name
    page.write_text(f"before\n{markdown.BEGIN}\nold\n{markdown.END}\nafter\n")
    sequential = replace(ROW, solver="sequential", peer=True, cost=-98.0, status="feasible")
    rows.save(tmp_path / "docs" / "benchmarks.csv", [ROW, PEER, sequential])
    assert main(["--report-only"]) == 0
    text = page.read_text()
    assert text.startswith("before\n") and text.endswith("\nafter\n") and "old" not in text
    assert "| 3 sensors, 300 targets | 10 ms | 300 ms (HiGHS) | 2 % |" in text


def test_time_that_others_took_does_not_count():
    """A machine that is shared: less of the processor than on the clock; several threads take more of it."""
    assert replace(ROW, seconds=0.9, cpu=0.1).taken == 0.1
    assert replace(ROW, seconds=0.9, cpu=1.7).taken == 0.9
    assert replace(ROW, seconds=0.9, cpu=0.0).taken == 0.9

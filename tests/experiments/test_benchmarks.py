"""The benchmark's machinery: rows, goals and report on numbers made for the purpose."""

import math
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from experiments.benchmarks import goals, markdown, ranking, rows
from experiments.benchmarks.__main__ import FAMILIES, main
from experiments.benchmarks.families import Case, Entry, Instance, cases, on_one_core
from experiments.benchmarks.rows import Row
from experiments.benchmarks.run import run_all, run_case, timed
from experiments.common.instances import FIRST_SEED, synthetic

ROW = Row("gated", "3x300", 1000, 0, 9000, "exact", False, 60.0, -100.0, -100.0, 0.01, "optimal", -100.0, True)
PEER = replace(ROW, solver="highs", peer=True, seconds=0.3)


def verdict(found: list[goals.Verdict], start: str) -> goals.Verdict:
    return next(v for v in found if v.goal.startswith(start))


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


def test_speed_goal_needs_median_and_never_slower() -> None:
    other = [replace(ROW, seed=1001, seconds=0.01), replace(PEER, seed=1001, seconds=0.5)]
    found = goals.judge([ROW, PEER, *other])
    speed = verdict(found, "exact: 30 times")
    assert speed.met
    assert "median 40 times, least 30" in speed.measured
    slow = goals.judge([ROW, PEER, *other, replace(PEER, seed=1001, solver="cp_sat", seconds=0.005)])
    assert not verdict(slow, "exact: 30 times").met
    # a peer that did not prove its answer is not in the race
    unproven = replace(PEER, seed=1001, solver="cp_sat", seconds=0.005, status="feasible")
    assert verdict(goals.judge([ROW, PEER, *other, unproven]), "exact: 30 times").met


def test_goals_of_proofs_on_ghosts() -> None:
    def at(size: str, **changes: object) -> Row:
        return replace(ROW, family="ghost", size=size, **changes)  # type: ignore[arg-type]

    def peer(size: str, name: str, **changes: object) -> Row:
        return replace(at(size), solver=name, peer=True, **changes)  # type: ignore[arg-type]

    twenty = [at("20", seconds=0.02), peer("20", "highs", seconds=0.3), peer("20", "scip", seconds=0.1)]
    found = goals.judge(twenty)
    assert verdict(found, "exact: faster than every peer").met
    assert not verdict(goals.judge([*twenty, peer("20", "cp_sat", seconds=0.01)]), "exact: faster").met
    # a peer without a proof took at least its limit
    forty = [at("40", seconds=2.0, extra=1e-3), peer("40", "highs", status="feasible", limit=60.0, seconds=60.0)]
    found = goals.judge(forty)
    assert verdict(found, "exact: 5 times as fast as HiGHS").met and verdict(found, "exact: at most 3 s").met
    assert not verdict(goals.judge([replace(forty[0], status="feasible"), forty[1]]), "exact: 5 times").met
    # a wide gap does not count for the three seconds
    wide = goals.judge([at("40", seconds=9.0, extra=1e-2), at("40", seed=1001, seconds=1.0, extra=1e-3)])
    assert verdict(wide, "exact: at most 3 s").met
    sixty = [at("60", seed=s, status="optimal" if s % 2 else "feasible", seconds=9.0) for s in range(1, 6)]
    assert verdict(goals.judge(sixty), "exact: proof in 60 s").met
    assert not verdict(goals.judge(sixty[1:4]), "exact: proof in 60 s").met
    gaps = (0.008, 0.009, 0.02)
    hundred = goals.judge([at("100", seed=s, status="feasible", bound=-100 - gap) for s, gap in enumerate(gaps)])
    assert verdict(hundred, "exact: gap at most 0.01 % in 30 s (median)").met
    assert not verdict(hundred, "exact: gap at most 0.01 % in 30 s (each seed)").met


def test_goals_of_wide_gaps_and_axial_problems() -> None:
    wide = replace(ROW, family="wide gap", size="20", seconds=0.5)
    scip = replace(wide, solver="scip_1", peer=True, seconds=1.4)
    found = goals.judge([wide, scip, replace(scip, solver="cp_sat", seconds=0.1)])
    assert verdict(found, "exact: faster than SCIP").met
    assert not verdict(goals.judge([wide, replace(scip, seconds=0.4)]), "exact: faster than SCIP").met
    gates = replace(wide, family="wide gates", size="1000")
    for seconds, met in ((2.6, True), (2.4, False)):
        found = goals.judge([gates, replace(gates, solver="highs", peer=True, seconds=seconds, cpu=seconds)])
        assert verdict(found, "exact: 3 times as fast").met == met
    known = replace(ROW, family="known optimum", size="n=50")
    assert verdict(goals.judge([known]), "exact: proof in 20 s").met
    assert not verdict(goals.judge([known, replace(known, seed=1001, status="feasible")]), "exact: proof").met
    axial = replace(ROW, family="random axial", size="n=26")
    assert "1 of 1, at most 0.01 s" in verdict(goals.judge([axial]), "exact: proof in 60 s").measured
    for row in (known, axial):
        assert verdict(goals.judge([row]), "exact: no slower than").met
        assert not verdict(goals.judge([replace(row, seconds=7.0, cpu=7.0)]), "exact: no slower than").met
    scan = replace(ROW, family="paper", size="3 radars", solver="aco")
    assert verdict(goals.judge([replace(scan, seconds=9e-4)]), "aco: a scan in less than").met
    assert not verdict(goals.judge([replace(scan, seconds=2e-3, cpu=2e-3)]), "aco: a scan in less than").met


def test_a_limit_for_peers_and_chosen_seeds() -> None:
    def make(seed: int):  # type: ignore[no-untyped-def]
        yield Instance(*synthetic.planted(3, seed, targets=4))

    peers = (Entry("highs", 5.0), Entry("highs", 60.0), Entry("sequential", 5.0))
    case = Case("planted", "S=3", make, (*peers, Entry("exact", 5.0)), (7, 9))
    short = case.changed(lambda entry: replace(entry, limit=4.0) if entry.peer else entry)
    assert short.entries == (Entry("highs", 4.0), Entry("sequential", 4.0), Entry("exact", 5.0))
    assert case.changed(lambda entry: None if entry.peer else entry).entries == (Entry("exact", 5.0),)
    found = run_case(short, 1)
    assert {row.seed for row in found} == {7} and {row.seed for row in run_case(short)} == {7, 9}
    assert all(row.cpu > 0 for row in found if row.solver != "sequential")


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


def test_lagrangian_goal() -> None:
    row = replace(ROW, solver="lagrangian@0.1%", cost=-99.95, seconds=0.01, status="feasible")
    peer = replace(PEER, solver="cp_sat", seconds=0.6)
    assert verdict(goals.judge([row, peer]), "lagrangian").met
    assert not verdict(goals.judge([replace(row, bound=-101.0), peer]), "lagrangian").met
    assert not verdict(goals.judge([row, replace(peer, seconds=0.4)]), "lagrangian").met


def test_ghost_goals_compare_at_equal_and_at_long_time() -> None:
    base = replace(ROW, family="ghost", size="60", proven=False)
    ours = replace(base, solver="tabu", cost=-99.97, limit=5.0, seconds=5.0)
    early = replace(base, solver="cp_sat", peer=True, cost=-99.0, limit=5.0, seconds=5.0, status="feasible")
    late = replace(early, cost=-100.0, limit=60.0, seconds=60.0)
    found = goals.judge([ours, early, late])
    assert verdict(found, "tabu: in 5 s at or below any peer after 5 s").met
    assert not verdict(found, "tabu: in 5 s at or below any peer after 60 s").met
    level = [replace(row, seed=s, cost=-100.0) for s in (1, 2) for row in (ours, early, late)]
    mixed = goals.judge([ours, early, late, *level])
    assert verdict(mixed, "tabu: in 5 s at or below any peer after 60 s (median)").met
    assert not verdict(mixed, "tabu: in 5 s at or below any peer after 60 s (each seed)").met
    # a peer that was given 60 s but ended within 5 counts as one after 5 s
    quick = goals.judge([ours, replace(late, seconds=3.0)])
    assert not verdict(quick, "tabu: in 5 s at or below any peer after 5 s").met


def test_shares() -> None:
    base = replace(ROW, family="known optimum", size="n=20", solver="aco", cost=1.0, bound=1.0, reference=1.0)
    tenth = [replace(base, seed=1000 + i, cost=1.0 if i else 1.1) for i in range(10)]
    assert verdict(goals.judge(tenth), "aco").met
    assert not verdict(goals.judge(tenth[:9]), "aco").met


def test_rankings_are_ascending_from_the_optimum() -> None:
    ranking.check_ranked([1.0, 2.0, 2.0, 4.0], 1.0)
    for costs, best in (([1.0, 3.0, 2.0], 1.0), ([1.0, 2.0], 0.5), ([1.0, 2.0], 1.5)):
        with pytest.raises(AssertionError, match="kbest"):
            ranking.check_ranked(costs, best)


@pytest.mark.slow
def test_rankings_are_run_and_compared() -> None:
    found = ranking.run(1, lambda text: None, spatial_k=4)
    assert {row.solver: row.extra for row in found if row.size == ranking.SPATIAL} == {"kbest": 4, "exact": 1}
    assert all(row.hit and row.cpu > 0 for row in found)


def test_report_has_a_line_for_each_family_and_the_goals_missed() -> None:
    text = markdown.render([ROW, PEER, replace(ROW, family="planted", size="S=3", solver="tabu")], None)
    assert "- **planted**: " in text
    assert "| gated | 3x300 | 9,000 | 10 ms | 30 | - | - | 300 ms (highs) | - |" in text
    assert "| planted | S=3 | 9,000 | - | - | 0 | - | - | - |" in text
    assert "| gated | 2 of 2 |" in text
    open_gap = markdown.render([replace(ROW, status="feasible", bound=-101.0), replace(PEER, status="feasible")], None)
    assert "| gated | 3x300 | exact: the optimum, proven | worst excess 0 |" in open_gap
    assert "| 10 ms, 0 of 1 proved, worst gap 1 % | - | - | - | 0 of 1 proved | - |" in open_gap


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


def test_cases_cover_the_families() -> None:
    full = cases()
    assert {case.family for case in full} == set(FAMILIES) - {"kbest"}
    assert {c.size for c in full if c.family == "gated"} == {"3x100", "3x300", "3x1000", "4x300", "5x200"}
    assert all(len(case.seeds) >= 5 for case in full if case.size != "n=100")
    assert {int(case.size[2:]) for case in full if case.family == "random axial"} == set(range(4, 27, 2))


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


def test_the_readme_says_how_long_others_had() -> None:
    base = replace(ROW, family="ghost", size="40", limit=5.0)
    ours = [replace(base, solver=name) for name in ("exact", "aco", "genetic", "tabu")]
    for limit in (7.0, 60.0):
        peer = replace(ours[0], solver="highs", peer=True, limit=limit)
        assert f"best other solver, {limit:g} s" in markdown.tables([*ours, peer])


def test_a_brief_run_is_whole() -> None:
    assert {(case.family, case.size): case.brief for case in cases()}["ghost", "20"] == 10
    assert all(1 <= case.brief <= len(case.seeds) for case in cases())


def test_a_report_written_again_keeps_its_head(tmp_path: Path) -> None:
    path, report = tmp_path / "b.csv", tmp_path / "b.md"
    rows.save(path, [ROW, PEER])
    report.write_text(markdown.render([ROW, PEER], markdown.head(1.5, "make bench")))
    assert main(["--report-only", "--csv", str(path)]) == 0
    assert "\nWritten by `make bench` in 1.5 minutes, on " in report.read_text()


def test_time_that_others_took_does_not_count():
    """A machine that is shared: less of the processor than on the clock; several threads take more of it."""
    assert replace(ROW, seconds=0.9, cpu=0.1).taken == 0.1
    assert replace(ROW, seconds=0.9, cpu=1.7).taken == 0.9
    assert replace(ROW, seconds=0.9, cpu=0.0).taken == 0.9

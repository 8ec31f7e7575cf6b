"""The store: nothing finished is lost, whatever happens; nothing is there twice."""

import json
import os
import shutil
import sqlite3
from dataclasses import replace
from pathlib import Path

import pytest

import assoc
from assoc.errors import InvalidInputError
from assoc.problem import AssignmentProblem
from assoc.scene import Scene
from assoc.sweeps import Study, grid, load, load_traces
from assoc.sweeps.old_form import import_study
from assoc.sweeps.sources import StudySource
from assoc.sweeps.store import COLUMNS, DATABASE, PARAMETERS, Store
from assoc.sweeps.worker import code_digest


def same(one, other):
    return one.drop(columns="time").equals(other.drop(columns="time"))


def rows_of(folder):
    with Store(folder) as store:
        return store.select(f"{', '.join(COLUMNS)} FROM runs")


@pytest.fixture
def whole(study, tmp_path):
    study.run(tmp_path / "whole")
    return tmp_path / "whole"


def test_a_row_is_a_run_that_assign_gives_again(study, whole, scene):
    import assoc

    frame = load(whole)
    assert len(frame) == study.size == 40 and frame["seed"].nunique() == 40
    for row in frame.iloc[::7].to_dict("records"):
        problem = assoc.build_problem(scene, scene.scan(row["scan"]))
        solution = assoc.assign(
            problem, row["solver"], seed=row["seed"], mode=row["mode"], alpha=row["alpha"], rho=row["rho"]
        )
        assert (row["cost"], row["lower_bound"]) == (solution.cost, solution.lower_bound)
        assert (row["iterations"], row["gap"]) == (solution.iterations, solution.gap)
        assert row["optimal"] == (solution.status == "optimal")
    expected = assoc.associate(scene, "milp")
    best = frame[frame["optimal"]].groupby("scan").first()
    for scan, row in best.iterrows():
        one = expected.scans[scan]
        assert row["true_tuples"] == one.true_tuples and row["correct_tuples"] == one.correct_tuples


@pytest.mark.slow
def test_a_kill_at_any_moment_of_writing_leaves_whole_batches(study, whole, tmp_path):
    """Copies of the folder between all steps of SQLite while a batch is written: what a killed process leaves."""
    rows = rows_of(whole)
    settings = [(one.key, one.solver, one.parameters) for one in study.settings]
    states = []
    with Store(tmp_path / "new", study.manifest) as store:

        def copy():
            shutil.copytree(tmp_path / "new", tmp_path / f"copy-{len(states)}")
            states.append(tmp_path / f"copy-{len(states)}")

        for start in (0, 20):
            store._db.set_progress_handler(copy, 40)
            assert store.append(settings, rows[start : start + 20]) == 20
            store._db.set_progress_handler(None, 0)
            copy()
    assert len(states) > 20
    found = [len(load(folder)) for folder in states]
    assert sorted(found) == found and {*found} == {0, 20, 40}
    study.run(states[len(states) // 2])
    assert same(load(states[len(states) // 2]), load(whole))


def spoiled(folder, words, *values):
    """A study changed by SQL."""
    with sqlite3.connect(folder / DATABASE) as db:
        db.execute("PRAGMA ignore_check_constraints = ON")
        db.execute(words, values)
    db.close()


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("seed", "one"), ("seed", None), ("cost", "much"), ("time", b"{}"), ("iterations", 1.5),
        ("true_tuples", "x"), ("stopped_by", b"7"), ("trace", b"1234"), ("trace", "a"),
    ],
)  # fmt: skip
def test_values_of_another_kind_are_one_line(whole, column, value):
    spoiled(whole, f"UPDATE runs SET {column} = ? WHERE (scan, repeat) = (1, 1)", value)
    with pytest.raises(InvalidInputError, match="study.sqlite: is damaged") as raised:
        load(whole)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    "words",
    [
        "CREATE VIEW more AS WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x FROM n) SELECT x FROM n",
        "CREATE TRIGGER t AFTER INSERT ON runs BEGIN DELETE FROM runs; END",
        "DROP TABLE settings",
        "ALTER TABLE runs ADD COLUMN mine TEXT",
        "PRAGMA user_version = 9",
        "PRAGMA application_id = 0",
        "UPDATE study SET manifest = '{}'",
        "UPDATE settings SET parameters = '[1]'",
        'UPDATE settings SET parameters = \'{"a": "\\ud800"}\'',
        "UPDATE settings SET parameters = '{\"a\": 1e999}'",
        "UPDATE study SET manifest = replace(manifest, '\"seed\": 0', '\"seed\": 1e999')",
        "UPDATE study SET manifest = replace(manifest, 'scene', '\\ud800')",
        "UPDATE study SET manifest = replace(manifest, '\"gating\": {}', '\"gating\": Infinity')",
    ],
)
def test_a_foreign_file_is_one_line(study, whole, words):
    spoiled(whole, words)
    for use in (load, study.run):
        with pytest.raises(InvalidInputError, match="study.sqlite: (is|has)") as raised:
            use(whole)
            load(whole)
        assert "\n" not in str(raised.value)


def test_a_changed_design_adds(study, whole):
    before = rows_of(whole)
    more = replace(study, settings=[*study.settings, *grid("greedy")], repeats=3)
    counts = more.run(whole)
    assert (counts.before, counts.new) == (40, 4 * 5 + 3 * 5)
    assert {*before} <= {*rows_of(whole)}
    frame = load(whole)
    assert len(frame) == 75 and not frame.duplicated(["setting", "scene", "scan", "repeat"]).any()


def test_another_study_is_refused(study, whole, scene, tmp_path):
    other = StudySource(Scene(scene.sensors, scene.times + 1.0, scene.measurements, region=scene.region), "other")
    for changed, message in [
        (replace(study, sources=[other], scans=None), "other scenes or problems"),
        (replace(study, sources=[*study.sources, other], scans=None), "other scenes or problems .not both have other"),
        (replace(study, seed=5), "seed 0, not 5"),
        (replace(study, time_limit=1.0), "time_limit None, not 1.0"),
        (replace(study, gating={"max_tuples": 9}), "gating"),
    ]:
        with pytest.raises(InvalidInputError, match=message):
            changed.run(whole)
    for old, now, message in [
        (f'"assoc": "{assoc.__version__}"', '"assoc": "0.0.1"', "begun with assoc 0.0.1, not"),
        (code_digest(), "0" * 16, "solvers or costs of assoc were changed"),
    ]:
        spoiled(whole, "UPDATE study SET manifest = replace(manifest, ?, ?)", old, now)
        with pytest.raises(InvalidInputError, match=message):
            study.run(whole)
        spoiled(whole, "UPDATE study SET manifest = replace(manifest, ?, ?)", now, old)
    # where the code is unknown the study goes on
    spoiled(whole, "UPDATE study SET manifest = replace(manifest, ?, '')", code_digest())
    assert study.run(whole).new == 0
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("mine")
    with pytest.raises(InvalidInputError, match="contains other files and no study"):
        study.run(tmp_path / "full")


def test_two_sweeps_at_once_share_a_study(study, whole, tmp_path):
    """The other one does everything while the first is at its first batch."""

    def other(counts):
        if not done:
            done.append(study.run(tmp_path / "s").new)

    done = []
    counts = study.run(tmp_path / "s", progress=other, batch_seconds=0.01)
    assert done == [40] and (counts.new, counts.before) == (0, 40) and same(load(tmp_path / "s"), load(whole))


def test_problems_and_problems_without_a_solution(tmp_path):
    easy = AssignmentProblem([[1, 1], [1, 2]], [-3.0, -1.0], [1, 2])
    none = AssignmentProblem([[1, 1], [2, 1]], [1.0, 2.0], [2, 2], dummy=False)
    study = Study([StudySource(easy, "easy"), StudySource(none, "none")], [*grid("greedy"), *grid("milp")], 1)
    study.run(tmp_path / "s")
    frame = load(tmp_path / "s").set_index(["scene", "solver"])
    assert frame.loc[("easy", "milp"), "cost"] == -3.0 and frame.loc[("easy", "milp"), "optimal"]
    assert frame.loc["none", "cost"].isna().all() and (frame.loc["none", "stopped_by"] == "infeasible").all()
    assert not frame.loc["none", "optimal"].any()


OLD = Path(__file__).parent / "study_of_version_1"


def test_a_study_of_version_1_is_read_into_a_new_folder(scene, tmp_path):
    for use in (load, lambda folder: Study([scene], grid("greedy")).run(folder)):
        with pytest.raises(InvalidInputError, match=f"assoc sweep import {OLD} NEW"):
            use(OLD)
    assert import_study(OLD, tmp_path / "new") == (12, 1)
    assert import_study(OLD, tmp_path / "new") == (12, 1)
    lines = (OLD / "runs.jsonl").read_text().splitlines()
    entries = [json.loads(line[9:]) for line in lines[:-1]]
    batches = [entry for entry in entries if "scan" in entry]
    frame, traces = load(tmp_path / "new"), load_traces(tmp_path / "new")
    assert {*frame["setting"]} == {entry["setting_key"] for entry in entries if "solver" in entry}
    for name in ("setting", "scan", "repeat", "seed", "cost", "iterations", "time", "correct_tuples"):
        assert sorted(frame[name]) == sorted(value for batch in batches for value in batch[name])
    points = [tuple(point) for batch in batches for trace in batch["trace"] for point in trace]
    assert sorted(points) == sorted(traces[["iteration", "seconds", "cost"]].itertuples(index=False, name=None))
    assert set(frame["scene"]) == {"scene.npz"} and set(frame["alpha"].dropna()) == {1.0, 2.0}
    with pytest.raises(InvalidInputError, match="holds no study of an earlier version"):
        import_study(tmp_path / "new", tmp_path / "again")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes that have names")
@pytest.mark.parametrize("name", [DATABASE, DATABASE + "-journal", PARAMETERS])
@pytest.mark.parametrize("planted", ["link", "link to nothing", "pipe", "device"])
def test_what_others_put_into_the_folder_is_not_followed(study, whole, tmp_path, name, planted):
    victim = tmp_path / "victim"
    kept = (whole / name).read_bytes() if (whole / name).exists() else b"mine"
    (whole / name).unlink(missing_ok=True)
    if planted == "pipe":
        os.mkfifo(whole / name)
    elif planted == "device":
        (whole / name).symlink_to("/dev/zero")
    else:
        if planted == "link":
            victim.write_bytes(kept)
        (whole / name).symlink_to(victim)
    with pytest.raises(InvalidInputError) as caught:
        study.run(whole)
    assert str(whole) in str(caught.value) and "\n" not in str(caught.value)
    assert victim.read_bytes() == kept if planted == "link" else not victim.exists()
    assert planted == "pipe" or (whole / name).is_symlink()

"""The store: nothing finished is lost, whatever happens; nothing is there twice."""

import json
import os
import zlib
from dataclasses import replace

import numpy as np
import pytest

from assoc.errors import InvalidInputError
from assoc.plotting.study_figures import draw_study
from assoc.problem import AssignmentProblem
from assoc.scene import Scene
from assoc.sweeps import Study, grid, load, load_traces
from assoc.sweeps.sources import StudySource, named_sources
from assoc.sweeps.store import LOG, MANIFEST, Store, damaged_lines, log_line, run_keys


def same(one, other):
    return one.drop(columns="time").equals(other.drop(columns="time"))


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


def test_traces_end_at_the_cost_of_their_run(whole):
    frame, traces = load(whole), load_traces(whole)
    last = traces.groupby(["setting", "scene", "scan", "repeat"])["cost"].last()
    costs = frame.set_index(["setting", "scene", "scan", "repeat"])["cost"]
    assert np.allclose(last.reindex(costs.index), costs)
    assert (traces.groupby(["setting", "scene", "scan", "repeat"])["cost"].diff().dropna() < 0).all()


def test_a_log_cut_anywhere_keeps_what_was_finished_and_goes_on(study, whole, tmp_path):
    expected = load(whole)
    log = (whole / LOG).read_bytes()
    lines = log.splitlines(keepends=True)
    ends = np.cumsum([len(line) for line in lines])
    cuts = [*range(0, len(log), max(1, len(log) // 40)), *ends, *(ends - 1), *(ends[:-1] + 1), ends[-1] - 2]
    for cut in cuts:
        folder = tmp_path / f"cut-{cut}"
        folder.mkdir(exist_ok=True)
        (folder / MANIFEST).write_bytes((whole / MANIFEST).read_bytes())
        (folder / LOG).write_bytes(log[:cut])
        with Store(folder, study.manifest) as store:
            finished = [json.loads(line[9:]) for line, end in zip(lines, ends, strict=True) if end <= cut]
            runs = {key for entry in finished if "scan" in entry for key in run_keys(entry)}
            assert store.done == runs
    for cut in (len(log) // 2, int(ends[-2]) + 3):
        folder = tmp_path / f"cut-{cut}"
        folder.mkdir(exist_ok=True)
        (folder / MANIFEST).write_bytes((whole / MANIFEST).read_bytes())
        (folder / LOG).write_bytes(log[:cut])
        counts = study.run(folder)
        assert counts.done == study.size and same(load(folder), expected)
        assert damaged_lines(folder) == (cut not in ends)
        assert study.run(folder).new == 0


def test_a_changed_byte_costs_its_line_alone(study, whole):
    expected = load(whole)
    log = bytearray((whole / LOG).read_bytes())
    log[len(log) - 30] ^= 1
    (whole / LOG).write_bytes(log)
    assert len(load(whole)) < study.size and damaged_lines(whole) == 1
    study.run(whole)
    assert same(load(whole), expected)


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("repeat", "1"), ("scan", True), ("seed", 2**70), ("seed", None), ("setting", 3), ("cost", "-1"),
        ("time", {}), ("iterations", 1.5), ("true_tuples", 10**30), ("stopped_by", ["x"]), ("trace", [[1, 2]]),
        ("trace", [["a", 0, 0]]),
    ],
)  # fmt: skip
def test_a_line_with_a_right_checksum_and_wrong_content_is_passed_over(whole, column, value):
    lines = (whole / LOG).read_bytes().splitlines(keepends=True)
    at = next(i for i, line in enumerate(lines) if b'"scan"' in line)
    entry = json.loads(lines[at][9:])
    entry[column][-1] = value
    lines[at] = log_line(entry)
    (whole / LOG).write_bytes(b"".join(lines))
    assert damaged_lines(whole) == 1
    assert len(load(whole)) == 40 - len(entry["scan"]) and len(load_traces(whole)) > 0


@pytest.mark.parametrize("value", [{"a": 1}, [1, 2], "high", None, True, 10**400, float("inf")])
def test_parameters_of_any_kind_are_shown(whole, value):
    """One setting has a value that no other has the like of: columns of mixed kinds are sorted all the same."""
    lines = (whole / LOG).read_bytes().splitlines(keepends=True)
    entry = json.loads(lines[0][9:])
    entry["parameters"]["alpha"] = value
    with open(whole / LOG, "wb") as file:
        body = json.dumps(entry).encode()
        file.write(b"%08x %s\n" % (zlib.crc32(body), body) + b"".join(lines[1:]))
    frame = load(whole)
    assert len(frame) == 40
    assert str(value) in set(map(str, frame["alpha"])) or value in (None, True) and frame["alpha"].nunique() >= 1


def test_a_changed_design_adds(study, whole):
    before = (whole / LOG).read_bytes()
    more = replace(study, settings=[*study.settings, *grid("greedy")], repeats=3)
    counts = more.run(whole)
    assert (counts.before, counts.new) == (40, 4 * 5 + 3 * 5)
    assert (whole / LOG).read_bytes().startswith(before)
    frame = load(whole)
    assert len(frame) == 75 and not frame.duplicated(["setting", "scene", "scan", "repeat"]).any()


def test_a_run_is_kept_once(study, whole):
    entries = [json.loads(line[9:]) for line in (whole / LOG).read_bytes().splitlines()]
    batch = next(entry for entry in entries if "scan" in entry)
    with Store(whole, study.manifest) as store:
        assert store.append(study.settings, batch) == 0
    # also if two processes should have written it
    with open(whole / LOG, "ab") as file:
        file.write((whole / LOG).read_bytes())
    assert len(load(whole)) == study.size


def test_another_study_is_refused(study, whole, scene, tmp_path):
    other = StudySource(Scene(scene.sensors, scene.times + 1.0, scene.measurements, region=scene.region), "other")
    for changed, message in [
        (replace(study, sources=[other], scans=None), "other scenes or problems: other is not among"),
        (replace(study, sources=[*study.sources, other], scans=None), "other is not among"),
        (replace(study, seed=5), "seed 0, not 5"),
        (replace(study, time_limit=1.0), "time_limit None, not 1.0"),
        (replace(study, gating={"max_tuples": 9}), "gating"),
    ]:
        with pytest.raises(InvalidInputError, match=message):
            changed.run(whole)
    content = json.loads((whole / MANIFEST).read_text())
    (whole / MANIFEST).write_text(json.dumps({**content, "assoc": "0.0.1"}))
    with pytest.raises(InvalidInputError, match="made by version 0.0.1 of assoc, this is"):
        study.run(whole)
    (whole / MANIFEST).write_text(json.dumps({**content, "code": "0" * 16}))
    with pytest.raises(InvalidInputError, match="solvers or costs of assoc were changed"):
        study.run(whole)
    # a study from before there was a digest goes on
    (whole / MANIFEST).write_text(json.dumps({key: content[key] for key in content if key != "code"}))
    assert study.run(whole).new == 0
    (whole / MANIFEST).write_text(json.dumps({**content, "version": 2}))
    with pytest.raises(InvalidInputError, match="has version 2"):
        study.run(whole)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("mine")
    with pytest.raises(InvalidInputError, match="contains other files and no study"):
        study.run(tmp_path / "full")


def test_a_renamed_file_is_the_same_scene(study, whole, scene, tmp_path):
    scene.save(tmp_path / "b.npz")
    again = StudySource(Scene.load(tmp_path / "b.npz"), "b.npz")
    assert replace(study, sources=[again], scans=None).run(whole).new == 0
    with pytest.raises(InvalidInputError, match="is the same as"):
        named_sources([scene, again.content], ["a.npz", "b.npz"])


def test_one_sweep_at_a_time(study, whole):
    with Store(whole, study.manifest), pytest.raises(InvalidInputError, match="another sweep is running"):
        study.run(whole)
    assert study.run(whole).new == 0


def test_problems_and_problems_without_a_solution(tmp_path):
    easy = AssignmentProblem([[1, 1], [1, 2]], [-3.0, -1.0], [1, 2])
    none = AssignmentProblem([[1, 1], [2, 1]], [1.0, 2.0], [2, 2], dummy=False)
    study = Study([StudySource(easy, "easy"), StudySource(none, "none")], [*grid("greedy"), *grid("milp")], 1)
    study.run(tmp_path / "s")
    frame = load(tmp_path / "s").set_index(["scene", "solver"])
    assert frame.loc[("easy", "milp"), "cost"] == -3.0 and frame.loc[("easy", "milp"), "optimal"]
    assert frame.loc["none", "cost"].isna().all() and (frame.loc["none", "stopped_by"] == "infeasible").all()
    assert not frame.loc["none", "optimal"].any()


@pytest.mark.parametrize("content", ["", "[]", "{", '{"format": "assoc.study", "version": 1}', "\x00"])
def test_a_damaged_manifest_is_one_clear_line(tmp_path, content):
    (tmp_path / MANIFEST).write_text(content)
    with pytest.raises(InvalidInputError, match=MANIFEST):
        load(tmp_path)


def test_without_its_manifest_the_runs_can_be_had_again(study, whole, tmp_path):
    """The message says how; and it works."""
    lost = (whole / MANIFEST).read_text()
    for spoil in (lambda: (whole / MANIFEST).unlink(), lambda: (whole / MANIFEST).write_text(lost[:40])):
        spoil()
        with pytest.raises(InvalidInputError, match="start the same sweep in a new folder, and copy its study.json"):
            study.run(whole)
        with Store(tmp_path / "new", study.manifest):
            pass
        (whole / MANIFEST).write_bytes((tmp_path / "new" / MANIFEST).read_bytes())
        assert study.run(whole).new == 0


def test_half_a_line_on_a_full_disk_is_taken_back(study, whole, tmp_path):
    """The same open store can go on once there is room."""

    class Full:
        def __init__(self, log):
            self.log, self.room = log, 100

        def write(self, data):
            if self.room == 0:
                raise OSError(28, "No space left on device")
            self.room = 0
            return self.log.write(data[:100])

        def __getattr__(self, name):
            return getattr(self.log, name)

    entries = [json.loads(line[9:]) for line in (whole / LOG).read_bytes().splitlines()]
    batches = [entry for entry in entries if "scan" in entry]
    with Store(tmp_path / "new", study.manifest) as store:
        log, store._log = store._log, Full(store._log)
        with pytest.raises(InvalidInputError, match="No space left on device"):
            store.append(study.settings, batches[0])
        store._log = log
        assert sum(store.append(study.settings, batch) for batch in batches) == study.size
    assert damaged_lines(tmp_path / "new") == 0 and same(load(tmp_path / "new"), load(whole))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes that have names")
@pytest.mark.parametrize("name", [LOG, MANIFEST, ".lock"])
@pytest.mark.parametrize("planted", ["link", "link to nothing", "pipe", "device"])
def test_what_others_put_into_the_folder_is_not_followed(study, whole, tmp_path, name, planted):
    victim = tmp_path / "victim"
    kept = (whole / name).read_bytes()
    (whole / name).unlink()
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
    if name == LOG:
        with pytest.raises(InvalidInputError, match="is a link, a pipe"):
            load(whole)


def test_a_picture_or_report_is_not_written_through_a_link(whole, tmp_path):
    (tmp_path / "victim").write_text("mine")
    (whole / "convergence.png").symlink_to(tmp_path / "victim")
    with pytest.raises(InvalidInputError, match=r"convergence.png: is a link"):
        draw_study(whole)
    assert (tmp_path / "victim").read_text() == "mine"

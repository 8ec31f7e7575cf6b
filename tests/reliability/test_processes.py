"""Threads, pools of processes, installations without a place for a cache, first runs at the same time."""

import os
import shutil
import subprocess
import sys
import textwrap
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pytest

import assoc
from assoc._system.processes import process_map
from assoc.ranking.kbest import kbest
from assoc.ranking.marginals import marginals
from assoc.simulation import simulate
from assoc.solvers.assign import assign
from assoc.tracking import MultiSensorTracker
from tests.oracles import small_problems
from tests.sizes import few_or_all

# a kernel of its own in a copied package: compiling the real ones takes a minute
KERNEL = """
from assoc._system.compiled import njit

@njit
def double(x):
    return 2.0 * x
"""


def answer(item):
    """Solve one problem; what must not depend on who else is at work."""
    name, number = item
    problem = list(small_problems(number + 1, seed=8, dummy=True))[number]
    found = assign(problem, name, seed=number)
    return found.tuples.tolist(), found.cost, found.lower_bound, found.iterations


def work(problems):
    names = ("exact", "greedy", "aco", "genetic", "tabu", "lagrangian")
    return [(name, number) for number in range(problems) for name in names]


@few_or_all("rounds", 1, 3)
def test_eight_threads_answer_like_one(rounds):
    items = work(2 * rounds)
    alone = [answer(item) for item in items]
    with ThreadPoolExecutor(8) as pool:
        for _ in range(rounds):
            assert list(pool.map(answer, items)) == alone


def test_threads_rank_track_and_weigh_alone():
    """Rankings, marginals and trackers in eight threads, each on its own scene."""

    def work(number):
        scene = simulate("three-radar", number, scans=4)
        problem = assoc.build_problem(scene, 0)
        weighed = marginals(problem)
        tracker = MultiSensorTracker.for_scene(scene)
        scans = [scene.scan(k) for k in range(scene.num_scans)]
        steps = [tracker.step(scan.time, scan.measurements) for scan in scans]
        return (
            [(one.cost, one.tuples.tobytes()) for one in kbest(problem, 5)],
            (weighed.probability.tobytes(), weighed.error.tobytes()),
            [[assigned.tobytes() for assigned in step.assigned] for step in steps],
            [(track.track_id, track.mean.tobytes()) for track in tracker.tracks],
        )

    alone = [work(number) for number in range(8)]
    with ThreadPoolExecutor(8) as pool:
        for _ in range(2):
            assert list(pool.map(work, range(8))) == alone


@pytest.mark.slow
@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_pools_of_processes(method):
    items = work(1)
    with ProcessPoolExecutor(2, mp_context=get_context(method)) as pool:
        assert list(pool.map(answer, items)) == [answer(item) for item in items]


def copied(folder: Path) -> Path:
    """A copy of what a kernel needs of the package, without compiled code."""
    package = folder / "assoc"
    package.mkdir(parents=True)
    original = Path(assoc.__file__).parent
    shutil.copytree(original / "_system", package / "_system", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(original / "errors.py", package / "errors.py")
    (package / "__init__.py").write_text("")
    (package / "kernel.py").write_text(KERNEL)
    return folder


def first_run(folder: Path, script: str = "", **environment: str) -> subprocess.Popen[str]:
    code = "from assoc.kernel import double\nassert double(3.0) == 6.0\n" + textwrap.dedent(script)
    environment = {**os.environ, "PYTHONPATH": str(folder), **environment}
    environment.pop("NUMBA_CACHE_DIR", None)
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-c", code], env=environment, text=True, cwd=folder,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


@pytest.mark.slow
def test_two_first_runs_at_once(tmp_path):
    folder = copied(tmp_path)
    runs = [first_run(folder) for _ in range(3)]
    assert [(one.communicate(timeout=600)[1], one.returncode) for one in runs] == [("", 0)] * 3
    assert list((folder / "assoc" / "__pycache__").glob("*.nbc"))
    again = first_run(folder, "assert sum(double.stats.cache_hits.values()) == 1")
    assert (again.communicate(timeout=600)[1], again.returncode) == ("", 0)


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["*.nbc", "*.nbi"])
def test_a_cache_cut_short_is_made_anew(tmp_path, suffix):
    folder = copied(tmp_path)
    first_run(folder).communicate(timeout=600)
    for kept in (folder / "assoc" / "__pycache__").glob(suffix):
        kept.write_bytes(kept.read_bytes()[:100])
    for script in ("", "assert sum(double.stats.cache_hits.values()) == 1"):
        again = first_run(folder, script)
        assert (again.communicate(timeout=600)[1], again.returncode) == ("", 0)


@pytest.mark.slow
def test_an_installation_that_cannot_be_written(tmp_path):
    """Neither the package nor the home can be written: the cache is temporary, shared with workers, and goes."""
    folder, temporary = copied(tmp_path / "site"), tmp_path / "tmp"
    temporary.mkdir()
    # files where numba wants folders keep even the superuser out
    (folder / "assoc" / "__pycache__").write_text("")
    (tmp_path / "home").write_text("")
    home = {"HOME": str(tmp_path / "home"), "XDG_CACHE_HOME": str(tmp_path / "home"), "TMPDIR": str(temporary)}
    script = """
    import os, subprocess, sys, numba
    assert not numba.config.CACHE_DIR and "NUMBA_CACHE_DIR" not in os.environ
    assert os.listdir(os.environ["TMPDIR"]) == [os.path.basename(os.path.dirname(double.stats.cache_path))]
    child = "from assoc.kernel import double; double(1.0); assert sum(double.stats.cache_hits.values()) == 1"
    subprocess.run([sys.executable, "-c", child], check=True)
    """
    one = first_run(folder, script, PYTHONDONTWRITEBYTECODE="1", **home)
    assert (one.communicate(timeout=600)[1], one.returncode) == ("", 0)
    assert os.listdir(temporary) == []


def test_this_process_works_while_others_start(tmp_path):
    """The first items are done here; others, as soon as the other process is there, by both."""
    here, there = os.getpid(), tmp_path / "there"

    def task(item):
        if os.getpid() != here:
            there.touch()
        for _ in range(6000 if item == 5 and os.getpid() == here else 0):
            if there.exists():
                break
            time.sleep(0.01)
        return item, os.getpid()

    for ordered in (True, False):
        there.unlink(missing_ok=True)
        found = list(process_map(task, range(40), 2, ordered=ordered, here=True))
        assert sorted(item for item, _ in found) == list(range(40)) and found[0] == (0, here)
        assert len({process for _, process in found}) == 2
        assert not ordered or [item for item, _ in found] == list(range(40))


def test_an_error_here_is_raised_in_its_turn():
    results = process_map(lambda item: 1 / (item - 3), range(40), 2, here=True)
    assert [next(results) for _ in range(3)] == [1 / -3, 1 / -2, -1.0]
    with pytest.raises(ZeroDivisionError):
        next(results)


@pytest.mark.parametrize("ordered", [True, False])
def test_what_others_have_done_is_handed_on_when_this_process_is_interrupted(tmp_path, ordered):
    here, done = os.getpid(), tmp_path / "done"

    def task(item):
        if os.getpid() != here:
            done.write_text("one")
        elif item > 0:
            for _ in range(6000):
                if done.exists():
                    time.sleep(0.2)
                    raise KeyboardInterrupt
                time.sleep(0.01)
        return item

    found = []
    with pytest.raises(KeyboardInterrupt):
        for result in process_map(task, range(40), 2, ordered=ordered, here=True):
            found.append(result)
    # item 0 was done here, and item 1 was at work
    assert found == [0] if ordered else len(found) > 1

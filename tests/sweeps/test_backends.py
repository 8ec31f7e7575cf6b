"""Every backend and any number of workers give the same results, also when workers die."""

import signal

import pytest

from assoc.errors import InvalidInputError, LimitExceededError
from assoc.sweeps import Study, grid, load, load_traces
from assoc.sweeps.sources import StudySource
from assoc.sweeps.study import Batches

# many batches, so that there is a middle to interrupt in
SMALL = {"batch_seconds": 0.04}


def same(one, other):
    traces = [load_traces(folder).drop(columns="seconds") for folder in (one, other)]
    key = ["setting", "scene", "scan", "repeat", "iteration", "cost"]
    traces = [table.sort_values(key, ignore_index=True) for table in traces]
    frames = [load(folder).drop(columns="time") for folder in (one, other)]
    return frames[0].equals(frames[1]) and traces[0].equals(traces[1])


@pytest.fixture(scope="module")
def slow(scene_of_module):
    """Runs of some 10 ms, so that there is a middle to kill in."""
    settings = grid("aco", {"mode": ["paper"], "ants": [30], "alpha": [1, 2], "beta": [1, 2]})
    return Study([scene_of_module], settings, 8)


@pytest.fixture(scope="module")
def scene_of_module():
    from assoc.simulation import simulate

    return StudySource(simulate("three-radar", 2, scans=5), "scene")


@pytest.fixture(scope="module")
def expected(slow, tmp_path_factory):
    folder = tmp_path_factory.mktemp("studies") / "expected"
    slow.run(folder)
    return folder


def test_batches_take_about_their_time_and_leave_nothing_out(study):
    runs = list(study.all_runs())
    batches = Batches(iter(runs), 1.0)
    first = next(batches)
    assert len(first) == 8
    # each took a quarter of the time
    batches.learn(first, 2.0)
    rest = [*batches]
    assert {*map(len, rest)} == {4} and [run for batch in [first, *rest] for run in batch] == runs


@pytest.mark.slow
def test_an_interrupted_study_goes_on_in_processes_and_is_the_same(slow, expected, tmp_path):
    class EnoughError(Exception):
        pass

    def enough(counts):
        if counts.new >= 30:
            raise EnoughError

    with pytest.raises(EnoughError):
        slow.run(tmp_path / "s", progress=enough, **SMALL)
    assert 30 <= len(load(tmp_path / "s")) < slow.size
    counts = slow.run(tmp_path / "s", jobs=2)
    assert counts.before >= 30 and same(tmp_path / "s", expected)


@pytest.mark.slow
def test_a_killed_process_of_the_pool_loses_nothing_finished(slow, expected, tmp_path):
    import psutil

    def kill_one(counts):
        if counts.new >= 20 and not killed:
            children = psutil.Process().children()
            worker = next(one for one in children if "_system.processes" in " ".join(one.cmdline()))
            killed.append(worker.pid)
            worker.kill()

    killed = []
    with pytest.raises(LimitExceededError, match="a worker process died.*same command goes on") as raised:
        slow.run(tmp_path / "s", jobs=2, progress=kill_one, **SMALL)
    assert "\n" not in str(raised.value)
    assert 20 <= len(load(tmp_path / "s")) < slow.size
    slow.run(tmp_path / "s")
    assert same(tmp_path / "s", expected)


@pytest.mark.slow
def test_a_cluster_gives_the_same_and_survives_the_loss_of_its_workers(
    slow, expected, scheduler, start_worker, tmp_path
):
    packed, seen = [], {}

    class Packed(StudySource):
        """Counts how often it is sent."""

        def __reduce__(self):
            packed.append(1)
            return StudySource, (self.content, self.name)

    (source,) = slow.sources
    study = Study([Packed(source.content, source.name)], slow.settings, 8)
    workers = [start_worker(), start_worker()]

    def lose(counts):
        if counts.new >= 40 and "one lost" not in seen:
            # once for the scatter, whatever the number of batches (one more where it is measured first)
            seen["packed"] = len(packed)
            workers[0].kill()
            workers[0].wait(100)
            seen["one lost"] = counts.new
        elif counts.new >= 80 and "all lost" not in seen:
            seen["left"] = workers[1].poll()
            workers[1].kill()
            start_worker()
            seen["all lost"] = counts.new

    counts = study.run(tmp_path / "s", scheduler=scheduler, progress=lose, **SMALL)
    assert 1 <= seen["packed"] <= 2
    # it went on with the one worker that was left, and then with a new one alone
    assert seen["left"] is None and 40 <= seen["one lost"] < seen["all lost"] < slow.size
    assert [worker.poll() for worker in workers] == [-signal.SIGKILL] * 2
    # complete, without doubles, and the same
    assert counts.new == slow.size == len(load(tmp_path / "s")) and same(tmp_path / "s", expected)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense://", "127.0.0.1:9"])
def test_no_scheduler_is_one_clear_line(address):
    from assoc._system.cluster import connect

    with pytest.raises(InvalidInputError, match="--scheduler: no scheduler answers at") as raised:
        connect(address, timeout=1.0)
    assert "\n" not in str(raised.value)

"""What goes wrong around a program: the disk is full, the folder read-only, a process killed."""

import contextlib
import json
import operator
import os
import signal
import subprocess
import sys
import threading
import time
import types
from functools import partial
from pathlib import Path

import pytest

from assoc._system.processes import leave, process_map, send, start_python
from assoc.errors import InvalidInputError, LimitExceededError
from assoc.simulation import simulate
from tests.running import process
from tests.told import told

PYTHON = [sys.executable, "-W", "error", "-m"]


@pytest.fixture(scope="module")
def scene_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenes") / "scene.npz"
    simulate("three-radar", 2, scans=4).save(path)
    return path


def test_stdout_on_a_full_disk(scene_file):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*PYTHON, "assoc.solve", str(scene_file), "--solver", "greedy"],
            stdout=full, stderr=subprocess.PIPE, text=True, timeout=600,
        )  # fmt: skip
    assert done.returncode == 2 and told(done.stderr) == "assoc.solve: error: No space left on device\n"


def children(pid):
    """Process ids of a process's children that are at work in Python."""
    found = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        # what ends meanwhile is not at work
        with contextlib.suppress(OSError):
            for child in (task / "children").read_text().split():
                if b"_system.processes" in Path(f"/proc/{child}/cmdline").read_bytes():
                    found.append(int(child))
    return found


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="finds the workers through /proc")
def test_a_killed_worker_is_one_clear_line(tmp_path):
    simulate("three-radar", 2, scans=400).save(tmp_path / "long.npz")
    command = [*PYTHON, "assoc.solve", "long.npz", "--solver", "aco", "--jobs", "2", "--json", "out.json"]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            end = time.monotonic() + 600
            while not children(process.pid) and time.monotonic() < end:
                time.sleep(0.02)
            os.kill(children(process.pid)[0], signal.SIGKILL)
            _, complaint = process.communicate(timeout=600)
            complaint = told(complaint)
        finally:
            process.kill()
    assert process.returncode == 3 and complaint.count("\n") == 1, complaint
    assert "a worker process died" in complaint and "fewer processes" in complaint
    # what the program itself had done is written
    if os.path.exists(tmp_path / "out.json"):
        done = len(json.loads((tmp_path / "out.json").read_text())["scans"])
        assert 0 < done < 400 and f"{done} of 400 scans are finished and written" in complaint
    assert {*os.listdir(tmp_path)} <= {"long.npz", "out.json"}


def test_a_worker_that_dies_is_an_error_of_the_library():
    with pytest.raises(LimitExceededError, match="worker process died"):
        list(process_map(os._exit, [1, 1], 2))


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="finds the workers through /proc")
def test_a_worker_that_dies_before_it_has_read_a_large_task():
    large = partial(operator.getitem, bytes(10**8))
    killed = []

    def kill():
        while not killed:
            for child in children(os.getpid()):
                os.kill(child, signal.SIGKILL)
                killed.append(child)

    killer = threading.Thread(target=kill)
    killer.start()
    with pytest.raises(LimitExceededError, match="worker process died"):
        list(process_map(large, [1, 2], 2))
    killer.join()


def test_functions_of_a_script_and_what_they_print(tmp_path):
    """A script needs no guard, and its functions no module; stdout is the script's own."""
    script = tmp_path / "script.py"
    script.write_text(
        "import pathlib, sys\n"
        "from assoc._system.processes import process_map\n"
        "sys.path.append(pathlib.Path())\n"
        "print([*process_map(lambda item: sys.stdout.write('said\\n') and 2 * item, range(5), 2)])\n"
    )
    done = process(script)
    assert (done.returncode, done.stdout, done.stderr) == (0, "[0, 2, 4, 6, 8]\n", "said\n" * 5)


def test_what_other_processes_cannot_import_is_said(monkeypatch):
    monkeypatch.setitem(sys.modules, "only_here", types.ModuleType("only_here"))
    exec("def task(item): pass", vars(sys.modules["only_here"]))
    with pytest.raises(InvalidInputError, match="jobs: .* cannot be imported by other processes .*only_here"):
        list(process_map(sys.modules["only_here"].task, [1, 2], 2))


def test_a_process_that_is_to_leave_finishes_what_it_is_at(tmp_path):
    """And nothing behind it: kernels that compile for minutes would outlive their program."""
    process = start_python(sys.path, stdout=subprocess.PIPE)
    send(process, operator.call)
    for name in ("first", "second"):
        send(process, partial(os.system, f"touch {tmp_path}/{name}-begun; sleep 1; touch {tmp_path}/{name}"))
    while not (tmp_path / "first-begun").exists():
        time.sleep(0.01)
    leave(process)
    process.communicate(timeout=300)
    assert sorted(os.listdir(tmp_path)) == ["first", "first-begun"] and process.returncode == 0


def test_an_error_comes_back_with_where_it_came_from():
    with pytest.raises(ZeroDivisionError) as raised:
        list(process_map(partial(operator.floordiv, 1), [1, 0], 2))
    assert "_answer" in raised.value.__notes__[0]

"""A real dask cluster on this machine: a scheduler, and workers that are started and killed."""

import json
import subprocess
import sys
import time

import pytest

DASK = [sys.executable, "-m", "dask"]


class Address(str):
    """Where a scheduler listens, and its process."""

    def __new__(cls, text, process):
        made = super().__new__(cls, text)
        made.process = process
        return made


def start(words, folder, log):
    with open(folder / log, "w") as file:
        return subprocess.Popen([*DASK, *words], cwd=folder, stdout=file, stderr=file)


def stop(process):
    process.terminate()
    try:
        process.wait(10)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait(10)


@pytest.fixture
def scheduler(tmp_path):
    process = start(
        ["scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", "s.json"],
        tmp_path,
        "scheduler.log",
    )
    try:
        deadline = time.monotonic() + 300
        while not (tmp_path / "s.json").exists():
            assert process.poll() is None and time.monotonic() < deadline, (tmp_path / "scheduler.log").read_text()
            time.sleep(0.05)
        time.sleep(0.2)
        yield Address(json.loads((tmp_path / "s.json").read_text())["address"], process)
    finally:
        stop(process)


@pytest.fixture
def start_worker(scheduler, tmp_path):
    """A function that starts one more worker process."""
    words = ["worker", scheduler, "--nthreads", "1", "--no-dashboard", "--no-nanny", "--host", "127.0.0.1"]
    processes = []

    def start_one():
        processes.append(start(words, tmp_path, f"worker-{len(processes)}.log"))
        return processes[-1]

    try:
        yield start_one
    finally:
        for process in processes:
            stop(process)

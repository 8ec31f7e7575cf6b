"""The overhead of a parameter study, its time without the solves, on every backend.

The wall time of a study from the moment when a tenth of its runs is done until its end, less the seconds that those
runs took in the solver, shared among the workers, is the overhead of these runs: all of it, from design to disk.
The start of processes comes before and is reported separately. Runs that take longer (those of the paper's ant colony)
are sent in smaller batches than short ones (greedy): batches hold 0.2 s of work, 0.5 s on a cluster.

Wall times grow with the load of the machine, so the processor time of the sweeping process is given, too: with
workers all of it, in one process the share outside the solver. Full size: 3,000 runs of greedy and 600 of the ants, two
workers.
"""

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from assoc.simulation import simulate
from assoc.sweeps import Setting, Study
from assoc.sweeps.sources import StudySource
from assoc.sweeps.study import Counts
from experiments.common.claims import Claim, with_goal
from experiments.common.command import main

WORKERS = 2
GOALS = {"one process": 1.0, "two processes": 1.0, "dask": 5.0}
KINDS = {"greedy": Setting("greedy", {}), "ant colony": Setting("aco", {"mode": "paper"})}


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """Measure the overhead of each backend."""
    scene = StudySource(simulate("three-radar", int(rng.integers(2**31)), scans=20 if quick else 100), "three-radar")
    repeats = {"greedy": 12 if quick else 30, "ant colony": 3 if quick else 6}
    claims = []
    for kind, setting in KINDS.items():
        study = Study([scene], [setting], repeats[kind])
        for backend, goal in GOALS.items():
            overhead, processor, start, solving = _overhead(study, backend)
            words = f"{kind}, {backend}"
            claims += [
                with_goal(f"{words}: overhead a run", "ms", 1e3 * overhead, most=goal),
                with_goal(f"{words}: processor time of the sweep, a run", "ms", 1e3 * processor, most=goal),
                Claim(f"{words}: in the solver, a run", "ms", None, 1e3 * solving),
                Claim(f"{words}: until a tenth of {study.size} runs is done", "s", None, start),
            ]
    return claims


def _overhead(study: Study, backend: str) -> tuple[float, float, float, float]:
    """Seconds: overhead a run, processor time of it, until a tenth of the runs was done, in the solver a run."""
    workers = 1 if backend == "one process" else WORKERS
    marks: list[tuple[float, float, int, float]] = []

    def progress(counts: Counts) -> None:
        if 10 * counts.new >= counts.total and not marks:
            marks.append((time.perf_counter(), time.process_time(), counts.new, counts.solving))

    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="assoc-")))
        how: dict[str, Any] = {"jobs": workers}
        if backend == "dask":
            how = {"scheduler": stack.enter_context(cluster(folder))}
        begin = time.perf_counter()
        counts = study.run(folder / "study", progress=progress, **how)
        end, processor_end = time.perf_counter(), time.process_time()
    middle, processor, runs, solving = marks[0]
    runs, solving = counts.new - runs, counts.solving - solving
    processor = processor_end - processor
    if workers == 1:
        processor *= 1.0 - solving / (end - middle)
    return (end - middle - solving / workers) / runs, processor / runs, middle - begin, solving / runs


@contextmanager
def cluster(folder: Path) -> Iterator[str]:
    """A dask scheduler with workers on this machine; its address."""
    dask = [sys.executable, "-m", "dask"]
    quiet: dict[str, Any] = {"cwd": folder, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    local = ["--host", "127.0.0.1", "--no-dashboard"]
    processes = [subprocess.Popen([*dask, "scheduler", *local, "--port", "0", "--scheduler-file", "s.json"], **quiet)]
    try:
        deadline = time.monotonic() + 60
        address = ""
        while not address:
            if processes[0].poll() is not None or time.monotonic() > deadline:
                raise SystemExit("no dask scheduler: pip install 'assoc[dask]'")
            time.sleep(0.1)
            try:
                address = json.loads((folder / "s.json").read_text())["address"]
            except (OSError, ValueError):
                continue
        words = [*dask, "worker", address, *local, "--nthreads", "1", "--no-nanny"]
        processes += [subprocess.Popen(words, **quiet) for _ in range(WORKERS)]
        _wait_for_workers(address)
        yield address
    finally:
        # nothing of theirs is needed any more: no orderly farewell, which can take long
        for process in reversed(processes):
            process.kill()
            process.wait()


def _wait_for_workers(address: str) -> None:
    from distributed import Client

    with Client(address, set_as_default=False) as client:
        client.wait_for_workers(WORKERS, timeout=60)


if __name__ == "__main__":
    raise SystemExit(main("sweep_overhead", experiment, __doc__))

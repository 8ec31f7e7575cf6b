"""Any solver as a command: started once for each instance, watched while it runs, judged by assoc/check.py."""

import lzma
import os
import shlex
import signal
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from assoc import check
from experiments.common.measuring import one_core
from experiments.sdlib import store
from experiments.sdlib.instances import Instance

# seconds from one look at a running command to the next; wall time at the most: a multiple of CPU time, and more
_LOOK = 0.05
_PATIENT, _START = 12.0, 60.0


def run_command(picked: list[Instance], command: str, seconds: float) -> Iterator[dict[str, Any]]:
    """Run a command with ``{instance}`` and ``{solution}`` in it, on one core each; a row for each instance.

    It may write its solution again whenever it has found a better one: what lies there is judged when it changes. It is
    stopped after so many seconds of CPU time (of wall time where the system does not tell of CPU times).

    Raises OSError: It cannot be started.
    """
    known = store.table()
    with tempfile.TemporaryDirectory() as folder:
        path, solution = Path(folder) / "instance.txt", Path(folder) / "solution.txt"
        for instance in picked:
            path.write_bytes(lzma.open(store.instance_file(instance.name)).read())
            solution.unlink(missing_ok=True)
            problem = check.read_problem(str(path))
            words = [word.format(instance=path, solution=solution) for word in shlex.split(command)]
            row: dict[str, Any] = {"instance": instance.name, "solver": "command"}
            row |= _watched(words, solution, seconds, problem)
            best = known.get(instance.name, {}).get("value")
            row["excess"] = None if best is None or row["cost"] is None else float(row["cost"]) - float(best)
            yield row


def _watched(words: list[str], solution: Path, seconds: float, problem: check.Problem) -> dict[str, Any]:
    trace: list[list[Any]] = []
    seen, used, started = 0, 0.0, time.perf_counter()
    with one_core():
        process = subprocess.Popen(
            words,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )
    while True:
        code = process.poll()
        wall = time.perf_counter() - started
        used = max(used, _cpu_seconds(process.pid, wall))
        changed = solution.stat().st_mtime_ns if solution.exists() else 0
        if changed != seen:
            seen = changed
            cost, _ = _judge(solution, problem)
            if cost is not None and (not trace or float(cost) < trace[-1][1]):
                trace.append([round(used, 3), float(cost), None])
        if code is not None or used >= seconds or wall >= _PATIENT * seconds + _START:
            break
        time.sleep(_LOOK)
    if code is None:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    cost, fault = _judge(solution, problem)
    row = {"trace": trace, "seconds": round(used, 3), "exit": code, "cost": cost, "proved": False}
    return row if fault is None else {**row, "fault": fault}


def _judge(solution: Path, problem: check.Problem) -> tuple[str | None, str | None]:
    """The cost of what a command left behind, or what is wrong with it."""
    try:
        chosen, _ = check.read_solution(check.read_text(str(solution)))
        return store.exact_cost(problem, chosen), None
    except FileNotFoundError:
        return None, "no solution was written"
    except (OSError, ValueError, check.RefusedError) as error:
        return None, str(error)


def _cpu_seconds(process: int, wall: float) -> float:
    """CPU time of a process and of those of its children that have ended; wall time where the system does not tell."""
    try:
        words = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return wall if not Path("/proc/self/stat").exists() else 0.0
    return sum(map(int, words[11:15])) / os.sysconf("SC_CLK_TCK")

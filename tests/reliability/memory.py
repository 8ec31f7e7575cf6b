"""How much memory does every solver, ranking and marginals take on a million tuples?

    python -m tests.reliability.memory [--limit 10] [--ways exact,kbest] [--problems "ghosts 1e6"]

Each in a process of its own (Linux), which has solved small problems first, so that what is counted is not the
compiler's. Printed are the megabytes above those of the process before it had the problem, at their peak, and what
of them is the problem itself.
"""

import argparse
import contextlib
import ctypes
import gc
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from assoc.problem import AssignmentProblem
from tests.reliability.big import BIG, axial, ghosts
from tests.reliability.limits import WAYS

Make = Callable[[], AssignmentProblem]


def resident(field: str = "VmRSS") -> int:
    """Bytes of memory of this process: VmRSS now, VmHWM at the most since `forget_peak`."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return 1024 * next(int(line.split()[1]) for line in lines if line.startswith(f"{field}:"))


def forget_peak() -> None:
    """Count the peak from now on."""
    Path("/proc/self/clear_refs").write_text("5")


def tidy() -> None:
    """Give freed memory back to the system, so that it is not taken for memory in use."""
    gc.collect()
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def peak_of(work: Callable[[], Any]) -> tuple[Any, int]:
    """Do some work; its result, and how many bytes it took at the most more than there were before."""
    tidy()
    before = resident()
    forget_peak()
    result = work()
    return result, resident("VmHWM") - before


def measure(make: Make, way: str, limit: float) -> dict[str, Any]:
    """Measure one way of solving in this process."""
    import numpy as np

    from tests.oracles import gated_problem

    for small in (gated_problem(np.random.default_rng(0), (6, 6, 6), 0.3), axial(10), ghosts(40, 20_000)):
        WAYS[way](small, 1.0)
    tidy()
    before = resident()
    problem = make()
    tidy()
    own = resident() - before
    found, more = peak_of(lambda: WAYS[way](problem, limit))
    answer = found[0] if isinstance(found, list) else found
    return {
        "tuples": problem.num_tuples,
        "problem": own,
        "peak": own + more,
        "stopped_by": getattr(answer, "stopped_by", ""),
    }


def main(arguments: list[str] | None = None) -> int:
    """Run the program; exit code 1 if something takes more than it may."""
    parser = argparse.ArgumentParser(description="Memory on a million tuples.")
    parser.add_argument("--limit", type=float, default=10.0, help="seconds for each")
    parser.add_argument("--ways", default=",".join(WAYS))
    parser.add_argument("--problems", default=",".join(BIG))
    parser.add_argument("--most", type=float, default=2000.0, help="megabytes that are too much")
    parser.add_argument("--here", action="store_true", help=argparse.SUPPRESS)
    chosen = parser.parse_args(arguments)
    ways, problems = chosen.ways.split(","), chosen.problems.split(",")
    if chosen.here:
        print(json.dumps(measure(BIG[problems[0]], ways[0], chosen.limit)))
        return 0
    worst = 0.0
    print(f"| MB at the peak | {' | '.join(problems)} |\n|---|{'---|' * len(problems)}", flush=True)
    for way in ways:
        print(f"| {way} |", end="", flush=True)
        for problem in problems:
            command = [sys.executable, "-m", "tests.reliability.memory", "--here", "--ways", way, "--problems", problem]
            done = subprocess.run([*command, "--limit", str(chosen.limit)], capture_output=True, text=True, check=True)
            found = json.loads(done.stdout.splitlines()[-1])
            worst = max(worst, found["peak"] / 1e6)
            print(f" {found['peak'] / 1e6:.0f} ({found['problem'] / 1e6:.0f}) |", end="", flush=True)
        print(flush=True)
    print(f"allowed {chosen.most:.0f} MB, worst {worst:.0f} MB")
    return 1 if worst > chosen.most else 0


if __name__ == "__main__":
    sys.exit(main())

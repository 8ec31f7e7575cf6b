"""How time and memory grow: one process per size, so that peak memory is that size's own.

``python -m experiments.benchmarks.scale TARGETS SEED`` prints one line of JSON.
"""

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from experiments.benchmarks import FIRST_SEED
from experiments.benchmarks.rows import Row

SIZES = (1_000, 3_000, 10_000)
LIMIT = 120.0


def measure(targets: int, seed: int) -> dict[str, float | str]:
    """Associate one scan of the radar field, from the scene to the Solution.

    Returns dict: ``seconds`` in all, of which ``building``; ``tuples``, ``cost``, ``bound``, ``status``, ``peak_mb``.
    """
    import assoc
    from experiments.benchmarks.run import one_core
    from experiments.common.instances import scenes

    with one_core():
        for warm, few in ((0, 50), (1, 50), (2, 300), (3, 1_000)):
            assoc.assign(assoc.build_problem(scenes.radar_field(few, warm), 0), time_limit=LIMIT)
        scene = scenes.radar_field(targets, seed)
        start = time.perf_counter()
        problem = assoc.build_problem(scene, 0)
        built = time.perf_counter()
        solution = assoc.assign(problem, time_limit=LIMIT)
        end = time.perf_counter()
    return {
        "seconds": end - start,
        "building": built - start,
        "tuples": problem.num_tuples,
        "cost": solution.cost,
        "bound": solution.lower_bound,
        "status": solution.status,
        "peak_mb": peak_mb(),
    }


def peak_mb() -> float:
    """Return the most memory that this process has had."""
    status = Path("/proc/self/status")
    if status.exists():
        # Linux lets a child inherit the maximum that getrusage tells from the process that started it
        peak = next(line for line in status.read_text().splitlines() if line.startswith("VmHWM"))
        return float(peak.split()[1]) / 1e3
    import resource

    # bytes on macOS, kilobytes elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)


def run(seeds: int | None, log: Callable[[str], None]) -> list[Row]:
    """Measure every size, each run in a process of its own."""
    rows = []
    for targets in SIZES:
        for seed in range(FIRST_SEED, FIRST_SEED + (seeds or 5)):
            command = [sys.executable, "-m", "experiments.benchmarks.scale", str(targets), str(seed)]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            found = json.loads(done.stdout)
            log(f"scale {targets} seed {seed}: {done.stdout.strip()}")
            rows.append(
                Row(
                    "scale",
                    str(targets),
                    seed,
                    0,
                    found["tuples"],
                    "exact",
                    False,
                    LIMIT,
                    found["cost"],
                    found["bound"],
                    found["seconds"],
                    found["status"],
                    found["cost"],
                    found["status"] == "optimal",
                    found["peak_mb"],
                )
            )
    return rows


def program(arguments: list[str] | None = None) -> int:
    """Measure one size and print it as JSON; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.benchmarks.scale",
        description="Associate one simulated scan of three radars; print time, memory and cost as one line of JSON.",
    )
    parser.add_argument("targets", type=int, metavar="TARGETS", help="number of targets")
    parser.add_argument("seed", type=int, metavar="SEED", help="seed of the scene")
    chosen = parser.parse_args(arguments)
    if chosen.targets < 1 or chosen.seed < 0:
        parser.error("expected TARGETS of at least 1 and SEED of at least 0")
    print(json.dumps(measure(chosen.targets, chosen.seed)))
    return 0


if __name__ == "__main__":
    sys.exit(program())

"""Has something become twice as slow? Processor times as multiples of HiGHS's, beside those of a committed file.

Each piece of work is done in turns with one fixed problem for HiGHS (scipy), in one process, with all kernels compiled:
the median of the ratios depends little on the machine and on what else it does. What is more than twice its figure in
bench_quick.json is measured once more, and makes the exit code 1 if it stays so. ``--write`` writes the file.
"""

import argparse
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

FILE = Path(__file__).with_suffix(".json")
WORSE = 2.0
_ROUNDS, _LEAST = 7, 0.05


def _work() -> tuple[dict[str, Callable[[], Any]], Callable[[], Any]]:
    """What is timed by name, and HiGHS's problem."""
    import assoc
    from assoc.simulation import simulate
    from assoc.tracking import TRACKERS, track_scene
    from experiments.common.contestants import run
    from experiments.common.instances import scenes, synthetic
    from experiments.common.measuring import fresh

    gated, ghosts = scenes.gated(3, 300, 1), assoc.build_problem(scenes.ghost(20, 1), 0)
    small, axial = assoc.build_problem(scenes.gated(3, 100, 1), 0), synthetic.axial_random(12, 1)
    radars = simulate("three-radar", 1, scans=20)

    def solve(problem: assoc.AssignmentProblem, solver: str, **options: Any) -> Callable[[], Any]:
        return lambda: assoc.assign(fresh(problem), solver, seed=1, advise=False, **options)

    work = {
        "candidates of 300 targets": lambda: assoc.build_problem(gated, 0),
        "exact, 300 targets": solve(assoc.build_problem(gated, 0), "exact"),
        "exact, 20 ghosts": solve(ghosts, "exact"),
        "exact, axial": solve(axial, "exact"),
        "lagrangian, 20 ghosts": solve(ghosts, "lagrangian"),
        **{f"{name}, 20 ghosts": solve(ghosts, name, iterations=20) for name in ("aco", "genetic", "tabu")},
        "greedy, 300 targets": solve(assoc.build_problem(gated, 0), "greedy"),
        "kbest, 100 targets": lambda: assoc.kbest(small, 10),
        **{
            f"{name}, three radars": lambda name=name: track_scene(TRACKERS[name].for_scene(radars), radars)
            for name in ("multi-sensor", "mht", "joint-probabilistic")
        },
    }
    return work, lambda: run("highs", small, 60.0)


def _seconds(call: Callable[[], Any]) -> float:
    """Processor time of a call, done again until there is enough to measure."""
    count, begin = 0, time.process_time()
    while (spent := time.process_time() - begin) < _LEAST:
        call()
        count += 1
    return spent / count


def ratio(call: Callable[[], Any], peer: Callable[[], Any]) -> float:
    """Median of the processor time of a call over that of the peer, in turns."""
    call()
    return median(_seconds(call) / _seconds(peer) for _ in range(_ROUNDS))


def slower(known: dict[str, float], measure: Callable[[str], float]) -> dict[str, float]:
    """What takes more than `WORSE` times the known figure, twice, and how many times it takes that."""
    found = {}
    for name, figure in known.items():
        times = measure(name) / figure
        if times > WORSE:
            times = min(times, measure(name) / figure)
        print(f"{name:32} {times:6.2f} times the figure{' TOO SLOW' if times > WORSE else ''}", flush=True)
        if times > WORSE:
            found[name] = times
    return found


def main(arguments: list[str] | None = None) -> int:
    """Measure and compare; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m experiments.bench_quick", description=__doc__.split("\n")[0])
    parser.add_argument("--write", action="store_true", help=f"write {FILE.name} instead of comparing with it")
    chosen = parser.parse_args(arguments)
    # nothing is to be interpreted, and numerical libraries run on one thread: before they are loaded
    os.environ |= {"ASSOC_INTERPRET": "0", "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    work, peer = _work()
    if chosen.write:
        figures = {name: round(ratio(call, peer), 4) for name, call in work.items()}
        FILE.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
        return 0
    known = json.loads(FILE.read_text(encoding="utf-8"))
    if {*known} != {*work}:
        parser.error(f"{FILE.name}: expected the figures of {', '.join(work)}: --write writes it")
    return 1 if slower(known, lambda name: ratio(work[name], peer)) else 0


if __name__ == "__main__":
    raise SystemExit(main())

"""The same bytes with a cold cache, with a warm one, and on 1, 2 and 4 processes, cold or warm.

    python -m tests.trust.cold_cache      (make test-cold; compiles for a minute or two)

A cold process compiles every kernel, a warm one loads it: what comes out must not depend on that. A scene is
solved with an empty cache folder by two processes at once, which compile at the same time, then by one and
by four, and with the cache that this tree has.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

_MEASURED = ("runtime", "seconds")
"""Fields that are measurements of time."""


def run(*words: str, cwd: Path, cache: Path | None = None) -> None:
    """Run a program, with a cache of its own if that is given."""
    root = Path(__file__).resolve().parents[2]
    paths = os.pathsep.join(filter(None, [str(root), os.environ.get("PYTHONPATH", "")]))
    environment = {**os.environ, "PYTHONPATH": paths, **({} if cache is None else {"NUMBA_CACHE_DIR": str(cache)})}
    command = [sys.executable, "-W", "error", "-m", *words]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment, cwd=cwd)


def without_times(path: Path) -> str:
    """Content of a result file without its measurements of time."""

    def cleaned(value: object) -> object:
        if isinstance(value, dict):
            return {key: cleaned(one) for key, one in value.items() if key not in _MEASURED}
        return [cleaned(one) for one in value] if isinstance(value, list) else value

    return json.dumps(cleaned(json.loads(path.read_text())))


RUNS = {
    "aco": (["--solver", "aco", "--iterations", "5"], ((2, "cold"), (1, "cold"), (4, "cold"), (1, "own"))),
    "exact": (["--solver", "exact"], ((1, "cold"), (2, "cold"), (1, "own"))),
}
"""Options, and with how many processes and which cache; the first of a solver is the one that compiles."""


def main() -> int:
    """Run the program; exit code 1 if something differs."""
    wrong = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run("assoc.simulate", "three-radar", "--scans", "8", "-o", "scene.npz", cwd=folder)
        for solver, (options, ways) in RUNS.items():
            found = {}
            for jobs, cache in ways:
                output = f"{solver}-{jobs}-{cache}.json"
                words = ["assoc.solve", "scene.npz", *options, "--seed", "3", "--jobs", str(jobs), "--json", output]
                before = sum(1 for _ in (folder / "cold").rglob("*.nbc"))
                started = time.perf_counter()
                run(*words, cwd=folder, cache=folder / "cold" if cache == "cold" else None)
                compiled = sum(1 for _ in (folder / "cold").rglob("*.nbc")) - before
                print(
                    f"{solver}, {jobs} processes, {cache} cache: {time.perf_counter() - started:.0f} s, "
                    f"{compiled} kernels compiled",
                    flush=True,
                )
                # otherwise nothing would be told apart
                if (compiled > 0) != ((jobs, cache) == ways[0]):
                    wrong.append(f"{output}: {compiled} kernels compiled")
                found[output] = without_times(folder / output)
            if len(set(found.values())) != 1:
                wrong.append(f"results differ: {', '.join(found)}")
    print("\n".join(wrong) or "the same bytes")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

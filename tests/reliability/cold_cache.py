"""The same bytes with a cold cache, with a warm one, and on 1, 2 and 4 processes, cold or warm.

    python -m tests.reliability.cold_cache      (make test-cold; compiles for a minute or two)

A cold process compiles every kernel, a warm one loads it: what comes out must not depend on that. A scene is
solved with an empty cache folder by two processes at once, which compile at the same time, then by one and
by four, and with the cache that this tree has; it is tracked cold and warm. At last the package, copied to where no
cache can be written, solves it with a cache in a temporary folder.
"""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

_MEASURED = ("runtime", "compile_time", "seconds")
"""Fields that are measurements of time."""


def run(*words: str, cwd: Path, cache: Path | None = None, environment: Mapping[str, str] | None = None) -> None:
    """Run a program, with a cache of its own or an environment of its own if that is given."""
    root = Path(__file__).resolve().parents[2]
    paths = os.pathsep.join(filter(None, [str(root), os.environ.get("PYTHONPATH", "")]))
    if environment is None:
        environment = {**os.environ, "PYTHONPATH": paths, **({} if cache is None else {"NUMBA_CACHE_DIR": str(cache)})}
    command = [sys.executable, "-W", "error", "-m", *words]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment, cwd=cwd)


def installed_read_only(folder: Path) -> Path:
    """Copy the package to where it can keep no cache: files where numba wants folders keep even the superuser out."""
    source = Path(__file__).resolve().parents[2] / "assoc"
    shutil.copytree(source, folder / "assoc", ignore=shutil.ignore_patterns("__pycache__"))
    for inner in [folder / "assoc", *(path for path in (folder / "assoc").rglob("*") if path.is_dir())]:
        (inner / "__pycache__").write_text("")
    return folder


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


def solved(folder: Path) -> list[str]:
    """Solve cold and warm, on 1, 2 and 4 processes; what differs."""
    wrong = []
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
    return wrong


def tracked(folder: Path) -> list[str]:
    """Track cold and warm; what differs."""
    for output, cache in (("cold.csv", folder / "cold"), ("own.csv", None)):
        started = time.perf_counter()
        run("assoc.track", "scene.npz", "-o", output, cwd=folder, cache=cache)
        print(f"tracks, {output}: {time.perf_counter() - started:.0f} s", flush=True)
    same = (folder / "cold.csv").read_bytes() == (folder / "own.csv").read_bytes()
    return [] if same else ["tracks differ"]


def solved_read_only(folder: Path) -> list[str]:
    """Solve with a package, a home and a cache folder that cannot be written, on 2 processes; what differs."""
    site, temporary, home = installed_read_only(folder / "site"), folder / "tmp", folder / "home"
    temporary.mkdir()
    home.write_text("")
    own = {"PYTHONPATH": str(site), "HOME": str(home), "XDG_CACHE_HOME": str(home), "TMPDIR": str(temporary)}
    environment = {**os.environ, **own, "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop("NUMBA_CACHE_DIR", None)
    for output, how in (("usual.json", None), ("read-only.json", environment)):
        started = time.perf_counter()
        words = ["assoc.solve", "scene.npz", "--solver", "greedy", "--jobs", "2", "--json", output]
        run(*words, cwd=folder, environment=how)
        print(f"greedy, {output}: {time.perf_counter() - started:.0f} s", flush=True)
    wrong = [f"{left.name} stays in the temporary folder" for left in temporary.iterdir()]
    if without_times(folder / "usual.json") != without_times(folder / "read-only.json"):
        wrong.append("results of a read-only installation differ")
    return wrong


def main() -> int:
    """Run the program; exit code 1 if something differs."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run("assoc.simulate", "three-radar", "--scans", "8", "-o", "scene.npz", cwd=folder)
        wrong = [*solved(folder), *tracked(folder), *solved_read_only(folder)]
    print("\n".join(wrong) or "the same bytes")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())

"""Run each command that a row of docs/papers.md names, small: tests without the slow ones, experiments with --quick.

FOLDER is that of the thesis's tables; without it the rows that need it are left out. Some ten minutes of an idle
core.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TABLES = ROOT / "docs" / "_tables"
NOT_QUICK = {"experiments.benchmarks": ["--families", "paper", "--solvers", "exact", "--seeds", "1"]}
"""Programs without --quick, and what makes a small run of them."""


def commands() -> Counter[str]:
    """Commands of the coverage tables, and how many rows name each."""
    texts = [path.read_text(encoding="utf-8") for path in sorted(TABLES.glob("papers-*.md"))]
    last = [row.rsplit(" | ", 1)[-1] for text in texts for row in text.splitlines()]
    return Counter(" ".join(words) for cell in last for words in re.findall(r"`(pytest|python -m) ([^`]+)`", cell))


def small(command: str, folder: str | None, scratch: Path) -> list[str] | None:
    """The command in small, writing into a scratch folder; None where it needs a folder that is not given."""
    words = command.split()
    if words[0] == "pytest":
        return [sys.executable, "-m", *words, "-q", "-x", "-m", "not slow", "-p", "no:cacheprovider"]
    if words[-1] == "FOLDER":
        return None if folder is None else [sys.executable, *words[1:-1], folder]
    module = words[2]
    made = [sys.executable, *words[1:], *NOT_QUICK.get(module, ["--quick"])]
    return [*made, "--csv", str(scratch / "rows.csv")] if module in NOT_QUICK else made


def main(arguments: Sequence[str] | None = None) -> int:
    """Run them all; returns 1 if any fails."""
    about = (__doc__ or "").split("\n")[0]
    parser = argparse.ArgumentParser(prog="python -m experiments.pages.commands", description=about)
    parser.add_argument("--folder", metavar="FOLDER", help="the thesis's tables as CSV files")
    return int(run(commands(), parser.parse_args(arguments).folder) > 0)


def run(every: Mapping[str, int], folder: str | None) -> int:
    """Run commands, of which each is named by so many rows; returns how many fail."""
    failed = count = 0
    with tempfile.TemporaryDirectory() as scratch:
        for command, rows in every.items():
            words = small(command, folder and str(Path(folder).resolve()), Path(scratch))
            if words is None:
                print(f"left out  {rows:3} rows         {command}", flush=True)
                continue
            start = time.perf_counter()
            env = {**os.environ, "PYTHONPATH": str(ROOT)}
            done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False, env=env)
            failed, count = failed + (done.returncode != 0), count + 1
            word = "failed" if done.returncode else "done"
            print(f"{word:9} {rows:3} rows {time.perf_counter() - start:6.0f} s {command}", flush=True)
            if done.returncode:
                print(done.stdout[-2000:], done.stderr[-2000:], flush=True)
    print(f"{count} commands run, {failed} failed")
    return failed


if __name__ == "__main__":
    raise SystemExit(main())

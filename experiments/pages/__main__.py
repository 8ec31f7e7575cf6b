"""Write the tables of the pages (docs/_tables) from the published results.

The results are the files of experiments/results, which the experiments write with --publish, the rows of the benchmarks
and those of the benchmark set; a test fails where a table and they differ.
"""

import argparse
from collections.abc import Callable, Mapping
from pathlib import Path

from assoc._files.output import write_text
from experiments.pages import coverage, tables

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "_tables"
TABLES: dict[str, Callable[[], str]] = tables.TABLES | coverage.TABLES
"""Name of the file -> what makes it."""


def main(arguments: list[str] | None = None) -> int:
    """Write the tables, or check them; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.pages", description="Write the tables of the pages from the published results."
    )
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 where a table is out of date")
    chosen = parser.parse_args(arguments)
    files = {FOLDER / f"{name}.md": make for name, make in TABLES.items()}
    stale = refresh(files, check=chosen.check)
    return int(chosen.check and stale > 0)


def refresh(files: Mapping[Path, Callable[[], str]], *, check: bool) -> int:
    """Write the files that are out of date, or only name them; returns their number."""
    stale = 0
    for path, make in files.items():
        fresh = f"{make()}\n"
        if not path.exists() or path.read_text(encoding="utf-8") != fresh:
            stale += 1
            if not check:
                write_text(path, fresh)
            print(f"{'/'.join(path.parts[-2:])}: {'out of date' if check else 'written'}")
    return stale


if __name__ == "__main__":
    raise SystemExit(main())

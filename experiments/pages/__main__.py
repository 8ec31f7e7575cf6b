"""Write the tables of the pages (papers, filters, solvers and others in docs) from the published results.

    python -m experiments.pages [--check]

Each table stands between marks in its page. The results are the files of experiments/results, which the experiments
write with --publish; a test fails where a page and they differ.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from assoc._files.output import write_text
from experiments.pages import benchmarks, coverage, measured, metaheuristics, trackers

DOCS = Path(__file__).resolve().parents[2] / "docs"
TABLES: dict[str, dict[str, Callable[[], str]]] = {
    "papers.md": {name.replace("_", "-"): make for name, make in coverage.TABLES.items()},
    "filters.md": measured.FILTERS,
    "recordings.md": measured.RECORDINGS,
    "start.md": measured.START,
    "dependencies.md": measured.DEPENDENCIES,
    "sweeps.md": measured.SWEEPS,
    "solvers.md": {**measured.SOLVERS, **metaheuristics.SOLVERS},
    "which_solver.md": {**benchmarks.WHICH_SOLVER, **measured.WHICH_SOLVER},
    "ant_colony.md": metaheuristics.ANT_COLONY,
    "concepts.md": measured.CONCEPTS,
    "tracking.md": {**measured.TRACKING, **trackers.TRACKING},
    "registration.md": trackers.REGISTRATION,
    "stonesoup.md": trackers.STONE_SOUP,
}
"""Page -> name of the table -> what makes it."""


def begin(name: str) -> str:
    """Mark before a table."""
    return f"<!-- table {name}: written by python -m experiments.pages -->"


def end(name: str) -> str:
    """Mark behind it."""
    return f"<!-- end of {name} -->"


def insert(text: str, tables: dict[str, Callable[[], str]]) -> str:
    """Return the page with its tables made anew.

    Raises
    ------
    ValueError
        The page does not have the marks of a table, each once and in order.
    """
    for name, make in tables.items():
        first, last = begin(name), end(name)
        if text.count(first) != 1 or text.count(last) != 1 or text.index(first) > text.index(last):
            raise ValueError(f"expected the marks {first!r} and {last!r}, each once and in this order")
        head, rest = text.split(first)
        text = f"{head}{first}\n\n{make()}\n\n{last}{rest.split(last)[1]}"
    return text


def main(arguments: list[str] | None = None) -> int:
    """Write the pages, or check them; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.pages", description="Write the tables of the pages from the published results."
    )
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 where a page is out of date")
    chosen = parser.parse_args(arguments)
    stale = 0
    for page, tables in TABLES.items():
        path = DOCS / page
        text = path.read_text(encoding="utf-8")
        fresh = insert(text, tables)
        if fresh != text:
            stale += 1
            if not chosen.check:
                write_text(path, fresh)
            print(f"docs/{page}: {'out of date' if chosen.check else 'written'}")
    return int(chosen.check and stale > 0)


if __name__ == "__main__":
    raise SystemExit(main())

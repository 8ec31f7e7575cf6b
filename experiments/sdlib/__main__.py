"""The benchmark set: make its instances, solve and prove them, check what is known, run any solver on them.

    python -m experiments.sdlib make [--compare]
    python -m experiments.sdlib solve --seconds 60 [NAME ...]
    python -m experiments.sdlib check [NAME ...]
    python -m experiments.sdlib run --command "mysolver {instance} {solution}" --seconds 60 [NAME ...]
    python -m experiments.sdlib page

``run`` starts the command once for each instance, with the paths of an instance (plain text) and of the solution that
it must write; solutions are judged by verify.py. docs/benchmark_set.md describes the set and the files.
"""

from __future__ import annotations

import argparse
import datetime
import json
import lzma
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from experiments.sdlib import store, verify
from experiments.sdlib.instances import Instance, instances
from experiments.sdlib.page import write_page
from experiments.sdlib.solve import check_row, solve


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; its exit code."""
    parser = argparse.ArgumentParser(
        "python -m experiments.sdlib", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parts = parser.add_subparsers(dest="part", required=True)
    make = parts.add_parser("make", help="write the instances")
    make.add_argument("--compare", action="store_true", help="write nothing: compare them with what is stored")
    for name, text in (("solve", "improve and prove what is known"), ("run", "run a solver of any kind")):
        part = parts.add_parser(name, help=text)
        part.add_argument("--seconds", type=float, default=60.0, help="limit for each instance (default 60)")
        part.add_argument("--family", help="only this family")
        part.add_argument("names", nargs="*", metavar="NAME", help="only these instances")
    parts.choices["run"].add_argument("--command", required=True, help="with {instance} and {solution} in it")
    check = parts.add_parser("check", help="check every solution and proof")
    check.add_argument("names", nargs="*", metavar="NAME")
    parts.add_parser("page", help="write the tables of docs/benchmark_set.md")
    chosen = parser.parse_args(arguments)
    if chosen.part == "make":
        return _make(compare=chosen.compare)
    if chosen.part == "page":
        write_page()
        return 0
    picked = list(_picked(parser, chosen.names, getattr(chosen, "family", None)))
    if chosen.part == "solve":
        return _solve(picked, chosen.seconds)
    if chosen.part == "check":
        return _check(picked)
    if "{instance}" not in chosen.command or "{solution}" not in chosen.command:
        parser.error("--command: must have {instance} and {solution} in it")
    return _run(picked, chosen.command, chosen.seconds)


def _picked(parser: argparse.ArgumentParser, names: list[str], family: str | None) -> Iterator[Instance]:
    every = instances()
    unknown = set(names) - {one.name for one in every}
    if unknown:
        parser.error(f"{min(unknown)}: no instance of this name")
    if family is not None and family not in {one.family for one in every}:
        parser.error(f"--family: expected one of {', '.join(sorted({one.family for one in every}))}")
    for one in every:
        if (not names or one.name in names) and family in (None, one.family):
            yield one


def _make(*, compare: bool) -> int:
    different = 0
    with tempfile.TemporaryDirectory() as folder:
        for one in instances():
            target = store.instance_file(one.name)
            path = Path(folder) / target.name if compare else target
            path.parent.mkdir(exist_ok=True)
            one.make().save(path)
            if compare and lzma.open(path).read() != lzma.open(target).read():
                different += 1
                print(f"{one.name}: differs from what is stored", file=sys.stderr)
    print(f"{len(instances())} instances" + (f", {different} differ" if compare else ""))
    return 1 if different else 0


def _solve(picked: list[Instance], seconds: float) -> int:
    for one in picked:
        rows = store.table()
        row = rows[one.name] = solve(one, rows.get(one.name), seconds, datetime.date.today().isoformat())
        store.write_table(rows)
        words = f"{one.name:32} {row['tuples']:8} {row['value']:>20} {row['status']:8} {row['seconds']:8.2f} s"
        print(words, flush=True)
    return 0


def _check(picked: list[Instance]) -> int:
    rows, wrong, optimal = store.table(), 0, 0
    for one in picked:
        if one.name not in rows:
            continue
        fault = check_row(one.name, rows[one.name])
        optimal += rows[one.name]["status"] == "optimal" and fault is None
        if fault is not None:
            wrong += 1
            print(f"{one.name}: {fault}", file=sys.stderr)
    known = sum(one.name in rows for one in picked)
    print(f"{known} solutions checked, {optimal} proofs accepted, {wrong} faults")
    return 1 if wrong else 0


def _run(picked: list[Instance], command: str, seconds: float) -> int:
    rows = store.table()
    with tempfile.TemporaryDirectory() as folder:
        for one in picked:
            instance, solution = Path(folder) / "instance.txt", Path(folder) / "solution.txt"
            instance.write_bytes(lzma.open(store.instance_file(one.name)).read())
            solution.unlink(missing_ok=True)
            words = [word.format(instance=instance, solution=solution) for word in shlex.split(command)]
            started = time.perf_counter()
            try:
                done = subprocess.run(words, timeout=seconds, capture_output=True, check=False).returncode
            except subprocess.TimeoutExpired:
                done = None
            except OSError as error:
                print(f"{words[0]}: {error.strerror}", file=sys.stderr)
                return 2
            taken = time.perf_counter() - started
            print(json.dumps(_judged(one.name, instance, solution, rows, done, taken)), flush=True)
    return 0


def _judged(
    name: str, instance: Path, solution: Path, rows: dict[str, dict[str, object]], done: int | None, seconds: float
) -> dict[str, object]:
    """One line of a run: what the verifier says of what a command left behind."""
    row: dict[str, object] = {"instance": name, "seconds": round(seconds, 3), "exit": done}
    row |= {"cost": None, "excess": None}
    try:
        cost = verify.cost_of(*verify.read_instance(str(instance)), verify.read_solution(str(solution))[0])
    except FileNotFoundError:
        return {**row, "fault": "no solution was written"}
    except (OSError, ValueError, verify.NoSolutionError) as error:
        return {**row, "fault": str(error)}
    best = rows.get(name, {}).get("value")
    excess = None if best is None else float(cost) - float(str(best))
    return {**row, "cost": verify.decimal(cost), "excess": excess}


if __name__ == "__main__":
    raise SystemExit(main())

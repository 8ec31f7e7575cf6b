"""The benchmark set: make its instances, solve and prove them, check what is known, run any solver on them.

    python -m experiments.sdlib make [--compare]
    python -m experiments.sdlib solve --seconds 60 [NAME ...]
    python -m experiments.sdlib check [NAME ...]
    python -m experiments.sdlib run --command "mysolver {instance} {solution}" --seconds 60 [--all | NAME ...]

``run`` starts a command once for each instance, with the paths of the instance (plain text) and of the solution that it
must write. It has one core and so many seconds of CPU time; what it writes is judged by assoc/check.py.
docs/benchmark_set.md describes the set and the files; ours beside other solvers: experiments.benchmarks.
"""

import argparse
import datetime
import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from assoc._files.output import write_text
from assoc.problem import AssignmentProblem
from experiments.common.command import above_zero
from experiments.sdlib import store
from experiments.sdlib.command import run_command
from experiments.sdlib.instances import PATH, Instance, instances
from experiments.sdlib.solve import check_row, solve


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; its exit code."""
    parser = argparse.ArgumentParser(
        "python -m experiments.sdlib", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    every = instances()
    parts = parser.add_subparsers(dest="part", required=True)
    make = parts.add_parser("make", help="write the instances")
    make.add_argument("--compare", action="store_true", help="write nothing: compare them with what is stored")
    make.add_argument("--recording", metavar="FILE", help="of air traffic: without it, recorded ones stay as they are")
    for name, text in (("solve", "improve and prove what is known"), ("run", "run a command")):
        part = parts.add_parser(name, help=text)
        part.add_argument("--seconds", type=above_zero, default=60.0, help="limit for each instance (default 60)")
        part.add_argument("--family", choices=sorted({instance.family for instance in every}), help="only this family")
        part.add_argument("names", nargs="*", type=_name, metavar="NAME", help="only these instances")
    improve = parts.choices["solve"]
    improve.add_argument("--solver", default="exact", help="of ours (default exact, which alone proves)")
    run = parts.choices["run"]
    run.add_argument("--command", required=True, help="your solver, with {instance} and {solution} in it")
    run.add_argument("--all", action="store_true", help="all instances, not two of each family")
    run.add_argument("--output", metavar="FILE", help="write the rows, with what was found when, as JSON")
    check = parts.add_parser("check", help="check every solution and proof")
    check.add_argument("names", nargs="*", type=_name, metavar="NAME")
    chosen = parser.parse_args(arguments)
    if chosen.part == "make":
        if chosen.recording is not None:
            if not Path(chosen.recording).is_file():
                print(f"{chosen.recording}: there is no such file", file=sys.stderr)
                return 2
            os.environ[PATH] = chosen.recording
        return _make(every, compare=chosen.compare)
    family = getattr(chosen, "family", None)
    picked = [i for i in every if i.name in (chosen.names or [i.name]) and i.family == (family or i.family)]
    if chosen.part == "solve":
        return _solve(picked, chosen.solver, chosen.seconds)
    if chosen.part == "check":
        return _check(picked)
    if not ("{instance}" in chosen.command and "{solution}" in chosen.command):
        parser.error("--command: must have {instance} and {solution} in it")
    if not (chosen.all or chosen.names or family):
        picked = _representatives(picked)
    return _run(picked, chosen.command, chosen.seconds, chosen.output)


def _name(text: str) -> str:
    if text not in {instance.name for instance in instances()}:
        raise argparse.ArgumentTypeError(f"{text}: no instance of this name")
    return text


def _make(known: Sequence[Instance], *, compare: bool) -> int:
    different = 0
    every = [i for i in known if not i.kept and (PATH in os.environ or not i.recorded)]
    for instance in every:
        path, made = store.instance_file(instance.name), instance.make()
        if not compare:
            path.parent.mkdir(exist_ok=True)
            made.save(path)
        elif not _alike(made, store.load(instance.name)):
            different += 1
            print(f"{instance.name}: differs from what is stored", file=sys.stderr)
    left = len(known) - len(every)
    without = f", {left} stay as they are" if left else ""
    print(f"{len(every)} instances{without}" + (f", {different} differ" if compare else ""))
    return 1 if different else 0


def _alike(made: AssignmentProblem, other: AssignmentProblem) -> bool:
    """Whether problems are equal but for the last digit: logarithms are rounded differently by other processors."""
    same = made.dummy == other.dummy and np.array_equal(made.sizes, other.sizes)
    same = same and np.array_equal(made.tuples, other.tuples)
    return same and np.allclose(made.costs, other.costs, rtol=0.0, atol=1.001e-6)


def _solve(picked: list[Instance], solver: str, limit: float) -> int:
    for instance in picked:
        rows = store.table()
        today = datetime.date.today().isoformat()
        row = rows[instance.name] = solve(instance, rows.get(instance.name), solver, limit, today)
        store.write_table(rows)
        words = f"{instance.name:32} {row['tuples']:8} {row['value']:>20} {row['status']:8} {row['seconds']:8.2f} s"
        print(words, flush=True)
    return 0


def _check(picked: list[Instance]) -> int:
    rows, wrong, optimal = store.table(), 0, 0
    for instance in picked:
        fault = check_row(instance.name, rows[instance.name]) if instance.name in rows else "is not in the table"
        optimal += fault is None and rows[instance.name]["status"] == "optimal"
        if fault is not None:
            wrong += 1
            print(f"{instance.name}: {fault}", file=sys.stderr)
    print(f"{len(picked)} solutions checked, {optimal} proofs accepted, {wrong} faults")
    return 1 if wrong else 0


def _representatives(every: list[Instance]) -> list[Instance]:
    """Of each family, in the order of tuples and names, the instances after a third and after two thirds of it."""
    rows = store.table()
    families: dict[str, list[Instance]] = {}
    for instance in sorted(every, key=lambda instance: (rows[instance.name]["tuples"], instance.name)):
        families.setdefault(instance.family, []).append(instance)
    return [own[share * len(own) // 3] for own in families.values() for share in (1, 2)]


def _run(picked: list[Instance], command: str, seconds: float, output: str | None) -> int:
    rows = []
    try:
        for row in run_command(picked, command, seconds):
            print(json.dumps({key: value for key, value in row.items() if key != "trace"}), flush=True)
            rows.append(row)
            # every now and then: a run of everything takes long
            if output is not None:
                write_text(output, json.dumps({"command": command, "seconds": seconds, "rows": rows}, indent=1))
    except ValueError as error:
        print(error, file=sys.stderr)
    except OSError as error:
        print(f"{error.filename or command}: {error.strerror}", file=sys.stderr)
    else:
        return 0
    return 2


if __name__ == "__main__":
    raise SystemExit(main())

"""``python -m assoc.solve``: associates the measurements of scenes, or solves assignment problems, from files.

This is a program: the package must not import it, or ``python -m assoc.solve`` would warn and
``assoc.solve`` would change its meaning with the order of imports. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from assoc._cli.inputs import import_modules
from assoc._cli.lines import print_lines
from assoc._cli.messages import messages
from assoc._cli.options import (
    COMMON,
    Given,
    Option,
    Parser,
    check_scheduler,
    flag_of,
    flags_of_solvers,
    parameter_options,
    read_config,
    read_first,
    verbosity,
)
from assoc._cli.program import Program, command, write_all
from assoc._cli.progress import ProgressBar, with_progress
from assoc._cli.signals import EarlyEnd
from assoc._cli.table import print_table
from assoc._cli.values import Output, csv_table, html_page, scan_range, whole
from assoc._files.output import write_json, write_text
from assoc._parameters import Parameter, parameters_of
from assoc._system.cluster import LostError
from assoc.errors import InvalidInputError, LimitExceededError
from assoc.solvers import registry

if TYPE_CHECKING:
    from assoc.association.association import Association, Totals
    from assoc.association.scan import ScanAssociation
    from assoc.association.solving import ScanOptions
    from assoc.association.source import Source

_EARLY_END = EarlyEnd("assoc.solve")
# seconds that the current scan gets when the program is asked to end
_LAST_SCAN = 3.0
DEFAULT_SOLVER = "exact"
_SHOWN = 20
_SCENES = {"input": ("scenes",)}
_GATING = [replace(COMMON[name], only=_SCENES) for name in ("gate_probability", "max_tuples", "target_density")]
_SOLVER = Option("solver", "NAME", f"name of the solver (default {DEFAULT_SOLVER})")
_SCANS = Option("scans", "A:B", "only scans A to B-1, counted from 0; A alone is one scan")
_KBEST = Option("kbest", "K", "the K best associations of each scan, in order", whole(1))
_SHARED = [COMMON[name] for name in ("seed", "time_limit", "jobs", "scheduler")]
_OF_FILE = (_SOLVER, *_SHARED, _SCANS, *_GATING, _KBEST)
"""Options that a TOML file may have."""
_OPTIONS = (
    Option("files", "FILE", "scene.npz or problem.npz", positional=True, rest={"nargs": "+"}),
    *_OF_FILE,
    Option("all", "", f"print all scans on a terminal, not only the first {_SHOWN}"),
    Option("json", "FILE", "write the result as JSON", Output(".json")),
    Option("csv", "FILE", "write the table as CSV", csv_table),
    Option("report", "FILE", "write an HTML page: scene, association, convergence (needs assoc[report])", html_page),
    COMMON["config"],
    Option("proof", "FILE", "write a proof for 'assoc check' as JSON, and its problem beside it as .txt",
           Output(".json", strict=True, streams=False)),
    Option("marginals", "", "how probable each target is among all associations of its scan"),
    COMMON["import"],
    *verbosity("all parameters"),
)  # fmt: skip


def _solve(words: list[str]) -> None:
    first = read_first(words, "solver", "config", "import")
    import_modules(first["import"])
    config, tables = read_config(first["config"], _OF_FILE, registry.names())
    named = first["solver"] or config.get("solver")
    solver = named or DEFAULT_SOLVER
    given = _parser(solver, explicit=named is not None).read(words)
    given.fill(first["config"] or "", config)
    known = parameters_of(registry.parameters(solver))
    parameters = _section(tables, solver, known) | given.some(parameter.name for parameter in known)
    registry.make_parameters(solver, parameters)
    if given["kbest"] is not None and (named or parameters):
        label = given.label("kbest")
        raise InvalidInputError(f"{label}: has its own algorithm; leave out --solver and solver parameters")
    proof = given["proof"]
    beside = [] if proof is None else [_problem_beside(proof)]
    given.check_outputs([*given["files"], given["config"]], also=beside)
    check_scheduler(given)
    with messages(given):
        _associate(solver, given, parameters)


def _associate(solver: str, given: Given, parameters: dict[str, Any]) -> None:
    from assoc.association.association import Totals
    from assoc.association.solving import ScanOptions, associate_scans, gathered
    from assoc.association.source import load_source

    files, jobs = given["files"], given["jobs"] or 1
    sources = [load_source(file) for file in files]
    scenes = any(hasattr(source, "sensors") for source in sources)
    given.check_use(_OPTIONS, input="scenes" if scenes else "problems, which have their tuples already")
    started = time.perf_counter()
    bar = ProgressBar("associating", "scans", shown=not given["quiet"])
    options = ScanOptions(
        solver,
        parameters=parameters,
        gating=given.some(parameter.name for parameter in _GATING),
        marginals=bool(given["marginals"]),
        **given.some(("seed", "time_limit", "kbest")),
    )
    items = _items(sources, given)
    if given["proof"] and len(items) != 1:
        raise InvalidInputError(f"--proof: is of one scan, got {len(items)}; choose it with --scans K")
    if given["verbose"]:
        print_lines(
            ", ".join(f"{name} {value}" for name, value in {"solver": solver, **options.all_parameters}.items())
        )
    names = [files[number] for number, _ in items]
    progress = with_progress(associate_scans(sources, options, items, jobs, given["scheduler"]), len(items), bar)
    totals = Totals()
    scans: list[ScanAssociation] = []
    failed: LostError | LimitExceededError | None = None
    # other processes do not receive the request to end: their scans are abandoned
    patience = 0.0 if jobs > 1 or given["scheduler"] else _LAST_SCAN
    with _EARLY_END.work(patience):
        try:
            for scan in _until_asked(progress):
                totals.add(scan)
                scans.append(scan)
        except (LostError, LimitExceededError) as error:
            # what is finished is written all the same
            failed = error
    done = totals.sums()["scans"]
    elapsed = time.perf_counter() - started
    if not scans and items:
        if failed is not None:
            raise failed
        _EARLY_END.say("")
    found, names = gathered(scans, options), names[: len(scans)]
    of_items = [sources[number] for number, _ in items[: len(scans)]]
    write_all(
        (given["json"], lambda: _write_json(given["json"], found, names)),
        (given["csv"], lambda: _write_csv(given["csv"], found, names)),
        (given["report"], lambda: _write_report(given, found, of_items, names)),
        (
            given["proof"] if scans else None,
            lambda: _write_proof(given["proof"], of_items[0], options, found, items[0][1]),
        ),
        (given, lambda: _print(found, totals, names, elapsed, given["all"])),
    )
    if failed is not None:
        raise type(failed)(f"{failed}; {done} of {len(items)} scans are finished and written")
    _EARLY_END.say(f"{done} of {len(items)} scans are finished and written")


def _until_asked(scans: Iterable[ScanAssociation]) -> Iterator[ScanAssociation]:
    """The scans until a signal ends the work."""
    try:
        yield from scans
    except KeyboardInterrupt:
        if not _EARLY_END.asked:
            raise


def parser() -> Parser:
    """Return the parser with the options of all solvers."""
    made = _parser(DEFAULT_SOLVER, explicit=True)
    for name in registry.names():
        made.declare(
            *(option for option in parameter_options(registry.parameters(name)) if option.name not in made.declared)
        )
    return made


def _parser(solver: str, explicit: bool) -> Parser:
    parser = Parser(
        prog="assoc.solve",
        usage=f"{command('solve')} FILE.npz [FILE.npz ...] --solver NAME [options]",
        description="Associate the measurements of scenes, or solve assignment problems,\n"
        "and report how far each answer can be from the optimum.",
        epilog=None if explicit else _other_solvers(),
    )
    parser.declare(*_OPTIONS)
    parser.elsewhere = lambda: flags_of_solvers(solver)
    choices = parameter_options(registry.parameters(solver))
    if choices:
        parser.declare(*choices, group=f"parameters of {solver}")
    return parser


def _other_solvers() -> str:
    lines = ["solvers and their parameters (described by --solver NAME --help):"]
    for name in registry.names():
        flags = " ".join(flag_of(parameter.name) for parameter in parameters_of(registry.parameters(name)))
        lines.append(f"  {name:<12} {flags or '(none)'}")
    return "\n".join(lines)


def _section(tables: dict[str, Any], solver: str, known: Sequence[Parameter]) -> dict[str, Any]:
    """Parameters of the solver in the configuration file."""
    table, by_name = tables.get(solver, {}), {parameter.name: parameter for parameter in known}
    if not isinstance(table, dict):
        raise InvalidInputError(f"[{solver}]: expected one table, got {len(table)}")
    # the registry reports unknown names
    return {
        name: by_name[name].check(value, f"[{solver}] {key}") if name in by_name else value
        for key, value in table.items()
        for name in [key.replace("-", "_")]
    }


def _items(sources: list[Source], given: Given) -> list[tuple[int, int]]:
    """The selected scans of each file."""
    from assoc.association.solving import all_scans

    items, files, text = all_scans(sources), given["files"], given["scans"]
    if text is None:
        return items
    counts = [sum(number == n for number, _ in items) for n in range(len(files))]
    scans = [scan_range(text, count, file, given.label("scans")) for count, file in zip(counts, files, strict=True)]
    return [(number, k) for number, k in items if k in scans[number]]


def _write_json(path: str, association: Association, names: list[str]) -> None:
    content = association.to_dict()
    if len(set(names)) > 1:
        for scan, name in zip(content["scans"], names, strict=True):
            scan["file"] = name
    write_json(path, content)


def _write_csv(path: str, association: Association, names: list[str]) -> None:
    from assoc.association.table import to_csv

    write_text(path, to_csv(association.scans, names))


def _write_report(given: Given, association: Association, sources: list[Source], names: list[str]) -> None:
    from assoc.plotting.report import write_association_report

    write_association_report(given["report"], association, sources, names, words=given.words)


def _write_proof(path: str, source: Source, options: ScanOptions, found: Association, scan: int) -> None:
    from assoc.costs import build_problem
    from assoc.proofs import write_proof
    from assoc.scene.scene import Scene

    problem = build_problem(source, scan, **options.gating) if isinstance(source, Scene) else source
    problem.save(_problem_beside(path))
    write_proof(path, problem, found.scans[0].solution)


def _problem_beside(proof: str) -> str:
    """File name for the problem of a proof."""
    return f"{proof.removesuffix('.json')}.txt"


def _print_table(scans: Sequence[ScanAssociation], names: list[str], *, brief: bool) -> None:
    from assoc.association.table import LEFT_ALIGNED, rows

    headers, cells = rows(scans, names, brief=brief)
    print_table(headers, cells, left=LEFT_ALIGNED)


def _print(association: Association, totals: Totals, names: list[str], elapsed: float, everything: bool) -> None:
    total, scans = totals.sums(), association.scans
    # a pipe gets all scans and columns: programs read it
    brief = sys.stdout.isatty()
    shown = _SHOWN if brief and not everything else len(scans)
    _print_table(scans[:shown], names, brief=brief)
    if len(scans) > shown:
        print_lines(f"... and {len(scans) - shown} more scans (--all shows them)")
    print()
    print_lines(totals.summary(association.solver))
    solving, compiling = total["runtime"], total["compile_time"]
    print_lines(f"{elapsed:.2f} s in all, {solving:.2f} s of it in the solver, {compiling:.2f} s compiling")


PROGRAM = Program("assoc.solve", _solve, _EARLY_END.on_signals)
start, main = PROGRAM.start, PROGRAM.main

if __name__ == "__main__":
    raise SystemExit(start())

"""``python -m assoc.solve``: associate the measurements of scenes, or solve assignment problems, from files.

This is a program: the package must not import it, or ``python -m assoc.solve`` would warn and
``assoc.solve`` would change its meaning with the order of imports. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from assoc._cli.growing_table import GrowingTable
from assoc._cli.imports import HELP as IMPORT_HELP
from assoc._cli.imports import import_modules
from assoc._cli.inputs import check_ending, check_outputs, read_toml
from assoc._cli.lines import print_lines
from assoc._cli.options import (
    add_common_options,
    common_values,
    flag_of,
    flags_of_solvers,
    parameter_values,
    read_first,
)
from assoc._cli.program import Parser, command, prepare_streams, run_program, write_all
from assoc._cli.progress import ProgressBar, with_progress
from assoc._cli.signals import EarlyEnd
from assoc._cli.speech import add_speech_options, spoken
from assoc._cli.table import print_table
from assoc._cli.values import check_kind, cores, density, scan_range
from assoc._files.output import STDOUT, is_stream, write_json, write_text
from assoc._parameters import Option, options
from assoc._system.extras import check_extra
from assoc.errors import InvalidInputError
from assoc.solvers import registry

if TYPE_CHECKING:
    from assoc.association.association import Association
    from assoc.association.plan import Plan
    from assoc.association.scan import ScanAssociation
    from assoc.association.source import Source

_EARLY_END = EarlyEnd("assoc.solve")
# seconds that the scan under way gets when the program is asked to end
_LAST_SCAN = 3.0
DEFAULT_SOLVER = "exact"
_SHOWN = 20
_GATING = ("gate_probability", "max_tuples", "target_density")
_LEAST = {"seed": 0, "jobs": 1, "max_tuples": 1, "kbest": 1}
_SETTINGS = ("solver", "seed", "time_limit", "jobs", "scans", *_GATING, "kbest")


def start(arguments: Sequence[str] | None = None) -> int:
    """Run the program as a process of its own."""
    prepare_streams()
    _EARLY_END.on_signals()
    return main(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program; returns its exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    return run_program(lambda: _solve(words), "assoc.solve")


def _solve(words: list[str]) -> None:
    first = read_first("assoc.solve", words, ["solver", "config", "import"])
    import_modules(first["import"])
    solver, explicit, config = _solver(first)
    choices = options(registry.parameters(solver))
    parsed = vars(_parser(solver, choices, explicit).parse_args(words))
    settings = {**{key: config[key] for key in _SETTINGS if key in config}, **common_values(parsed)}
    if parsed["scans"] is not None:
        settings["scans"] = parsed["scans"]
    parameters = {**_section(config, solver, choices), **parameter_values(choices, parsed)}
    registry.make_parameters(solver, parameters)
    if "kbest" in settings and (explicit or parameters):
        label = "--kbest" if parsed["kbest"] is not None else f"{first['config']}: kbest"
        raise InvalidInputError(f"{label}: has its own algorithm; leave out --solver and solver parameters")
    files, proof = parsed["files"], parsed["proof"]
    if proof is not None and (proof == STDOUT or is_stream(proof)):
        raise InvalidInputError(f"--proof: {proof}: expected the name of a file, for its problem is written beside it")
    proved = [] if proof is None else [proof, _problem_beside(proof)]
    check_outputs([parsed["json"], parsed["csv"], parsed["report"], *proved], [*files, parsed["config"]])
    for option, *endings in (("json", ".json"), ("csv", ".csv"), ("report", ".html", ".htm")):
        check_ending(parsed[option], flag_of(option), *endings, strict=False)
    check_ending(proof, "--proof", ".json")
    if parsed["report"]:
        check_extra("plotly", "report")

    outputs = [parsed["json"], parsed["csv"], parsed["report"]]
    with spoken(quiet=parsed["quiet"], outputs=outputs):
        _associate(words, solver, parsed, settings, parameters)


def _associate(
    words: list[str], solver: str, parsed: dict[str, Any], settings: dict[str, Any], parameters: dict[str, Any]
) -> None:
    from assoc._cli.solver_log import SolverLog
    from assoc.association.source import load_source

    files, jobs = parsed["files"], settings.get("jobs", 1)
    sources = [load_source(file) for file in files]
    _refuse_gates_of_problems(sources, parsed)
    started = time.perf_counter()
    bar = ProgressBar("associating", "scans", shown=not parsed["quiet"])
    log = SolverLog(bar, parsed["verbose"])
    extras = {"pheromone": parsed["report"] is not None, "gate_loss": parsed["gate_loss"], "watch": log}
    plan, items = _plan(sources, solver, settings, parameters, extras)
    if "scans" in settings:
        label = f"{parsed['config']}: scans" if parsed["scans"] is None else "--scans"
        items = _chosen(items, files, settings["scans"], label)
    if parsed["proof"] and len(items) != 1:
        raise InvalidInputError(f"--proof: is of one scan, got {len(items)}; choose it with --scans K")
    if parsed["verbose"]:
        print_lines(", ".join(f"{name} {value}" for name, value in {"solver": solver, **plan.all_parameters}.items()))
    names = [files[number] for number, _ in items]
    # a pipe gets all scans and columns when all are there: programs read it
    table = _ScanTable(sources, names, len(names) if parsed["all"] else _SHOWN) if sys.stdout.isatty() else None
    progress = with_progress(plan.run(items, jobs), len(items), bar)
    # with -v the log has a line for each scan already
    watched = progress if table is None or parsed["verbose"] else table.watch(progress)
    scans: list[ScanAssociation] = []
    # other processes do not hear that they should end: their scans are given up
    with _EARLY_END.work(0.0 if jobs > 1 else _LAST_SCAN):
        try:
            for scan in watched:
                scans.append(scan)
                log.end(scan)
        except KeyboardInterrupt:
            if not _EARLY_END.asked:
                raise
    elapsed = time.perf_counter() - started
    if not scans and items:
        _EARLY_END.say("")
    found, names = plan.gather(scans), names[: len(scans)]
    of_items = [sources[number] for number, _ in items[: len(scans)]]
    write_all(
        lambda: _write_json(parsed["json"], found, names),
        lambda: _write_csv(parsed["csv"], found, names),
        lambda: _write_report(parsed["report"], found, of_items, names, words),
        lambda: _write_proof(parsed["proof"], plan, found, items),
        lambda: _print(found, names, elapsed, table),
    )
    _EARLY_END.say(f"{len(scans)} of {len(items)} scans are finished and written")


def completions() -> dict[str, Sequence[str]]:
    """Options of the program with the values they take, for shells."""
    parameters = dict.fromkeys(flags_of_solvers(DEFAULT_SOLVER), ())
    parser = _parser(DEFAULT_SOLVER, options(registry.parameters(DEFAULT_SOLVER)), explicit=True)
    return {**parameters, **parser.flags(), "--solver": registry.names()}


def _solver(first: Mapping[str, str | None]) -> tuple[str, bool, dict[str, Any]]:
    """Which solver, whether it was named, and the configuration file: they decide what options there are."""
    config = _read_config(first["config"]) if first["config"] is not None else {}
    name = first["solver"] if first["solver"] is not None else config.get("solver")
    return (DEFAULT_SOLVER, False, config) if name is None else (name, True, config)


def _parser(solver: str, choices: list[Option], explicit: bool) -> Parser:
    parser = Parser(
        prog="assoc.solve",
        usage=f"{command('solve')} FILE.npz [FILE.npz ...] --solver NAME [options]",
        description="Associate the measurements of scenes, or solve assignment problems,\n"
        "and report how far each answer can be from the optimum.",
        epilog=None if explicit else _other_solvers(solver),
    )
    add = parser.add_argument
    add("files", nargs="+", metavar="FILE", help="scene.npz or problem.npz")
    add("--solver", metavar="NAME", help=f"name of the solver (default {DEFAULT_SOLVER})")
    add_common_options(parser, ["seed", "time_limit", "jobs"])
    add("--scans", metavar="A:B", help="only scans A to B-1, counted from 0; A alone is one scan")
    add_common_options(parser, ["kbest"])
    add("--all", action="store_true", help=f"print all scans on a terminal, not only the first {_SHOWN}")
    add("--json", metavar="FILE", help="write the result as JSON")
    add("--csv", metavar="FILE", help="write the table as CSV")
    add("--report", metavar="FILE", help="write an HTML page: scene, association, convergence (needs assoc[report])")
    add("--config", metavar="FILE", help="read these options from a TOML file; solver parameters in a table [solver]")
    add_common_options(parser, ["gate_probability", "max_tuples", "target_density"])
    add("--proof", metavar="FILE", help="write a proof for 'assoc check' as JSON, and its problem beside it as .txt")
    add("--gate-loss", action="store_true", help="bound what the gates may have cost (takes about three times as long)")
    add("--import", metavar="MODULE", help=IMPORT_HELP)
    add_speech_options(parser, "all parameters, and how cost and bound change while a scan is solved")
    parser.elsewhere = lambda: flags_of_solvers(solver)
    if choices:
        group = parser.add_argument_group(f"parameters of {solver}")
        for option in choices:
            option.add_to(group)
    return parser


def _other_solvers(solver: str) -> str:
    lines = ["solvers and their parameters (described by --solver NAME --help):"]
    for name in registry.names():
        flags = " ".join(option.flag for option in options(registry.parameters(name)))
        lines.append(f"  {name:<12} {flags or '(none)'}")
    return "\n".join(lines)


def _read_config(path: str) -> dict[str, Any]:
    config = read_toml(path)
    for key, value in config.items():
        if isinstance(value, dict):
            if key not in registry.names():
                raise InvalidInputError(f"{path}: [{key}] is no solver; known: {', '.join(registry.names())}")
            continue
        if key == "jobs" and value == "all":
            config[key] = cores()
            continue
        if key not in _SETTINGS:
            raise InvalidInputError(f"{path}: {key}: unknown key; known: {', '.join(_SETTINGS)}, and [solver]")
        if key == "target_density":
            config[key] = density(str(value), f"{path}: {key}")
            continue
        kind = str if key in ("solver", "scans") else float if key in ("time_limit", "gate_probability") else int
        check_kind(value, kind, f"{path}: {key}")
        if key in _LEAST and value < _LEAST[key]:
            raise InvalidInputError(f"{path}: {key}: expected a whole number >= {_LEAST[key]}, got {value!r}")
    return config


def _section(config: dict[str, Any], solver: str, choices: list[Option]) -> dict[str, Any]:
    """Parameters of the solver from the configuration file."""
    by_name = {option.name: option for option in choices}
    found = {}
    for key, value in config.get(solver, {}).items():
        name = key.replace("-", "_")
        # unknown names go through: the registry knows what to say about them
        found[name] = by_name[name].check(value, f"[{solver}] {key}") if name in by_name else value
    return found


def _plan(
    sources: list[Source],
    solver: str,
    settings: dict[str, Any],
    parameters: dict[str, Any],
    extras: dict[str, Any],
) -> tuple[Plan, list[tuple[int, int]]]:
    from assoc.association.plan import Plan

    gating: dict[str, Any] = {key: settings[key] for key in _GATING if key in settings}
    plan = Plan(
        tuple(sources),
        solver,
        settings.get("seed", 0),
        settings.get("time_limit"),
        parameters,
        gating,
        settings.get("kbest"),
        **extras,
    )
    return plan, plan.items()


def _refuse_gates_of_problems(sources: list[Source], parsed: dict[str, Any]) -> None:
    """Refuse options of the command line that change nothing where no file is a scene."""
    from assoc.scene.scene import Scene

    if any(isinstance(source, Scene) for source in sources):
        return
    for name in (*_GATING, "gate_loss"):
        if parsed[name]:
            raise InvalidInputError(
                f"{flag_of(name)}: is of scenes, and a problem has its tuples already; leave it out"
            )


def _chosen(items: list[tuple[int, int]], files: list[str], text: str, label: str) -> list[tuple[int, int]]:
    """The scans of each file that are asked for."""
    counts = [sum(number == n for number, _ in items) for n in range(len(files))]
    scans = [scan_range(text, count, file, label) for count, file in zip(counts, files, strict=True)]
    return [(number, k) for number, k in items if k in scans[number]]


def _write_json(path: str | None, association: Association, names: list[str]) -> None:
    if path is None:
        return
    content = association.to_dict()
    if len(set(names)) > 1:
        for scan, name in zip(content["scans"], names, strict=True):
            scan["file"] = name
    write_json(path, content)


def _write_csv(path: str | None, association: Association, names: list[str]) -> None:
    from assoc.association.table import to_csv

    if path is not None:
        write_text(path, to_csv(association.scans, names))


def _write_report(
    path: str | None,
    association: Association,
    sources: list[Source],
    names: list[str],
    words: list[str],
) -> None:
    if path is not None:
        from assoc.plotting.report import write_association_report

        write_association_report(path, association, sources, names, words=words)


def _write_proof(path: str | None, plan: Plan, found: Association, items: Sequence[tuple[int, int]]) -> None:
    if path is None or not found.scans:
        return
    from assoc.proofs import write_proof

    problem = plan.problem(items[0])
    problem.save(_problem_beside(path))
    write_proof(path, problem, found.scans[0].solution)


def _problem_beside(proof: str) -> str:
    """Name of the file with the problem of a proof."""
    return f"{proof.removesuffix('.json')}.txt"


class _ScanTable:
    """The table on a terminal: a row as soon as its scan is done, where the terminal is wide enough."""

    def __init__(self, sources: Sequence[Source], names: list[str], most: int) -> None:
        self._names = names
        self._most = most
        self._truth = any(getattr(source, "truth", None) is not None for source in sources)
        self._growing: GrowingTable | None = None

    def watch(self, scans: Iterable[ScanAssociation]) -> Iterator[ScanAssociation]:
        """Yield the scans, each after its row was printed."""
        from assoc.association.table import LEFT_ALIGNED, WIDTHS, rows

        for number, scan in enumerate(scans):
            headers, cells = rows([scan], self._names, first=number, truth=self._truth, brief=True)
            if self._growing is None:
                self._growing = GrowingTable(headers, WIDTHS, LEFT_ALIGNED, self._most)
            self._growing.add(cells)
            yield scan

    def finish(self, association: Association) -> None:
        """Print what has not been printed yet."""
        if self._growing is None or not self._growing.fits:
            _print_table(association.scans[: self._most], self._names, brief=True)
        if len(association.scans) > self._most:
            print_lines(f"... and {len(association.scans) - self._most} more scans (--all shows them)")


def _print_table(scans: Sequence[ScanAssociation], names: list[str], *, brief: bool) -> None:
    from assoc.association.table import KEYS, LEFT_ALIGNED, rows

    headers, cells = rows(scans, names, brief=brief)
    print_table(headers, cells, keys=sum(header in KEYS for header in headers), left=LEFT_ALIGNED)


def _print(association: Association, names: list[str], elapsed: float, table: _ScanTable | None) -> None:
    if table is None:
        _print_table(association.scans, names, brief=False)
    else:
        table.finish(association)
    print()
    print_lines(association.summary())
    total = association.totals()
    solving, compiling = total["runtime"], total["compile_time"]
    print_lines(f"{elapsed:.2f} s in all, {solving:.2f} s of it in the solver, {compiling:.2f} s compiling")


if __name__ == "__main__":
    raise SystemExit(start())

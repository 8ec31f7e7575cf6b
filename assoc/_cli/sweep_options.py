"""The options of ``assoc sweep``, from its command line and a TOML file, and the study that they describe.

Imports inside functions let wrong options be refused quickly: scenes and studies need numpy and more.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from assoc._cli.options import COMMON, Given, Option, Parser, check_scheduler, read_config, verbosity
from assoc._cli.program import command
from assoc._cli.values import OneOf, Output, scan_range, seconds, whole
from assoc._system.imports import check_extra
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc.sweeps.design import Space
    from assoc.sweeps.study import Study
    from assoc.sweeps.tuning import Report

DEFAULT_SOLVER = "aco"
SHOWN = 20
"""Number of settings that a terminal shows."""

_DRAWN = {"": ("matplotlib", "plot")}
_FIGURE = Output(".png", ".svg", ".pdf", strict=True, streams=False, extras=_DRAWN)
_OF_FILE = (
    Option("files", "FILE", "scene.npz or problem.npz", positional=True, rest={"nargs": "*"}),
    Option("solver", "NAME", f"one or more solvers (default {DEFAULT_SOLVER})", rest={"nargs": "+"}),
    Option("grid", "NAME=V1,V2", "parameter values; every combination is run. SOLVER.NAME=... is for one of several "
           "solvers; --tune also takes ranges LOW:HIGH or LOW:HIGH:log", rest={"nargs": "+"}),
    Option("repeats", "N", "runs of each setting on each scan, each with its own seed (default 1)", whole(1)),
    Option("scans", "A:B", "only scans A to B-1 of each scene, counted from 0; A alone is one scan"),
    *(COMMON[name] for name in ("seed", "time_limit")),
    Option("cpu_limit", "S", "processor time of each run, seconds (not for milp)", seconds),
    *(COMMON[name] for name in ("gate_probability", "max_tuples")),
    Option("output", "FOLDER", "folder of the study", short="-o"),
    COMMON["jobs"],
    COMMON["scheduler"],
    Option("tune", "N", "search for good parameters in the ranges of --grid, with N trials", whole(1)),
    Option("target", "NAME", "what --tune minimises: gap (mean gap, default) or time (time to optimum)",
           OneOf(("gap", "time"))),
)  # fmt: skip
_OF_TABLE = (
    Option("all", "", f"print all settings on a terminal, not only the first {SHOWN}"),
    Option("csv", "FILE", "write the table as CSV, or for LaTeX into a file .tex", Output(".csv", ".tex")),
)
_OF_SUMMARY = (
    Option("summary", "FOLDER", "print the table of a study; run nothing"),
    *_OF_TABLE,
    Option("report", "FILE", "write an HTML page: table, heat maps, convergence (needs assoc[plot])",
           Output(".html", ".htm", extras=_DRAWN)),
    Option("heatmap", "FILE", "draw the means over two parameters: FILE.png, .pdf or .svg", _FIGURE),
    Option("convergence", "FILE", "draw the excess over the best known cost over time: .png, .pdf or .svg", _FIGURE),
)  # fmt: skip
OUTPUTS = tuple(option.name for option in _OF_SUMMARY[2:])


def parser() -> Parser:
    """Return the parser of ``assoc sweep``."""
    called = command("sweep")
    made = Parser(
        prog="assoc.sweep",
        usage=f"{called} FILE.npz [FILE.npz ...] --solver NAME --grid NAME=V1,V2 ... -o FOLDER [options]\n"
        f"       {called} --config STUDY.toml\n"
        f"       {called} --summary FOLDER [--all] [--csv FILE] [--report FILE] [--heatmap FILE] [--convergence FILE]\n"
        f"       {called} compare FOLDER SETTING SETTING [--csv FILE]     settings as in aco,alpha=1,rho=0.3\n"
        f"       {called} import OLD NEW     a study of an earlier version into a new folder",
        description="Run solvers with many parameter settings on scenes and problems, and keep every result.\n"
        "The same command again runs only what is missing.",
    )
    more = verbosity("how many runs are done, every five seconds, also without a terminal")
    made.declare(*_OF_FILE, COMMON["config"], *_OF_SUMMARY, COMMON["import"], *more)
    return made


def read_options(words: Sequence[str]) -> tuple[Given, dict[str, Any]]:
    """Read the command line and the file of ``--config``; returns the options, and the design as tables of the file."""
    from assoc.solvers import registry

    made = parser()
    given = made.read(words)
    if given["tune"] is not None:
        check_extra("optuna", "tune")
    if given["summary"] is not None:
        others = [option.name for option in (*_OF_FILE, COMMON["config"]) if given.of_line(option.name)]
        if others:
            raise InvalidInputError(
                f"--summary: runs nothing and can be combined only with --all and outputs, not with {others[0]}"
            )
        _check_outputs(given, given["summary"])
        return given, {}
    values, tables = read_config(given["config"], _OF_FILE, registry.names())
    given.fill(given["config"] or "", values)
    _check_combinations(given, tables)
    _check_outputs(given, given["output"])
    return given, tables


def read_comparison(words: Sequence[str]) -> Given:
    """Read the words after ``compare``."""
    made = Parser(prog="assoc.sweep compare", description="Compare two settings of a study, run by run.")
    made.declare(
        Option("folder", "FOLDER", "folder of the study", positional=True),
        Option("first", "SETTING", "a solver, parameters, or both, as in aco,alpha=1,rho=0.3", positional=True),
        Option("second", "SETTING", "the other", positional=True),
        _OF_TABLE[1],
        *verbosity("nothing more here"),
    )
    given = made.read(words)
    _check_outputs(given, given["folder"])
    return given


def _check_combinations(given: Given, tables: Mapping[str, Any]) -> None:
    for name in ("solver", "grid") if tables else ():
        if given[name]:
            label = given.label(name)
            raise InvalidInputError(f"{label}: {given.file} has tables of parameters already; give one of the two")
    if not given["files"]:
        raise InvalidInputError("no scene.npz or problem.npz is given")
    if given["output"] is None:
        raise InvalidInputError("--output: missing, expected the folder of the study")
    check_scheduler(given)
    if given["target"] is not None and given["tune"] is None:
        raise InvalidInputError(f"{given.label('target')}: can be given only with --tune")
    if given["tune"] is not None and (tables or len(_solvers(given)) != 1):
        raise InvalidInputError("--tune: needs one --solver and ranges in --grid, without tables")


def _check_outputs(given: Given, folder: str) -> None:
    """Refuse, before the work, outputs that cannot be written or would overwrite the study or its sources."""
    from assoc.sweeps.store import FILES

    if os.path.exists(folder) and not os.path.isdir(folder):
        raise InvalidInputError(f"{folder}: is a file, expected the folder of a study")
    study = [os.path.join(folder, name) for name in FILES]
    given.check_outputs([*given.get("files", ()), given.get("config")], reserved=study, new_folder=folder)


def _solvers(given: Given) -> list[str]:
    """Names of the solvers."""
    from assoc.solvers import registry

    words = [name for word in given["solver"] or [DEFAULT_SOLVER] for name in word.split(",") if name]
    for name in words:
        registry.parameters(name)
    return list(dict.fromkeys(words))


def _spaces(given: Given) -> dict[str, dict[str, Space]]:
    """Values and ranges of ``--grid`` for each solver."""
    from assoc.sweeps.design import read_words

    return read_words(given["grid"] or [], _solvers(given), given.label("grid"))


def make_study(given: Given, tables: Mapping[str, Any]) -> Study:
    """Return the study that the options describe."""
    from assoc.sweeps.design import combinations, settings_of
    from assoc.sweeps.study import Study

    # report a wrong design before reading scenes
    if tables:
        settings = settings_of(tables, f"{given.file}: ")
    else:
        designs = _spaces(given).items()
        settings = [setting for design in designs for setting in combinations(*design, given.label("grid"))]
    return Study(settings=settings, **_scenes(given), **given.some(("seed", "time_limit", "cpu_limit", "repeats")))


def tune_parameters(given: Given, progress: Callable[[Any], object]) -> Report:
    """Search for good parameters."""
    from assoc.sweeps.tuning import tune

    ((solver, space),) = _spaces(given).items()
    sources = _scenes(given)
    return tune(
        given["output"],
        sources.pop("sources"),
        solver,
        space,
        given["tune"],
        progress=progress,
        **sources,
        **given.some(("seed", "time_limit", "cpu_limit", "repeats", "target", "jobs", "scheduler")),
    )


def _scenes(given: Given) -> dict[str, Any]:
    """The scenes and problems, their selected scans, and the options of gating."""
    from assoc.sweeps.sources import load_sources

    sources, scans = load_sources(given["files"]), None
    if given["scans"] is not None:
        label = given.label("scans")
        scans = [scan_range(given["scans"], source.num_scans, source.name, label) for source in sources]
    return {"sources": sources, "scans": scans, "gating": given.some(("gate_probability", "max_tuples"))}

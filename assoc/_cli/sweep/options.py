"""The options of ``python -m assoc.sweep``, from its command line and from a TOML file.

Imports inside functions keep wrong options quick to tell: scenes and studies need numpy and more.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from assoc._cli.inputs import check_outputs, read_toml
from assoc._cli.options import COMMON_OPTIONS, flag_of
from assoc._cli.values import check_kind, cores, scan_range, whole_number
from assoc.errors import InvalidInputError
from assoc.solvers import registry
from assoc.sweeps.design import designed, read_words, settings_from
from assoc.sweeps.store import LOG, MANIFEST, REPORT

if TYPE_CHECKING:
    from assoc.sweeps.setting import Setting
    from assoc.sweeps.sources import StudySource
    from assoc.sweeps.space import Space
    from assoc.sweeps.study import Study
    from assoc.sweeps.tuning import Report

DEFAULT_SOLVER = "aco"

_TEXTS = ("output", "scheduler", "scans", "target")
_WHOLE = {"repeats": 1, "seed": 0, "random": 1, "max_tuples": 1, "tune": 1}
_NUMBERS = ("time_limit", "gate_probability")
_LISTS = ("files", "solver", "grid")
_KNOWN = (*_LISTS, *_TEXTS, *_WHOLE, *_NUMBERS, "jobs")


@dataclass(frozen=True)
class Options:
    """The options of a sweep, checked.

    Attributes
    ----------
    values : mapping
        Options by name, in their types.
    tables : mapping
        The design as tables, if a file has it.
    config : str
        Name of that file.
    of_file : frozenset of str
        Options that have their values from it.
    """

    values: Mapping[str, Any]
    tables: Mapping[str, Any]
    config: str
    of_file: frozenset[str] = frozenset()

    def label(self, name: str) -> str:
        """What errors call an option: its flag, or its key in the file."""
        return f"{self.config}: {name}" if name in self.of_file else flag_of(name)

    @property
    def output(self) -> str:
        """The study's folder."""
        return str(self.values["output"])

    @property
    def jobs(self) -> int:
        """Number of processes."""
        return int(self.values.get("jobs", 1))

    @property
    def scheduler(self) -> str | None:
        """Address of the dask scheduler."""
        return self.values.get("scheduler")

    @property
    def tune(self) -> int | None:
        """Number of trials, if parameters are to be searched."""
        return self.values.get("tune")

    @property
    def solvers(self) -> list[str]:
        """Names of the solvers of the command line."""
        words = [name for word in self.values.get("solver", [DEFAULT_SOLVER]) for name in word.split(",") if name]
        for name in words:
            registry.parameters(name)
        return list(dict.fromkeys(words))

    @cached_property
    def spaces(self) -> dict[str, dict[str, Space]]:
        """Values and ranges of the command line for each solver."""
        return read_words(self.values.get("grid", []), self.solvers, self.label("grid"))

    @cached_property
    def settings(self) -> list[Setting]:
        """The design."""
        random, seed = self.values.get("random"), self.values.get("seed", 0)
        if self.tables:
            return settings_from(self.tables, random, seed, f"{self.config}: ")
        return designed(list(self.spaces.items()), random, seed, self.label("grid"))

    @cached_property
    def sources(self) -> tuple[StudySource, ...]:
        """The scenes and problems."""
        from assoc.sweeps.sources import load_sources

        return load_sources(self.values["files"])

    def study(self) -> Study:
        """Return the study."""
        from assoc.sweeps.study import Study

        settings = self.settings  # a wrong design is reported before scenes are read
        return Study(sources=self.sources, settings=settings, repeats=self.values.get("repeats", 1), **self._common())

    def tuning(self, progress: Callable[[Any], object]) -> Report:
        """Search parameters."""
        from assoc.sweeps.tuning import tune

        if self.tables or len(self.solvers) != 1 or "random" in self.values:
            raise InvalidInputError("--tune: needs one --solver and ranges in --grid, without --random or tables")
        solver = self.solvers[0]
        return tune(
            self.output,
            self.sources,
            solver,
            self.spaces[solver],
            self.values["tune"],
            target=self.values.get("target", "gap"),
            repeats=self.values.get("repeats", 3),
            jobs=self.jobs,
            scheduler=self.scheduler,
            progress=progress,
            **self._common(),
        )

    def _common(self) -> dict[str, Any]:
        values = self.values
        scans = None
        if "scans" in values:
            chosen, label = values["scans"], self.label("scans")
            scans = [scan_range(chosen, source.num_scans, source.name, label) for source in self.sources]
        return {
            "seed": values.get("seed", 0),
            "time_limit": values.get("time_limit"),
            "gating": {name: values[name] for name in ("gate_probability", "max_tuples") if name in values},
            "scans": scans,
        }


def read_options(given: Mapping[str, Any]) -> Options:
    """Check the options of the command line and of the file that ``config`` names; the former come first.

    Raises
    ------
    InvalidInputError
        Anything that is not as ``--help`` says.
    """
    config = given.get("config", "")
    content = read_toml(config) if config else {}
    tables = {key: content.pop(key) for key in [*content] if key in registry.names() and key not in _KNOWN}
    values = {key: _of_file(config, key, value) for key, value in content.items()}
    values |= {name: _of_text(name, given[name]) for name in _of_line(given)}
    options = Options(values, tables, config, frozenset(values) - {*_of_line(given)})
    if tables:
        for name in ("solver", "grid"):
            if name in values:
                label = options.label(name)
                raise InvalidInputError(f"{label}: {config} has tables of parameters already; give one of the two")
    if not values.get("files"):
        raise InvalidInputError("no scene.npz or problem.npz is given")
    if "output" not in values:
        raise InvalidInputError("--output: missing, expected the folder of the study")
    if "scheduler" in values and "jobs" in values:
        raise InvalidInputError("--jobs: a cluster has its own workers; give --jobs or --scheduler, not both")
    if values.get("target", "gap") not in ("gap", "time"):
        raise InvalidInputError(f"{options.label('target')}: expected gap or time, got {values['target']!r}")
    if "target" in values and "tune" not in values:
        raise InvalidInputError(f"{options.label('target')}: can be given only with --tune")
    if not 0 < values.get("gate_probability", 1.0) <= 1:
        label = options.label("gate_probability")
        raise InvalidInputError(f"{label}: expected a number in (0, 1], got {values['gate_probability']}")
    return options


def _of_line(given: Mapping[str, Any]) -> list[str]:
    """Names of the options that the command line has."""
    return [name for name, value in given.items() if name in _KNOWN and value != []]


def _of_text(name: str, value: Any) -> Any:
    if name in COMMON_OPTIONS:
        return COMMON_OPTIONS[name].parse(value, flag_of(name))
    return whole_number(value, flag_of(name), _WHOLE[name]) if name in _WHOLE else value


def _of_file(file: str, key: str, value: Any) -> Any:
    label = f"{file}: {key}"
    if key not in _KNOWN:
        if isinstance(value, (dict, list)):
            raise InvalidInputError(f"{file}: [{key}] is no solver; known: {', '.join(registry.names())}")
        raise InvalidInputError(f"{label}: unknown key; known: {', '.join(_KNOWN)}, and tables [solver]")
    if key in _LISTS:
        words = [value] if isinstance(value, str) else value
        if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
            raise InvalidInputError(f"{label}: expected text or a list of texts, got {value!r}")
        return words
    if key == "jobs" and value == "all":
        return cores()
    check_kind(value, str if key in _TEXTS else float if key in _NUMBERS else int, label)
    if key in _WHOLE or key == "jobs":
        least = _WHOLE.get(key, 1)
        if value < least:
            raise InvalidInputError(f"{label}: expected a whole number >= {least}, got {value!r}")
    if key == "time_limit" and not 0 < value < float("inf"):
        raise InvalidInputError(f"{label}: expected seconds > 0, got {value!r}")
    return float(value) if key in _NUMBERS else value


def check_study_outputs(folder: str, files: Sequence[str | None], inputs: Sequence[str]) -> None:
    """Refuse before the work what could not be written after it, and what would overwrite the study or its sources."""
    if os.path.exists(folder) and not os.path.isdir(folder):
        raise InvalidInputError(f"{folder}: is a file, expected the folder of a study")
    study = [os.path.join(folder, name) for name in (MANIFEST, LOG, REPORT)]
    check_outputs(files, inputs, reserved=study, new_folder=folder)

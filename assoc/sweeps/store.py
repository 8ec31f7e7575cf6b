"""The folder of a study: one SQLite file, beside its parameters as JSON for people to read.

A batch of runs is one transaction, so that whatever ends a process leaves all of a batch or none of it. The key of a
run is the primary key of its table: nothing is there twice, also if several processes work on one study.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from assoc._files.output import write_text
from assoc._files.reading import check_regular
from assoc._parameters import checked_time_limit, is_whole
from assoc.errors import InvalidInputError

FORMAT = "assoc.study"
VERSION = 2
DATABASE = "study.sqlite"
PARAMETERS = "study.json"
REPORT = "tuning.json"
OLD_LOG = "runs.jsonl"
"""The file of runs of version 1."""
FILES = (DATABASE, PARAMETERS, REPORT)

KEPT = "finished runs are kept, and the same command goes on from there"

_APPLICATION = 0x6173736F
# seconds to wait for another process that writes
_PATIENCE = 60.0
# bytes of a text or blob in the file
_LONGEST = 8_000_000

_KINDS = {
    **dict.fromkeys(("setting", "source"), ("text",)),
    **dict.fromkeys(("repeat", "scan", "seed"), ("integer",)),
    **dict.fromkeys(("cost", "lower_bound"), ("real", "null")),
    "iterations": ("integer", "null"),
    "time": ("real", "null"),
    "stopped_by": ("text", "null"),
    **dict.fromkeys(("true_tuples", "correct_tuples"), ("integer", "null")),
    "trace": ("blob",),
}
COLUMNS = tuple(_KINDS)
"""Columns of a run. ``setting`` and ``source`` are keys; ``trace``: iteration, seconds, cost as float64 in turn."""

RunKey = tuple[str, str, int, int]
"""Key of the setting, fingerprint of the source, repeat, scan."""


def _table(name: str, kinds: Mapping[str, Sequence[str]], *rest: str) -> str:
    """SQL of a table whose columns hold values of some kinds alone: `PRAGMA quick_check` looks at them."""
    columns = [
        f"{column} {kind[0].upper()} CHECK (typeof({column}) IN ({', '.join(map(repr, kind))}))"
        for column, kind in kinds.items()
    ]
    return f"CREATE TABLE {name} ({', '.join([*columns, *rest])}) WITHOUT ROWID"


_TABLES = (
    _table("study", {"manifest": ("text",)}, "PRIMARY KEY (manifest)"),
    _table("settings", dict.fromkeys(("key", "solver", "parameters"), ("text",)), "PRIMARY KEY (key)"),
    _table("runs", _KINDS, "CHECK (length(trace) % 24 = 0)", "PRIMARY KEY (setting, source, repeat, scan)"),
)


@dataclass(frozen=True)
class Manifest:
    """Properties that all runs of a study share; a folder takes the runs of one study only."""

    assoc: str
    """Version of assoc."""
    seed: int
    sources: dict[str, str]
    """Fingerprint to name."""
    time_limit: float | None
    cpu_limit: float | None
    gating: Mapping[str, Any]
    """Options of ``assoc.build_problem``."""
    code: str
    """Digest of the solvers' and costs' source files; empty if unknown."""

    def to_text(self) -> str:
        """Return the manifest as JSON."""
        return json.dumps({"format": FORMAT, "version": VERSION, **asdict(self)}, indent=1) + "\n"

    @staticmethod
    def from_text(text: str | bytes, path: Path) -> Manifest:
        """Read a manifest, of this version or of version 1."""
        content = parsed(text, path)
        if content.get("format") != FORMAT or content.get("version") not in (1, VERSION):
            raise InvalidInputError(f"{path}: is not of the format {FORMAT!r}, version {VERSION}")
        try:
            sources = content["sources"]
            if isinstance(sources, list):  # version 1
                sources = {source["fingerprint"]: source["name"] for source in sources}
            time, cpu = (checked_time_limit(content.get(name), name) for name in ("time_limit", "cpu_limit"))
            made = Manifest(
                content["assoc"], content["seed"], sources, time, cpu, dict(content["gating"]), content.get("code", "")
            )
            if not is_whole(made.seed, 0) or {*map(type, [made.assoc, made.code, *sources, *sources.values()])} != {
                str
            }:
                raise TypeError("a text or number of another kind")
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise InvalidInputError(f"{path}: is damaged ({type(error).__name__}: {error})") from None
        return made

    def check_same(self, new: Manifest, folder: Path) -> None:
        """Refuse to continue with another study."""
        if self.code and new.code and self.code != new.code:
            raise InvalidInputError(
                f"{folder}: solvers or costs of assoc were changed since this study was begun; take another folder"
            )
        if {*self.sources} != {*new.sources}:
            one = {**self.sources, **new.sources}[min({*self.sources} ^ {*new.sources})]
            raise InvalidInputError(
                f"{folder}: holds a study of other scenes or problems (not both have {one}); take another folder"
            )
        for name in ("assoc", "seed", "time_limit", "cpu_limit", "gating"):
            old, now = getattr(self, name), getattr(new, name)
            if old != now:
                raise InvalidInputError(
                    f"{folder}: this study was begun with {name} {old}, not {now}; take another folder"
                )


def parsed(text: str | bytes, path: Path) -> dict[str, Any]:
    """Return a table of JSON that holds no infinite number and no half of a character, or refuse it in a line."""
    try:
        content = json.loads(text)
        json.dumps(content, ensure_ascii=False, allow_nan=False).encode()
        if not isinstance(content, dict):
            raise ValueError("no table")
    except (ValueError, RecursionError) as error:
        raise InvalidInputError(f"{path}: is damaged ({str(error)[:100]})") from None
    return content


class Store:
    """An open study.

    With a manifest its folder is made if missing, and refused if it holds another study or something else; without, the
    study must be there.
    """

    def __init__(self, folder: str | os.PathLike[str], manifest: Manifest | None = None) -> None:
        self.folder = Path(folder)
        self.path = self.folder / DATABASE
        if manifest is not None:
            try:
                self.folder.mkdir(parents=True, exist_ok=True)
            except (OSError, ValueError) as error:
                reason = getattr(error, "strerror", None) or error
                raise InvalidInputError(f"{folder}: cannot be made ({reason})") from None
        elif not self.folder.is_dir():
            raise InvalidInputError(f"{folder}: no such folder, expected the folder of a study")
        for name in (DATABASE, *(DATABASE + ending for ending in ("-journal", "-wal", "-shm")), PARAMETERS):
            check_regular(self.folder / name)
        new = not self.path.exists()
        if new and (self.folder / OLD_LOG).exists():
            raise InvalidInputError(
                f"{folder}: this study has the form of an earlier version; read it into a new folder: "
                f"assoc sweep import {folder} NEW"
            )
        if new and manifest is None:
            raise InvalidInputError(f"{folder}: holds no study ({DATABASE} is missing)")
        if new and not all(path.name.startswith(FILES) for path in self.folder.glob("[!.]*")):
            raise InvalidInputError(f"{folder}: contains other files and no study; use a new or an empty folder")
        with self._explained("read" if manifest is None else "written"):
            mode = "rw" if manifest is None else "rwc"
            uri = f"{self.path.absolute().as_uri()}?mode={mode}"
            self._db = sqlite3.connect(uri, timeout=_PATIENCE, isolation_level=None, uri=True)
        try:
            self._begin(manifest)
        except BaseException:
            self._db.close()
            raise

    def _begin(self, manifest: Manifest | None) -> None:
        """Make the tables where there are none, and look whether all is as it was written."""
        with self._explained("read" if manifest is None else "written"):
            self._db.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LONGEST)
            self._db.execute("PRAGMA trusted_schema = OFF")
            if manifest is not None:
                self._db.execute("BEGIN IMMEDIATE")
                if not self._db.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
                    for table in _TABLES:
                        self._db.execute(table)
                    self._db.execute("INSERT INTO study VALUES (?)", (manifest.to_text(),))
                    self._db.execute(f"PRAGMA application_id = {_APPLICATION}")
                    self._db.execute(f"PRAGMA user_version = {VERSION}")
                self._db.execute("COMMIT")
            self._check()
            (text,) = self._db.execute("SELECT manifest FROM study").fetchone() or ("",)
        self.manifest = Manifest.from_text(text, self.path)
        if manifest is not None:
            self.manifest.check_same(manifest, self.folder)
            if not (self.folder / PARAMETERS).exists():
                write_text(self.folder / PARAMETERS, self.manifest.to_text())

    def _check(self) -> None:
        """Refuse what is no study, or damaged: with these tables alone, reading takes no longer than the file is."""
        identity = [self._db.execute(f"PRAGMA {name}").fetchone()[0] for name in ("application_id", "user_version")]
        if identity[0] != _APPLICATION:
            raise InvalidInputError(f"{self.path}: is no study of assoc")
        if identity[1] != VERSION:
            raise InvalidInputError(f"{self.path}: has version {identity[1]}, this program reads version {VERSION}")
        tables = [sql for (sql,) in self._db.execute("SELECT sql FROM sqlite_master ORDER BY rootpage LIMIT 9")]
        if tables != list(_TABLES):
            raise InvalidInputError(f"{self.path}: is damaged (its tables are not those of a study)")
        (found,) = self._db.execute("PRAGMA quick_check(1)").fetchone()
        if found != "ok":
            reason = " ".join(str(found).split())[:100]
            raise InvalidInputError(f"{self.path}: is damaged ({reason})")

    @contextmanager
    def _explained(self, what: str) -> Iterator[None]:
        """Turn errors of SQLite into one line."""
        try:
            yield
        except (sqlite3.Error, OSError, UnicodeError) as error:
            reason = " ".join(str(error).split())[:200]
            raise InvalidInputError(f"{self.path}: cannot be {what} ({reason})") from None

    def select(self, words: str, values: Sequence[object] = ()) -> list[tuple[Any, ...]]:
        """Rows of a query."""
        with self._explained("read"):
            return self._db.execute(f"SELECT {words}", values).fetchall()

    def done(self) -> frozenset[RunKey]:
        """Keys of the runs that are there."""
        return frozenset(self.select("setting, source, repeat, scan FROM runs"))

    def settings(self) -> dict[str, tuple[str, dict[str, Any]]]:
        """By its key, the solver and the parameters of each setting."""
        rows = self.select("key, solver, parameters FROM settings ORDER BY solver, key")
        return {key: (solver, parsed(text, self.path)) for key, solver, text in rows}

    def append(self, settings: Iterable[tuple[str, str, Mapping[str, Any]]], rows: Sequence[Sequence[Any]]) -> int:
        """Write runs (`COLUMNS`) with their settings, wait until they are on the disk; return the number of new ones.

        Settings are key, solver and parameters. Runs that are there are left as they are. If the file cannot be
        written (the disk is full), what was saved stays.
        """
        places = ", ".join("?" * len(COLUMNS))
        try:
            self._db.execute("BEGIN IMMEDIATE")
            texts = [(key, solver, json.dumps(dict(parameters))) for key, solver, parameters in settings]
            self._db.executemany("INSERT INTO settings VALUES (?, ?, ?) ON CONFLICT DO NOTHING", texts)
            before = self._db.total_changes
            self._db.executemany(f"INSERT INTO runs VALUES ({places}) ON CONFLICT DO NOTHING", rows)
            new = self._db.total_changes - before
            self._db.execute("COMMIT")
        except BaseException as error:
            # where SQLite has not done so itself
            with suppress(sqlite3.Error):
                self._db.execute("ROLLBACK")
            if not isinstance(error, sqlite3.OperationalError):
                raise
            (kept,) = self.select("count(*) FROM runs")[0]
            raise InvalidInputError(f"{self.path}: cannot be written ({error}); {kept} {KEPT}") from None
        return new

    def close(self) -> None:
        """Close the file."""
        self._db.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

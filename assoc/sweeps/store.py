"""The folder of a study: a manifest, and a log to which results are appended.

A line of the log is the checksum of the rest of the line, a blank, and JSON: a setting, or a batch of runs as columns.
A truncated line (after a power failure or a killed process) fails its checksum and is skipped; the
next entry begins on a new line of the file. So finished batches are never lost.
"""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from assoc._files.output import write_text
from assoc._files.reading import open_regular
from assoc.errors import InvalidInputError
from assoc.sweeps.setting import Setting

FORMAT = "assoc.study"
VERSION = 1
MANIFEST = "study.json"
LOG = "runs.jsonl"
REPORT = "tuning.json"

# bytes of the manifest, and of a line of the log; a batch has a few thousand runs
_LONGEST = 32_000_000
_NEW_MANIFEST = (
    f"the runs in {LOG} are not affected: start the same sweep in a new folder, and copy its {MANIFEST} here"
)

COLUMNS = (
    "setting",
    "source",
    "repeat",
    "scan",
    "seed",
    "cost",
    "lower_bound",
    "iterations",
    "time",
    "stopped_by",
    "true_tuples",
    "correct_tuples",
    "trace",
)
"""Columns of a batch, each a list with one entry per run. ``setting`` and ``source`` are keys."""

RunKey = tuple[str, str, int, int]
"""Key of the setting, fingerprint of the source, repeat, scan."""


@dataclass(frozen=True)
class Manifest:
    """Properties that all runs of a study share; a folder takes the runs of one study only."""

    package: str
    """Version of assoc."""
    seed: int
    sources: Mapping[str, str]
    """Fingerprint to name."""
    time_limit: float | None
    gating: Mapping[str, Any]
    """Options of ``assoc.build_problem``."""
    code: str = ""
    """Digest of the solvers' and costs' source files; empty if unknown."""

    def to_dict(self) -> dict[str, Any]:
        """Return the content of the file."""
        return {
            "format": FORMAT,
            "version": VERSION,
            "assoc": self.package,
            "code": self.code,
            "seed": self.seed,
            "sources": [{"fingerprint": key, "name": name} for key, name in self.sources.items()],
            "time_limit": self.time_limit,
            "gating": dict(self.gating),
        }

    def check_same(self, new: Manifest, folder: Path) -> None:
        """Refuse to continue with another study."""
        elsewhere = "take another folder"
        if self.package != new.package:
            raise InvalidInputError(
                f"{folder}: this study was made by version {self.package} of assoc, this is {new.package}; {elsewhere}"
            )
        if self.code and new.code and self.code != new.code:
            raise InvalidInputError(
                f"{folder}: solvers or costs of assoc were changed since this study was begun; {elsewhere}"
            )
        if {*self.sources} != {*new.sources}:
            strange = [name for key, name in new.sources.items() if key not in self.sources]
            missing = [name for key, name in self.sources.items() if key not in new.sources]
            what = f"{strange[0]} is not among its sources" if strange else f"{missing[0]} of it is not given"
            raise InvalidInputError(f"{folder}: holds a study of other scenes or problems: {what}; {elsewhere}")
        for name in ("seed", "time_limit", "gating"):
            old, now = getattr(self, name), getattr(new, name)
            if old != now:
                raise InvalidInputError(f"{folder}: this study was begun with {name} {old}, not {now}; {elsewhere}")


class Store:
    """An open study folder, made if missing; only one process at a time may write to it.

    Refused is a folder that holds another study (by its manifest) or something else, or that is used or not writable.
    """

    def __init__(self, folder: str | os.PathLike[str], manifest: Manifest) -> None:
        self.folder = Path(folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise InvalidInputError(f"{self.folder}: cannot be made ({reason})") from None
        if not (self.folder / MANIFEST).exists() and (self.folder / LOG).exists():
            raise InvalidInputError(f"{self.folder}: {MANIFEST} is missing; {_NEW_MANIFEST}")
        if not (self.folder / MANIFEST).exists() and any(self.folder.glob("[!.]*")):
            raise InvalidInputError(f"{self.folder}: contains other files and no study; use a new or an empty folder")
        self._lock = _lock(self.folder)
        try:
            if (self.folder / MANIFEST).exists():
                read_manifest(self.folder).check_same(manifest, self.folder)
            else:
                write_text(self.folder / MANIFEST, json.dumps(manifest.to_dict(), indent=1) + "\n")
            self.settings: set[str] = set()
            self.done: set[RunKey] = set()
            for entry in filter(None, read_log(self.folder)):
                if "setting_key" in entry:
                    self.settings.add(entry["setting_key"])
                else:
                    self.done.update(run_keys(entry))
            self._log = self._open_log()
        except BaseException:
            self._lock.close()
            raise

    def _open_log(self) -> IO[bytes]:
        path = self.folder / LOG
        try:
            log = open_regular(path, "ab")
            if log.tell() > 0:
                with open_regular(path) as written:
                    written.seek(-1, os.SEEK_END)
                    if written.read(1) != b"\n":
                        log.write(b"\n")
        except OSError as error:
            raise InvalidInputError(f"{path}: cannot be written ({error.strerror or error})") from None
        return log

    def append(self, settings: Sequence[Setting], batch: Mapping[str, list[Any]]) -> int:
        """Write a batch (`COLUMNS`) with its new settings, wait until it is on the disk; return the number of new runs.

        Runs that are already saved are left out. If the file cannot be written (the disk is full), what was saved
        stays.
        """
        keys = list(run_keys(batch))
        fresh = [i for i, key in enumerate(keys) if key not in self.done]
        if len(fresh) < len(keys):
            batch = {name: [batch[name][i] for i in fresh] for name in COLUMNS}
        if not fresh:
            return 0
        new = {setting.key: setting for setting in settings if setting.key not in self.settings}
        entries: list[Mapping[str, Any]] = [
            {"setting_key": key, "solver": setting.solver, "parameters": dict(setting.parameters)}
            for key, setting in new.items()
        ]
        data = memoryview(b"".join(log_line(entry) for entry in [*entries, batch]))
        path = self.folder / LOG
        before = os.fstat(self._log.fileno()).st_size
        try:
            while data:
                data = data[self._log.write(data) :]
            os.fsync(self._log.fileno())
        except BaseException as error:
            # remove a partial line, which would damage the next one
            with suppress(OSError):
                os.ftruncate(self._log.fileno(), before)
            if not isinstance(error, OSError):
                raise
            raise InvalidInputError(
                f"{path}: cannot be written ({error.strerror or error}); {len(self.done)} finished runs are kept, "
                "and the same command goes on from there"
            ) from None
        self.settings |= {*new}
        self.done.update(keys)
        return len(fresh)

    def close(self) -> None:
        """Close the files and release the folder."""
        self._log.close()
        self._lock.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


def run_keys(batch: Mapping[str, list[Any]]) -> Iterator[RunKey]:
    """Keys of the runs of a batch."""
    return zip(batch["setting"], batch["source"], batch["repeat"], batch["scan"], strict=True)


def read_manifest(folder: str | os.PathLike[str]) -> Manifest:
    """Read the manifest of a study; one that is missing, damaged, or of a later version is refused."""
    path = Path(folder) / MANIFEST
    if not Path(folder).is_dir():
        raise InvalidInputError(f"{folder}: no such folder, expected the folder of a study")
    try:
        with open_regular(path) as file:
            text = file.read(_LONGEST + 1)
        if len(text) > _LONGEST:
            raise InvalidInputError(f"{path}: is larger than {_LONGEST} bytes; {_NEW_MANIFEST}")
        content = json.loads(text)
    except InvalidInputError:
        raise
    except FileNotFoundError:
        raise InvalidInputError(f"{folder}: holds no study ({MANIFEST} is missing)") from None
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (ValueError, RecursionError) as error:
        raise InvalidInputError(f"{path}: cannot be read ({error}); {_NEW_MANIFEST}") from None
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InvalidInputError(f"{path}: is not of the format {FORMAT!r}; {_NEW_MANIFEST}")
    if content.get("version") != VERSION:
        raise InvalidInputError(f"{path}: has version {content.get('version')!r}, this program reads version {VERSION}")
    try:
        sources = {str(source["fingerprint"]): str(source["name"]) for source in content["sources"]}
        limit = None if content["time_limit"] is None else float(content["time_limit"])
        gating, code = dict(content["gating"]), str(content.get("code", ""))
        return Manifest(str(content["assoc"]), int(content["seed"]), sources, limit, gating, code)
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidInputError(f"{path}: is damaged ({type(error).__name__}: {error}); {_NEW_MANIFEST}") from None


def read_log(folder: str | os.PathLike[str]) -> Iterator[dict[str, Any] | None]:
    """Yield the entries of the log in order; None for a line with a wrong checksum."""
    path = Path(folder) / LOG
    try:
        with open_regular(path) as file:
            while line := file.readline(_LONGEST + 1):
                if len(line) > _LONGEST:
                    raise InvalidInputError(f"{path}: has a line of more than {_LONGEST} bytes")
                if line != b"\n":
                    yield _read_log_line(line)
    except FileNotFoundError:
        return
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be read ({error.strerror or error})") from None


def damaged_lines(folder: str | os.PathLike[str]) -> int:
    """Count the lines of the log that are truncated or were changed."""
    return sum(entry is None for entry in read_log(folder))


def log_line(entry: Mapping[str, Any]) -> bytes:
    """Return a line of the log: the checksum of an entry, and the entry as JSON."""
    body = json.dumps(entry, separators=(",", ":"), allow_nan=False).encode()
    return b"%08x %s\n" % (zlib.crc32(body), body)


def _read_log_line(line: bytes) -> dict[str, Any] | None:
    body = line[9:-1]
    if line[-1:] != b"\n" or line[:9] != b"%08x " % zlib.crc32(body):
        return None
    # the checksum detects accidents, not manipulation
    try:
        entry = json.loads(body)
    except (ValueError, RecursionError):
        return None
    return entry if isinstance(entry, dict) and _sound(entry) else None


def _sound(entry: Mapping[str, Any]) -> bool:
    """Whether an entry has the expected form: a setting, or a batch of runs."""
    if "setting_key" in entry:
        kinds = {"setting_key": str, "solver": str, "parameters": dict}
        return all(isinstance(entry.get(name), kind) for name, kind in kinds.items())
    columns = [entry.get(name) for name in COLUMNS]
    if not all(isinstance(column, list) for column in columns):
        return False
    plain = all(_KINDS[name](value) for name in COLUMNS for value in entry[name])
    return plain and len({len(column) for column in columns if column is not None}) == 1


def _text(value: object) -> bool:
    return isinstance(value, str)


def _whole(value: object) -> bool:
    # within the range of 64 bits
    return isinstance(value, int) and not isinstance(value, bool) and -(2**63) <= value < 2**63


def _real(value: object) -> bool:
    return value is None or isinstance(value, float) or _whole(value)


def _trace(value: object) -> bool:
    return isinstance(value, list) and all(
        isinstance(point, list) and len(point) == 3 and all(map(_real, point)) for point in value
    )


_KINDS: Mapping[str, Callable[[object], bool]] = {
    **dict.fromkeys(("setting", "source"), _text),
    **dict.fromkeys(("repeat", "scan", "seed"), _whole),
    **dict.fromkeys(("cost", "lower_bound", "time"), _real),
    **dict.fromkeys(("iterations", "true_tuples", "correct_tuples"), lambda value: value is None or _whole(value)),
    "stopped_by": lambda value: value is None or _text(value),
    "trace": _trace,
}


def _lock(folder: Path) -> IO[bytes]:
    """Lock the folder against a second process; the lock ends with the process in any case."""
    path = folder / ".lock"
    try:
        file = open_regular(path, "ab")
    except OSError as error:
        raise InvalidInputError(f"{folder}: cannot be written ({error.strerror or error})") from None
    try:
        import fcntl
    except ImportError:  # not a POSIX system: users must then avoid two processes at once
        return file
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        raise InvalidInputError(f"{folder}: another sweep is running in this folder") from None
    except OSError:  # a file system without locks
        pass
    return file

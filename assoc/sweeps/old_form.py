"""Studies of version 1 (a manifest, and a log whose lines begin with their checksum), read into the present form."""

from __future__ import annotations

import json
import os
import sqlite3
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from assoc._files.reading import open_regular, readable
from assoc.errors import InvalidInputError
from assoc.sweeps.store import COLUMNS, DATABASE, OLD_LOG, PARAMETERS, Manifest, Store

# bytes of the manifest, and of a line of the log
_LONGEST = 32_000_000


def import_study(old: str | os.PathLike[str], new: str | os.PathLike[str]) -> tuple[int, int]:
    """Read a study of version 1 into a new folder; return the numbers of runs, and of damaged lines left out.

    Where it was stopped, the same call goes on.
    """
    manifest_file, log = Path(old) / PARAMETERS, Path(old) / OLD_LOG
    if not log.exists() or (Path(old) / DATABASE).exists():
        raise InvalidInputError(f"{old}: holds no study of an earlier version ({PARAMETERS} and {OLD_LOG})")
    with readable(manifest_file), open_regular(manifest_file) as file:
        text = file.read(_LONGEST + 1)
    if len(text) > _LONGEST:
        raise InvalidInputError(f"{manifest_file}: is larger than {_LONGEST} bytes")
    damaged = 0
    with Store(new, Manifest.from_text(text, manifest_file)) as store:
        for line in _lines(log):
            try:
                entry = _entry(line)
                if "setting_key" in entry:
                    store.append([(entry["setting_key"], entry["solver"], entry["parameters"])], [])
                else:
                    store.append([], _rows(entry))
            except InvalidInputError:  # the new file cannot be written
                raise
            except (sqlite3.Error, ArithmeticError, AttributeError, KeyError, RecursionError, TypeError, ValueError):
                damaged += 1
        return len(store.done()), damaged


def _lines(log: Path) -> Iterator[bytes]:
    with readable(log), open_regular(log) as file:
        while line := file.readline(_LONGEST + 1):
            if len(line) > _LONGEST:
                raise InvalidInputError(f"{log}: has a line of more than {_LONGEST} bytes")
            if line != b"\n":
                yield line


def _entry(line: bytes) -> dict[str, Any]:
    """A setting, or a batch of runs as columns."""
    body = line[9:-1]
    if line[-1:] != b"\n" or line[:9] != b"%08x " % zlib.crc32(body):
        raise ValueError("the line is truncated or was changed")
    entry = json.loads(body)
    return dict(entry)


def _rows(batch: dict[str, Any]) -> list[tuple[Any, ...]]:
    traces = [np.array(trace, dtype=float).reshape(-1, 3).astype("<f8").tobytes() for trace in batch["trace"]]
    return [*zip(*(batch[name] for name in COLUMNS[:-1]), traces, strict=True)]

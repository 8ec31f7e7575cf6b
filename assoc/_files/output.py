"""Write files completely or not at all, and write to pipes, terminals and /dev/null."""

from __future__ import annotations

import io
import os
import secrets
import stat
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from assoc._system import temporary
from assoc.errors import AssocError, InvalidInputError

FilePath = str | os.PathLike[str]

STDOUT = "-"
"""The name of stdout; a file of that name is ``./-``."""


def check_writable(path: FilePath, *, folder_to_come: FilePath | None = None) -> None:
    """Refuse, before the work starts, a path where no file can be written; `folder_to_come` need not exist yet."""
    if path == STDOUT:
        return
    try:
        found = _status(path)
        if found is not None and stat.S_ISDIR(found.st_mode):
            raise InvalidInputError(f"{path}: is a folder, expected a file name to write")
        if found is not None and not stat.S_ISREG(found.st_mode):
            if not is_stream(path):
                raise InvalidInputError(f"{path}: is neither a file nor a pipe or terminal")
            return
        # a symbolic link stays, and its target is written
        parent = Path(os.path.realpath(path)).parent
        if not parent.is_dir():
            if folder_to_come is not None and parent == Path(os.path.realpath(folder_to_come)):
                return
            leads = parent if os.path.islink(path) else Path(path).parent
            raise InvalidInputError(f"{path}: the folder {leads} does not exist")
        if found is not None and not os.access(path, os.W_OK):
            raise InvalidInputError(f"{path}: cannot be written (it is read-only)")
        if not os.access(parent, os.W_OK | os.X_OK):
            raise InvalidInputError(f"{path}: cannot be written (the folder {Path(path).parent} is read-only)")
    except (OSError, ValueError) as error:
        if isinstance(error, InvalidInputError):
            raise
        raise InvalidInputError(f"{path}: cannot be written ({getattr(error, 'strerror', None) or error})") from error


def is_stream(path: FilePath) -> bool:
    """Whether a path is a pipe, a terminal or a character device, which no file can replace."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISCHR(mode)


def write_atomically(path: FilePath, writer: Callable[[IO[bytes]], object]) -> None:
    """Write a file so that readers see the old content or all of the new, never a part.

    A pipe or device is written to directly, in one piece. A symbolic link stays, and its target is replaced. `writer`
    writes to a binary file object; if it raises, nothing is left behind. A path that cannot be written raises
    InvalidInputError.
    """
    check_writable(path)
    number = 1 if path == STDOUT else _standard_stream(path)
    if number is not None or is_stream(path):
        _write_stream(path, number, writer)
        return
    with _replacing(path) as file:
        writer(file)


@contextmanager
def written_gradually(path: FilePath) -> Iterator[IO[bytes]]:
    """A binary file to write to bit by bit: it takes its name at the end, and after an error nothing is left behind.

    A pipe or device gets the content at once. Errors are those of `write_atomically`.
    """
    check_writable(path)
    number = 1 if path == STDOUT else _standard_stream(path)
    if number is None and not is_stream(path):
        with _replacing(path) as file:
            yield file
        return
    stream = sys.stdout if number == 1 else sys.stderr
    if number is not None and stream is not None:
        stream.flush()
    with open(path, "wb", 0) if number is None else os.fdopen(os.dup(number), "wb", 0) as file:
        yield file


@contextmanager
def _replacing(path: FilePath) -> Iterator[IO[bytes]]:
    """A new file beside another one, which it replaces when it is written."""
    target = os.path.realpath(path)
    name = ""
    try:
        handle, name = _create(target)
        with os.fdopen(handle, "wb") as file:
            yield file
            # flush before the renaming: after a crash of the machine the name must not stand for an empty file
            file.flush()
            os.fsync(file.fileno())
        with temporary.lock:
            os.replace(name, target)
            temporary.forget(name)
    except BaseException as error:
        if name:
            temporary.remove(name)
        if isinstance(error, AssocError):
            raise
        # on a full disk closing the archive fails, too; the disk's error is that error's context
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, OSError):
            cause = cause.__context__
        if cause is not None and isinstance(error, Exception):
            raise InvalidInputError(
                f"{path}: cannot be written ({cause.strerror or cause}); what was there before is unchanged"
            ) from error
        raise
    _sync_folder(os.path.dirname(target))


def write_text(path: FilePath, text: str) -> None:
    """Write text as UTF-8, completely or not at all; see `write_atomically`.

    Bytes of file names that are not valid text are written as escapes.
    """
    content = text.encode("utf-8", "backslashreplace")
    write_atomically(path, lambda file: file.write(content))


def write_json(path: FilePath, content: Mapping[str, Any]) -> None:
    """Write plain data as JSON, completely or not at all; see `write_atomically`."""
    import json  # not needed for --help

    write_text(path, json.dumps(content, allow_nan=False) + "\n")


def _status(path: FilePath) -> os.stat_result | None:
    """Status of the file at a path, following links; None if there is none."""
    try:
        return os.stat(os.fspath(path))
    except FileNotFoundError:
        return None
    except NotADirectoryError:
        raise InvalidInputError(f"{path}: the folder {Path(path).parent} does not exist") from None


def _create(target: str) -> tuple[int, str]:
    """Create a file in the folder of another one, with the mode that the other has or would get."""
    folder, base = os.path.split(target)
    # names have at most 255 bytes; 30 are for the additions
    start = os.fsdecode(os.fsencode(base)[:200])
    old = _status(target)
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    while True:
        name = os.path.join(folder, f".{start}.{secrets.token_hex(6)}.part")
        with temporary.lock:
            try:
                # the system applies the umask; reading it here would change it for all threads
                handle = os.open(name, flags, 0o666)
            except FileExistsError:
                continue
            temporary.add(name)
        if old is not None:
            with suppress(OSError):
                os.chmod(name, stat.S_IMODE(old.st_mode) & 0o777)
        return handle, name


def _standard_stream(path: FilePath) -> int | None:
    """Return 1 or 2 if a path is this process's stdout or stderr (/dev/stdout, or the same file)."""
    found = _status(path)
    for number in (1, 2):
        with suppress(OSError):
            if found is not None and os.path.samestat(found, os.fstat(number)):
                return number
    return None


def _write_stream(path: FilePath, number: int | None, writer: Callable[[IO[bytes]], object]) -> None:
    content = io.BytesIO()
    writer(content)
    try:
        if number is None:
            with open(path, "wb") as file:
                file.write(content.getbuffer())
            return
        stream = sys.stdout if number == 1 else sys.stderr
        if stream is not None:
            stream.flush()
        # opening the file again would write from its start
        with os.fdopen(os.dup(number), "wb") as file:
            file.write(content.getbuffer())
    except BrokenPipeError:
        if number == 1:
            raise  # the reader of stdout closed it
        raise InvalidInputError(f"{path}: cannot be written (its reader has gone)") from None
    except OSError as error:
        raise InvalidInputError(f"{path}: cannot be written ({error.strerror or error})") from error


def _sync_folder(folder: str) -> None:
    """Flush the new name to the disk, too, where the system can do that."""
    with suppress(OSError):
        handle = os.open(folder or ".", os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)

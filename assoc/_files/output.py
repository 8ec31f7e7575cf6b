"""Write files completely or not at all, and write to pipes, terminals and /dev/null."""

from __future__ import annotations

import errno
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
    if _standard_stream(path) is None and not is_stream(path):
        with _naming(path, unchanged=True), _replacing(path) as file:
            writer(file)
        return
    content = io.BytesIO()
    writer(content)
    with _stream(path) as stream:
        stream.write(content.getbuffer())


@contextmanager
def written_gradually(path: FilePath) -> Iterator[IO[bytes]]:
    """A binary file to write to bit by bit: it takes its name at the end, and after an error nothing is left behind.

    A pipe or device gets the content at once. Errors of writing are those of `write_atomically`; others pass as they
    are.
    """
    check_writable(path)
    with _replacing(path) if _standard_stream(path) is None and not is_stream(path) else _stream(path) as file:
        yield file


@contextmanager
def _naming(path: FilePath, unchanged: bool = False) -> Iterator[None]:
    """Turn errors of the system into one line that names the file."""
    try:
        yield
    except AssocError:
        raise
    except Exception as error:
        # on a full disk closing an archive fails, too; the disk's error is that error's context
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, OSError):
            cause = cause.__context__
        broken = isinstance(cause, BrokenPipeError)
        if cause is None or (broken and _standard_stream(path) == 1):
            raise  # the reader of stdout closed it
        why = "its reader has gone" if broken else cause.strerror or cause
        rest = "; what was there before is unchanged" if unchanged else ""
        raise InvalidInputError(f"{path}: cannot be written ({why}){rest}") from error


class _Whole(io.FileIO):
    """Writes all of what it is given, or raises an error that names the file."""

    def __init__(self, opened: FilePath | int, path: FilePath, unchanged: bool = False) -> None:
        super().__init__(opened, "wb")
        self._errors = path, unchanged

    def write(self, content: Any) -> int:
        rest = memoryview(content).cast("B")
        size = len(rest)
        with _naming(*self._errors):
            while rest:
                # the system may write a part; a stream that does not block may refuse all
                done: int | None = super().write(rest)
                if done is None:
                    raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
                rest = rest[done:]
        return size


@contextmanager
def _stream(path: FilePath) -> Iterator[IO[bytes]]:
    """A pipe or device, written at once."""
    number = _standard_stream(path)
    stream = sys.stdout if number == 1 else sys.stderr
    with _naming(path):
        if number is not None and stream is not None:
            stream.flush()
        # opening the file again would write from its start
        opened = _Whole(path if number is None else os.dup(number), path)
    with opened:
        yield opened


@contextmanager
def _replacing(path: FilePath) -> Iterator[IO[bytes]]:
    """A new file beside another one, which it replaces when it is written."""
    target = os.path.realpath(path)
    with _naming(path, unchanged=True):
        handle, name = _create(target)
    try:
        with io.BufferedWriter(_Whole(handle, path, unchanged=True)) as file:
            yield file
            # flush before the renaming: after a crash of the machine the name must not stand for an empty file
            file.flush()
            with _naming(path, unchanged=True):
                os.fsync(file.fileno())
        with _naming(path, unchanged=True), temporary.lock:
            os.replace(name, target)
            temporary.forget(name)
    except BaseException:
        temporary.remove(name)
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
    """Return 1 or 2 if a path is this process's stdout or stderr (-, /dev/stdout, or the same file)."""
    if path == STDOUT:
        return 1
    found = _status(path)
    for number in (1, 2):
        with suppress(OSError):
            if found is not None and os.path.samestat(found, os.fstat(number)):
                return number
    return None


def _sync_folder(folder: str) -> None:
    """Flush the new name to the disk, too, where the system can do that."""
    with suppress(OSError):
        handle = os.open(folder or ".", os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)

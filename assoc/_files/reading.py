"""Reading files without trust: decompressed while they are read, with limits on their size.

A compressed file may hold `FLOOR` bytes, or `EXPANSION` times its own size; larger text must be unpacked by hand.
`assoc.check`, which uses nothing of the package, has a limit of its own.
"""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import os
import stat
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import IO, Any

from assoc.errors import InvalidInputError

FilePath = str | os.PathLike[str]

FLOOR = 16_000_000
EXPANSION = 30
MOST_BYTES = 2_000_000_000
"""Largest size of any file in bytes, compressed or not, unless its reader allows less."""
LONGEST_LINE = 10_000
# bytes that are read at once
_BLOCK = 1 << 20


def _open_zipped(file: IO[bytes]) -> IO[bytes]:
    archive = zipfile.ZipFile(file)
    members = archive.infolist()
    if len(members) != 1:
        raise ValueError(f"it holds {len(members)} files, expected one")
    return open_member(archive, members[0])


def open_member(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> IO[bytes]:
    """Open a file of an archive, stored or deflated: zipfile does not limit what other methods unpack to."""
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{member.filename[:60]!r} is packed in an unusual way, expected deflate")
    return archive.open(member)


_OPENERS: dict[bytes, Any] = {
    b"\xfd7zXZ\0": lzma.open, b"\x1f\x8b": gzip.open, b"BZh": bz2.open, b"PK\3\4": _open_zipped,
}  # fmt: skip
"""What unpacks a file, by its first bytes."""
_DAMAGED = (lzma.LZMAError, zlib.error, EOFError, gzip.BadGzipFile, zipfile.BadZipFile)


@contextmanager
def readable(path: FilePath) -> Iterator[None]:
    """Turn errors while reading a file into one line that names the file and the cause."""
    try:
        yield
    except InvalidInputError:
        raise
    except FileNotFoundError:
        raise InvalidInputError(f"{path}: no such file") from None
    except _DAMAGED:
        raise InvalidInputError(f"{path}: is damaged") from None
    except (OSError, ValueError, RuntimeError, NotImplementedError) as error:  # ValueError: not a valid file name
        raise InvalidInputError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None


def expands(size: float, packed: int, floor: int = FLOOR) -> bool:
    """Whether ``size`` bytes are more than a file of ``packed`` bytes may unpack to."""
    return size > max(floor, EXPANSION * packed)


def check_unpacked(path: FilePath, size: float, packed: int, floor: int = FLOOR) -> None:
    """Refuse a file of ``packed`` bytes that unpacks to ``size`` bytes, if that is too much; see `expands`."""
    if expands(size, packed, floor):
        raise InvalidInputError(
            f"{path}: would unpack from {packed} bytes to {size:.0f} or more, expected at most {EXPANSION} times that"
        )


def refuse_pipe(path: FilePath) -> None:
    """Refuse a named pipe, or a link to one: nobody may ever write to it, and readers look at a file twice."""
    mode = 0
    # what a shell makes of a command, /dev/fd/63, has a writer
    if not os.fspath(path).startswith(("/dev/", "/proc/")):
        with suppress(OSError, ValueError):
            mode = os.stat(path).st_mode
    if stat.S_ISFIFO(mode):
        raise InvalidInputError(f"{path}: is a named pipe, expected a file")


class _Counted(io.RawIOBase):
    """The content of a file, up to a limit."""

    def __init__(self, path: FilePath, most: int) -> None:
        self._path, self._most, self._count = path, most, 0
        refuse_pipe(path)
        with ExitStack() as stack, readable(path):
            file = stack.enter_context(open(path, "rb"))
            start = file.peek(6)
            opener = next((opener for first, opener in _OPENERS.items() if start.startswith(first)), None)
            self._packed = None if opener is None else os.fstat(file.fileno()).st_size
            self._stream: Any = file if opener is None else stack.enter_context(opener(file))
            self._close = stack.pop_all().close

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        with readable(self._path):
            count: int = self._stream.readinto(buffer)
        self._count += count
        if self._count > self._most:
            raise InvalidInputError(f"{self._path}: is larger than {self._most} bytes")
        if self._packed is not None:
            check_unpacked(self._path, self._count, self._packed)
        return count

    def close(self) -> None:
        if not self.closed:
            super().close()
            self._close()


def open_input(path: FilePath, most: int = MOST_BYTES) -> IO[bytes]:
    """Open a file; what xz, gzip, bzip2 or zip packed is decompressed, whatever its name.

    InvalidInputError, now or while it is read, if it is larger than ``most`` or than compressed files may be.
    """
    return io.BufferedReader(_Counted(path, most), 1 << 16)


def kind_of(path: FilePath) -> str:
    """What a file of plots is by its first bytes: "parquet", "asterix" (if it is not text), or "csv".

    By its name if it cannot be read, or only once.
    """
    start = b""
    with suppress(OSError, ValueError, InvalidInputError):
        if stat.S_ISREG(os.stat(path).st_mode):
            with open_input(path) as file:
                start = file.read(512)
    name = os.fspath(path).lower()
    if start[:4] == b"PAR1" or not start and name.endswith((".parquet", ".pq")):
        return "parquet"
    # of UTF-16, which readers of text refuse, the first bytes are a mark
    signs = start[:2] not in (b"\xff\xfe", b"\xfe\xff") and any(sign < 9 or 13 < sign < 32 for sign in start)
    return "asterix" if signs or not start and name.endswith((".ast", ".asterix", ".pcap")) else "csv"


def read_bytes(path: FilePath, most: int = MOST_BYTES) -> bytes:
    """Return the content of a file; see `open_input`."""
    with open_input(path, most) as file:
        return file.read()


def read_lines(
    path: FilePath, longest: int = LONGEST_LINE, most: int = MOST_BYTES, *, fallback: str = ""
) -> Iterator[str]:
    """Yield the lines of a text file (UTF-8, or the encoding ``fallback``), each at most ``longest`` bytes."""
    with open_input(path, most) as file:
        number = 0
        while block := file.read(_BLOCK):
            # up to the end of a line, if it is not too long
            block += file.readline(longest + 1)
            try:
                text = block.decode("utf-8-sig" if number == 0 else "utf-8")
            except UnicodeDecodeError:
                text = ""
            lines = text.split("\n")
            if text and "\0" not in text and max(map(len, block.split(b"\n"))) < longest:
                last = lines.pop()
                yield from [f"{line}\n" for line in lines]
                yield from [last] if last else []
                number += len(lines)
            else:
                # line by line: one of them may be wrong
                for line in io.BytesIO(block):
                    number += 1
                    yield _line(line, f"{path}: line {number}", longest, fallback, first=number == 1)


def _line(line: bytes, where: str, longest: int, fallback: str, *, first: bool) -> str:
    if len(line) > longest:
        raise InvalidInputError(f"{where} is longer than {longest} bytes")
    if first and line.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InvalidInputError(f"{where} is UTF-16, expected UTF-8: save it so")
    if b"\0" in line:
        raise InvalidInputError(f"{where} holds a NUL byte, expected text (UTF-8)")
    try:
        return line.decode("utf-8-sig" if first else "utf-8")
    except UnicodeDecodeError:
        if not fallback:
            raise InvalidInputError(f"{where} is not UTF-8 text") from None
        # signs that it lacks are wrong anyway
        return line.decode(fallback, "replace")


def check_regular(path: FilePath) -> None:
    """Refuse a link, pipe, device or folder that others may have put in the place of a file."""
    with suppress(FileNotFoundError):
        if not stat.S_ISREG(os.lstat(path).st_mode):
            raise InvalidInputError(f"{path}: is a link, a pipe or a folder, expected a file")


def open_regular(path: FilePath) -> IO[bytes]:
    """Open a file in a folder that others may write to: follows no link, and waits for no pipe or device.

    Raises OSError as `open` does, InvalidInputError for what is no file.
    """

    def opener(name: str, flags: int) -> int:
        check_regular(name)
        # check again: it may have been replaced meanwhile
        return os.open(name, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))

    return open(path, "rb", opener=opener)

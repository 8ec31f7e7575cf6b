"""npz files: written completely or not at all, and read without trust."""

from __future__ import annotations

import lzma
import math
import os
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from assoc._files.output import write_atomically
from assoc._files.reading import check_unpacked, expands, open_member, refuse_pipe
from assoc._types import Array
from assoc.errors import InvalidInputError

SIZE_LIMIT = 4 * 1024**3
"""Largest total size of the arrays of one npz file, in bytes."""

_HEADER_LIMIT = 10_000
FLOOR = 64_000_000
"""Bytes that the arrays of any file may take: a higher limit than for text, which becomes many small objects."""

_OF_FORMAT = 10_000

_KINDS = {"float": "fiu", "int": "iu", "str": "U", "bool": "b"}
_TARGETS: dict[str, Any] = {"float": np.float64, "int": np.int64, "str": np.str_, "bool": np.bool_}


class Field(NamedTuple):
    """The expected type of an array in an npz file."""

    kind: str
    """"float" (takes integers, too), "int", "str" or "bool": what the array is returned as."""
    ndim: int
    required: bool = True


def save_npz(
    path: str | os.PathLike[str],
    format_name: str,
    version: int,
    arrays: Mapping[str, Array | str | int],
) -> None:
    """Write arrays as a compressed npz, with its format name and version; see `load_npz`."""
    content = {name: np.asarray(value) for name, value in arrays.items()}
    for name, value in content.items():
        if value.dtype.hasobject:
            raise InvalidInputError(f"{path}: the field {name!r} holds Python objects, expected a plain array")
    header = {"format": np.asarray(format_name), "version": np.asarray(version)}

    def write(file: IO[bytes]) -> None:
        # data that compress beyond what readers accept are stored uncompressed
        for method in (zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED):
            file.seek(0)
            file.truncate()
            # as numpy.savez, which leaves its archive open on a full disk and warns of that later
            with zipfile.ZipFile(file, "w", method) as archive:
                for name, value in {**header, **content}.items():
                    with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                        np.lib.format.write_array(member, value, allow_pickle=False)
            if not expands(sum(8 * value.size + value.nbytes for value in content.values()), file.tell(), FLOOR):
                return

    write_atomically(path, write)


def load_npz(
    path: str | os.PathLike[str], format_name: str, version: int, fields: Mapping[str, Field]
) -> dict[str, Array]:
    """Read an npz file written by `save_npz`; any other file is refused with one line that begins with the path.

    Nothing in the file is executed (no pickles). No memory is allocated for an array before its header is checked
    against the size of the data in the file. Older versions are read, later ones refused; arrays that are not in
    `fields` are ignored, and optional ones that are missing are missing in the result.
    """
    file = Path(path)
    refuse_pipe(file)
    try:
        if file.is_dir():
            raise InvalidInputError(f"{file}: is a folder, expected a file of format {format_name!r}")
        if not file.exists():
            raise InvalidInputError(f"{file}: no such file")
        if file.stat().st_size == 0:
            raise InvalidInputError(f"{file}: is empty, expected a file of format {format_name!r}")
        with zipfile.ZipFile(file) as archive:
            return _read(file, archive, format_name, version, fields)
    except InvalidInputError:
        raise
    except zipfile.BadZipFile as error:
        raise InvalidInputError(
            f"{file}: is not a readable npz file ({_one_line(error)}), expected a file of format {format_name!r}"
        ) from error
    except (OSError, EOFError, zlib.error, lzma.LZMAError, RuntimeError, ValueError, NotImplementedError) as error:
        raise InvalidInputError(f"{file}: cannot be read ({_one_line(error)})") from error


def _one_line(error: BaseException) -> str:
    text = str(getattr(error, "strerror", None) or error).strip()
    return text.splitlines()[0][:160] if text else type(error).__name__


def _read(
    file: Path, archive: zipfile.ZipFile, format_name: str, version: int, fields: Mapping[str, Field]
) -> dict[str, Array]:
    members = {info.filename.removesuffix(".npy"): info for info in archive.infolist()}
    if "format" not in members:
        raise InvalidInputError(f"{file}: has no field 'format', expected a file of format {format_name!r}")
    wanted = {name: spec for name, spec in fields.items() if spec.required or name in members}
    found = str(_member(file, archive, members["format"], Field("str", 0))[()])
    if found != format_name:
        raise InvalidInputError(f"{file}: has the format {found[:60]!r}, expected {format_name!r}")
    if "version" not in members:
        raise InvalidInputError(f"{file}: the field 'version' is missing")
    stored = int(_member(file, archive, members["version"], Field("int", 0))[()])
    if stored > version:
        raise InvalidInputError(
            f"{file}: has version {stored} of {format_name!r}, this program reads up to version {version}"
        )
    if stored < 1:
        raise InvalidInputError(f"{file}: the field 'version' is {stored}, expected 1 or more")
    for name in wanted:
        if name not in members:
            raise InvalidInputError(f"{file}: the field {name!r} is missing")
    arrays: dict[str, Array] = {}
    for name, spec in wanted.items():
        arrays[name] = _member(file, archive, members[name], spec, sum(array.nbytes for array in arrays.values()))
    return arrays


def format_of(path: str | os.PathLike[str]) -> str | None:
    """Return the format that an npz file claims; None if it cannot be read: loading it then raises the error."""
    file = Path(path)
    try:
        with zipfile.ZipFile(file) as archive:
            return str(_member(file, archive, archive.getinfo("format.npy"), Field("str", 0))[()])
    except Exception:  # for a damaged file, loading gives the better message
        return None


def _member(
    file: Path, archive: zipfile.ZipFile, info: zipfile.ZipInfo, spec: Field, taken: int | None = None
) -> Array:
    """Read one array, after others of ``taken`` bytes; its header is checked before memory is allocated."""
    name = info.filename.removesuffix(".npy")
    with open_member(archive, info) as stream:
        try:
            major, minor = np.lib.format.read_magic(stream)
            if (major, minor) == (1, 0):
                shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream, _HEADER_LIMIT)
            elif (major, minor) == (2, 0):
                shape, fortran, dtype = np.lib.format.read_array_header_2_0(stream, _HEADER_LIMIT)
            else:
                raise ValueError(f"npy version {major}.{minor}")
        except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError) as error:
            raise InvalidInputError(f"{file}: the field {name!r} is not a plain array ({_one_line(error)})") from error
        if dtype.hasobject:
            raise InvalidInputError(f"{file}: the field {name!r} holds pickled objects, expected {spec.kind} values")
        if dtype.kind not in _KINDS[spec.kind]:
            raise InvalidInputError(f"{file}: the field {name!r} has type {dtype}, expected {spec.kind} values")
        if dtype.itemsize == 0:
            # numpy allocates one character for each, which the check against the file's size cannot see
            raise InvalidInputError(f"{file}: the field {name!r} holds texts without room for a character")
        if len(shape) != spec.ndim:
            raise InvalidInputError(f"{file}: the field {name!r} has {len(shape)} dimensions, expected {spec.ndim}")
        if any(type(side) is not int for side in shape):
            # numpy's own check lets True and False pass
            raise InvalidInputError(f"{file}: the field {name!r} has the shape {shape}, expected whole numbers")
        if any(side < 0 for side in shape):
            raise InvalidInputError(f"{file}: the field {name!r} has a negative shape {shape}")
        size = math.prod(shape) * dtype.itemsize
        if size > info.file_size:
            raise InvalidInputError(
                f"{file}: the field {name!r} claims {size} bytes of data, the file holds {info.file_size}"
            )
        memory = math.prod(shape) * max(dtype.itemsize, np.dtype(_TARGETS[spec.kind]).itemsize)
        if memory > (_OF_FORMAT if taken is None else SIZE_LIMIT - taken):
            raise InvalidInputError(f"{file}: the field {name!r} takes {memory} bytes, more than the limit")
        check_unpacked(file, memory + (taken or 0), file.stat().st_size, FLOOR)
        data = stream.read(size)
        if len(data) != size:
            raise InvalidInputError(f"{file}: the field {name!r} ends after {len(data)} of {size} bytes")
    if size == 0:
        array: Array = np.zeros(shape, dtype)
    else:
        array = np.frombuffer(data, dtype).reshape(shape, order="F" if fortran else "C")
    if spec.kind == "int" and dtype.kind == "u" and array.size and int(array.max()) > np.iinfo(np.int64).max:
        raise InvalidInputError(f"{file}: the field {name!r} has integers beyond 64 bits")
    return np.array(array, dtype=_TARGETS[spec.kind], order="C")

"""Ways to spoil a file: bytes, text, and npz archives whose members lie."""

import io
import os
import pickle
import re
import warnings
import zipfile
from typing import Any

import numpy as np

MARKER = "executed-by-a-pickle"
"""A file of this name in the working folder shows that a pickle was executed."""

_NASTY = (
    "nan inf -inf 1e999 -1e308 1e-320 -0 0 -1 1 2 3.5 9223372036854775807 -9223372036854775808 18446744073709551616 "
    "1e12 1e13 999999999999999999999999 0x10 1_000 true false null None [] {} '' \" ' , ; : = # \\ // ../../etc/passwd"
).split() + ["", " ", "\t", "\n", "\r\n", "\x00", "\ufeff", "\u202e", "é", "𐀀", "x" * 300, "9" * 5000, "[" * 3000]


class Trap:
    """Leaves a mark if it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (os.mkdir, (MARKER,))


def spoil(rng: np.random.Generator, content: bytes, kind: str) -> bytes:
    """Return a spoiled copy of a file's content; ``kind`` is "npz", "text", "sqlite" or "bytes"."""
    draw = rng.random()
    if draw < 0.05:
        return rng.bytes(int(rng.integers(0, 3000)))
    if draw < 0.4 or kind not in _OF_KIND:
        return _bytes(rng, content)
    spoiled = _OF_KIND[kind](rng, content)
    return _bytes(rng, spoiled) if rng.random() < 0.1 else spoiled


def _bytes(rng: np.random.Generator, content: bytes) -> bytes:
    data = bytearray(content)
    for _ in range(int(rng.choice([1, 1, 2, 5, 30]))):
        size = len(data)
        at = int(rng.integers(0, size + 1))
        long = int(rng.integers(1, 40))
        style = rng.integers(7)
        if style == 0:
            del data[at:]
        elif style == 1:
            del data[at : at + long]
        elif style == 2:
            data[at:at] = rng.bytes(long)
        elif style == 3:
            data[at : at + long] = rng.bytes(long)
        elif style == 4 and size:
            data[at % size] ^= 1 << int(rng.integers(8))
        elif style == 5:
            begin = int(rng.integers(0, size + 1))
            data[at:at] = data[begin : begin + int(rng.integers(1, 2000))]
        else:
            data[at : at + 4] = int(rng.choice([0, 1, 0x7FFFFFFF, 0xFFFFFFFF])).to_bytes(4, "little")
    return bytes(data)


def _text(rng: np.random.Generator, content: bytes) -> bytes:
    """Replace words and numbers by nasty ones, move and repeat lines."""
    text = content.decode("utf-8", "replace")
    for _ in range(int(rng.choice([1, 1, 2, 4]))):
        style = rng.integers(5)
        if style < 3:
            words = list(re.finditer(r"[-+.\w]+|[^\w\s]", text))
            if words:
                word = words[rng.integers(len(words))]
                text = text[: word.start()] + str(rng.choice(_NASTY)) + text[word.end() :]
            continue
        lines = text.split("\n")
        at = int(rng.integers(len(lines)))
        if style == 3:
            lines.insert(at, lines[int(rng.integers(len(lines)))])
        else:
            del lines[at]
        text = "\n".join(lines)
    return text.encode("utf-8", "surrogatepass")


def _sqlite(rng: np.random.Generator, content: bytes) -> bytes:
    """Spoil a text within, in place: JSON, or the SQL of a table."""
    texts = list(re.finditer(rb"[ -~\n]{12,}", content))
    if not texts:
        return _bytes(rng, content)
    text = texts[int(rng.integers(len(texts)))]
    spoiled = _text(rng, text[0])[: len(text[0])]
    return content[: text.start()] + spoiled.ljust(len(text[0])) + content[text.end() :]


def _npz(rng: np.random.Generator, content: bytes) -> bytes:
    """Write the archive anew with one or two members changed, gone or lying."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {info.filename: archive.read(info) for info in archive.infolist()}
    for _ in range(int(rng.integers(1, 3))):
        name = str(rng.choice(list(members)))
        members[name] = _member(rng, members[name])
        if rng.random() < 0.15:
            del members[name]
        if not members:
            break
    method = int(rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]))
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method) as archive:
        for name, value in members.items():
            archive.writestr(name, value)
    return out.getvalue()


def _member(rng: np.random.Generator, raw: bytes) -> bytes:
    try:
        array = np.load(io.BytesIO(raw), allow_pickle=False)
    except Exception:  # spoiled before
        return rng.bytes(50)
    style = rng.integers(12)
    if style == 0:
        return _header(_shape(rng), str(rng.choice(["<f8", "<i4", "|b1", "<U5", "<U0", "|S0", "|V8", "<c16", "|O"])))
    if style == 1:
        return _header(_shape(rng), "<f8") + rng.bytes(int(rng.integers(0, 200)))
    if style == 2:
        return _saved(np.array([Trap()], dtype=object))
    if style == 3:
        return pickle.dumps(Trap())
    if style == 4:
        return raw[: int(rng.integers(0, len(raw) + 1))]
    if style == 5:
        return _header(array.shape, array.dtype.str) + bytes(40_000_000)
    if style == 6:
        kind = str(rng.choice(["f4", "f2", "i8", "i1", "u8", "U7", "c8", "S5", "M8[s]"]))
        try:
            with np.errstate(all="ignore"), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return _saved(array.astype(kind))
        except (ValueError, TypeError, UnicodeError):
            return _saved(np.zeros(array.shape, kind))
    if style == 7:
        return _saved(array.reshape(-1)[: int(rng.integers(0, array.size + 1))])
    if style == 8:
        return _saved(np.asfortranarray(array)[None] if rng.random() < 0.5 else array.T)
    if style == 9:
        return _saved(np.concatenate([array.reshape(-1), array.reshape(-1)]))
    changed = np.array(array)
    if not changed.size:
        return _saved(changed)
    flat = changed.reshape(-1)
    where = rng.integers(0, flat.size, int(rng.choice([1, 1, 3, 20])))
    if changed.dtype.kind == "f":
        flat[where] = rng.choice([np.nan, np.inf, -np.inf, 0.0, -0.0, 1e308, -1e308, 5e-324, 1e12, 1e13, -1.0, 3.2])
    elif changed.dtype.kind in "iu":
        limits = np.iinfo(changed.dtype)
        flat[where] = rng.choice([limits.min, limits.max, 0, 1, limits.max // 2 + 1, 7])
    elif changed.dtype.kind == "U":
        flat[where] = str(rng.choice(["", "x", "radar2d", "\x00", "é" * 50, "{}", "[1]", "null"]))
    elif changed.dtype.kind == "b":
        flat[where] = ~flat[where]
    return _saved(changed)


def _shape(rng: np.random.Generator) -> tuple[Any, ...]:
    sides = [0, 1, 2, 5, 10**6, 10**9, 10**12, 2**31, 2**62, 2**63, 2**70, -1, True, 2.5]
    return tuple(sides[i] for i in rng.integers(0, len(sides), int(rng.integers(0, 4))))


def _header(shape: tuple[Any, ...], dtype: str) -> bytes:
    text = repr({"descr": dtype, "fortran_order": False, "shape": shape}) + "\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()


def _saved(array: np.ndarray[Any, np.dtype[Any]]) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=True)
    return buffer.getvalue()


_OF_KIND = {"npz": _npz, "text": _text, "sqlite": _sqlite}

"""Files that are small and want much memory, and how much of it a program takes for them."""

import lzma
import os
import sqlite3
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

MOST = 1_000_000_000
"""Bytes of memory that no hostile file may take."""

_RUN = """
import runpy, sys
sys.argv = sys.argv[1:]
try:
    runpy.run_module(sys.argv[0], run_name="__main__")
finally:
    sys.stdout.flush()
    print(*(line for line in open("/proc/self/status") if "VmHWM" in line), file=sys.stderr)
"""
_LIMITED = "import os, resource, sys; resource.setrlimit(resource.RLIMIT_AS, 2 * [12 << 30]); " + (
    "os.execv(sys.executable, [sys.executable, *sys.argv[1:]])"
)

HEAD = b"assoc-problem 1\nsizes 9\ndummies no\ntuples 9\n"
REPORTS = b"time,id,lat,lon,altitude\n"


class Hostile(NamedTuple):
    """A file, the words of the program that reads it ({} is the file), what it gets from stdin, its exit code."""

    name: str
    make: Callable[[Path], object]
    words: str
    stdin: str = os.devnull
    code: int = 2


def packed(module: Any, start: bytes, again: bytes, size: float) -> Callable[[Path], object]:
    """A packed file that begins so, and then says the same thing again and again, in streams of ten megabytes."""
    chunk = again * (10_000_000 // len(again))
    return lambda path: path.write_bytes(module.compress(start) + module.compress(chunk) * int(size / 1e7))


def _zipped(path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x.csv", REPORTS + b"0,a,1,2,3\n" * 20_000_000)


def _parquet(path: Path, name: str, rows: int) -> None:
    """Equal rows: almost nothing in the file, however many."""
    import pyarrow as pa
    from pyarrow import parquet

    numbers = pa.array(np.zeros(rows))
    names = pa.DictionaryArray.from_arrays(pa.array(np.zeros(rows, np.int32)), [name])
    table = pa.table({"time": numbers, "id": names, "lat": numbers, "lon": numbers, "altitude": numbers})
    with parquet.ParquetWriter(path, table.schema) as writer:
        writer.write_table(table)


def _npz(format_name: str, arrays: dict[str, Any], kind: int = zipfile.ZIP_DEFLATED) -> Callable[[Path], object]:
    """An npz; a shape and a type stand for zeros."""

    def make(path: Path) -> None:
        with zipfile.ZipFile(path, "w", kind) as archive:
            for name, value in {"format": np.array(format_name), "version": np.array(1), **arrays}.items():
                with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                    if isinstance(value, np.ndarray):
                        np.lib.format.write_array(member, value)
                        continue
                    shape, dtype = value
                    head = {"descr": dtype, "fortran_order": False, "shape": shape}
                    np.lib.format.write_array_header_1_0(member, head)
                    left = int(np.prod(shape)) * np.dtype(dtype).itemsize
                    for _ in range(left >> 24):
                        member.write(bytes(1 << 24))
                    member.write(bytes(left & 0xFFFFFF))

    return make


def _problem(count: int, **more: Any) -> dict[str, Any]:
    return {"tuples": ((count, 2), "|u1"), "costs": ((count,), "|u1"), "sizes": np.array([9, 9]), **more}


def _scene(scans: int) -> dict[str, Any]:
    one = {"sensor_position": np.zeros((1, 3)), "sensor_dim": np.array([2]), "sensor_kind": np.array(["radar2d"])}
    one |= {"sensor_name": np.array(["a"]), "sensor_covariance": np.eye(2).ravel()}
    one |= {"sensor_field_of_view": np.array([[0.0, 1e5], [-3.0, 3.0]])}
    one |= {"sensor_detection_probability": np.array([0.9]), "sensor_false_alarm_rate": np.array([1.0])}
    offsets = ((1, scans + 1), "|u1")
    return {**one, "times": np.arange(scans), "measurement_values": np.zeros(0), "measurement_offsets": offsets}


def _study(*words: str, tables: bool = True) -> Callable[[Path], object]:
    """A study changed by SQL."""

    def make(folder: Path) -> None:
        from assoc.sweeps.store import DATABASE, Manifest, Store

        Store(folder, Manifest("0", 0, {}, None, None, {}, "")).close()
        if not tables:
            (folder / DATABASE).unlink()
        with sqlite3.connect(folder / DATABASE) as base:
            base.execute("PRAGMA ignore_check_constraints = ON")
            for one in words:
                base.execute(one)
        base.close()

    return make


_QUERY = "CREATE VIEW %s AS WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n) SELECT x FROM n"


def _endless_study(folder: Path) -> None:
    folder.mkdir()
    (folder / "study.sqlite").symlink_to("/dev/zero")


def _counted(head: bytes, again: bytes, size: int) -> Callable[[Path], object]:
    """A problem that is right, of so many bytes."""
    count = size // len(again)
    return lambda path: path.write_bytes(lzma.compress(head.replace(b"N", b"%d" % count) + again * count))


def _padded(path: Path) -> None:
    """Equal rows beside three megabytes that cannot be packed, so that many are allowed."""
    import pyarrow as pa
    from pyarrow import parquet

    rows = 2_200_000
    numbers, names = pa.array(np.zeros(rows)), pa.array(np.full(rows, "a"))
    noise = pa.array([np.random.default_rng(0).bytes(3_000_000), *[b""] * (rows - 1)])
    table = {"time": numbers, "id": names, "lat": numbers, "lon": numbers, "altitude": numbers, "noise": noise}
    parquet.write_table(pa.table(table), path)


def _asterix(path: Path) -> None:
    """Service messages of the least size: a north crossing of a few bytes, in many blocks."""
    record = bytes([0b11110000, 1, 2, 1, 0, 0, 1, 5])
    content = record * 8000
    block = bytes([34]) + (3 + len(content)).to_bytes(2, "big") + content
    path.write_bytes(block * 4)


def _scene_file(path: Path) -> None:
    from assoc.simulation import simulate

    simulate("rotating-radars", 0, aircraft=1, duration=5.0).save(path)


SOLVE = "assoc.solve {} --solver greedy"
CHECK = "assoc.check {} /dev/null"
FLIGHTS = "assoc.simulate from-tracks {} -o /dev/null --scans 2"
LIVE = "assoc.live {} --turns 4,5,5.5 -o /dev/null"

HOSTILE = [
    Hostile("problem.txt.xz", packed(lzma, HEAD, b"0 1\n", 4.9e8), SOLVE),
    Hostile("checked.txt.xz", packed(lzma, HEAD, b"0 1\n", 1.9e8), CHECK),
    Hostile("proof.xz", packed(lzma, b'{"a": [1', b",[]", 1.5e8), "assoc.check {folder}/good.txt {}"),
    Hostile("solution.xz", packed(lzma, b"assoc-solution 1\n", b"1\n", 1.9e8), "assoc.check {folder}/good.txt {}"),
    Hostile("flights.csv.xz", packed(lzma, REPORTS, b"0,a,1,2,3\n", 1e9), FLIGHTS),
    Hostile("flights.csv.zip", _zipped, FLIGHTS),
    Hostile("flights.parquet", lambda path: _parquet(path, "a", 40_000_000), FLIGHTS),
    Hostile("long-names.parquet", lambda path: _parquet(path, "a" * 1_000_000, 5_000), FLIGHTS),
    # just within what is allowed
    Hostile("within-named.csv.xz", _counted(REPORTS, b"0,a,1,2,3\n", 15_900_000), FLIGHTS, code=0),
    Hostile("within.parquet", _padded, FLIGHTS, code=0),
    Hostile(
        "within.npz",
        _npz("assoc.problem", _problem(2_500_000, tuples=np.ones((2_500_000, 2), np.uint8))),
        SOLVE,
        code=0,
    ),
    Hostile("wide.npz", _npz("assoc.problem", _problem(40_000_000)), SOLVE),
    Hostile("format.npz", _npz("", {"format": ((), "<U500000000")}), SOLVE),
    Hostile("lzma.npz", _npz("assoc.problem", _problem(10), zipfile.ZIP_LZMA), SOLVE),
    Hostile("scans.npz", _npz("assoc.scene", _scene(4_000_000)), SOLVE),
    Hostile("texts.npz", _npz("assoc.scene", _scene(3) | {"sensor_name": ((1,), "<U30000000")}), SOLVE),
    Hostile("asterix.ast", _asterix, "assoc.track {} -o /dev/null"),
    Hostile("config.toml", lambda path: path.symlink_to("/dev/zero"), "assoc.solve x --config {}"),
    Hostile("plots.csv", lambda path: path.symlink_to("/dev/zero"), "assoc.track {} -o /dev/null"),
    Hostile(
        "study",
        _study(
            "INSERT INTO settings VALUES ('a', 'aco', '[[]' || replace(hex(zeroblob(10000000)), '00', ',[]') || ']')"
        ),
        "assoc.sweep --summary {}",
    ),
    Hostile("study-without-end", _endless_study, "assoc.sweep --summary {}"),
    Hostile(
        "study-of-a-query",
        _study(*(f"{_QUERY % name}" for name in ("study", "settings", "runs")), tables=False),
        "assoc.sweep --summary {}",
    ),
    Hostile("zeros.npz", _scene_file, LIVE, "zeros", 0),
]


class Outcome(NamedTuple):
    """How a program ended: its exit code, bytes at the peak, what it said."""

    code: int
    peak: int
    said: str


def run(case: Hostile, folder: Path) -> Outcome:
    """Make the file, and let the program read it in a process of its own."""
    path = folder / case.name
    case.make(path)
    with open(folder / "zeros", "wb") as zeros:
        zeros.truncate(2_000_000_000)
    (folder / "good.txt").write_text("assoc-problem 1\nsizes 1\ndummies yes\ntuples 1\n0 1\n")
    words = case.words.replace("{folder}", str(folder)).replace("{}", str(path)).split()
    with open(folder / case.stdin, "rb") as stdin:
        command = [sys.executable, "-c", _LIMITED, "-c", _RUN, *words]
        done = subprocess.run(command, stdin=stdin, capture_output=True, text=True, timeout=600)
    *said, peak = done.stderr.strip().splitlines()
    return Outcome(done.returncode, 1024 * int(peak.split()[1]), "\n".join(said))

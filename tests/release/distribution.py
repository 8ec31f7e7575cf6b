"""What is given away: sdist and wheels, built, looked through, installed into empty environments and tried.

    python -m tests.release.distribution FOLDER     (make check-dist; FOLDER is dist)

leaves them in FOLDER. It takes some minutes and a network (or an index that pip knows): each environment gets all
dependencies anew. With the wheel that ships compiled kernels nothing may be compiled; where they do not fit, the same
answers must come from kernels that are compiled on the spot.
"""

import argparse
import getpass
import json
import pickle
import platform
import socket
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

from tests.release.build import Built, WrongError, build, installed, run
from tests.release.kernels import OF_RADARS, RADARS
from tests.release.requirements import ROOT

_FOLDERS = ("assoc", "docs", "experiments", "tests")
_FILES = ("Makefile", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "README.md", "LICENSE")
_BUILD = ("pyproject.toml", "hatch_build.py")
_DESCRIBED = ("METADATA", "WHEEL", "RECORD", "entry_points.txt", "licenses/LICENSE")
_ADDED = ("PKG-INFO", ".gitignore")
"""What the build adds to a source distribution."""
_NOT_IN_SDIST = tuple(f"experiments/sdlib/{one}/" for one in ("instances", "proofs", "solutions"))
_PROGRAMS = ("assoc.simulate", "assoc.solve", "assoc.track", "assoc.live", "assoc.sweep")

_LARGEST_WHEEL = 5_000_000
"""Bytes."""

SMOKE = """
import json, sys
from importlib import metadata
from pathlib import Path
import assoc
assert Path(assoc.__file__).is_relative_to(sys.prefix), assoc.__file__
assert assoc.__version__ == metadata.version("assoc")
assert (Path(assoc.__file__).parent / "py.typed").exists()
for name in assoc.__all__:
    getattr(assoc, name)
from assoc.simulation import simulate
found = assoc.associate(simulate("three-radar", 1, scans=2), "greedy")
assert len(found.solutions) == 2
"""

WITHOUT = "import sys; sys.modules.update(dict.fromkeys(('ortools', 'pandas')))"
"""Put before a script: what may be left out of an installation cannot be imported (docs/dependencies.md)."""


def tracked() -> set[str]:
    """Files under version control, those of them that have been removed left out."""
    done = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    return {name for name in done.stdout.split("\0") if name and (ROOT / name).exists()}


def members(path: Path) -> Iterator[tuple[str, bytes]]:
    """Names (without the folder that all are in) and contents of an archive's files."""
    if path.suffix == ".whl":
        with zipfile.ZipFile(path) as archive:
            for name in archive.namelist():
                yield name, archive.read(name)
        return
    with tarfile.open(path) as archive:
        for info in archive:
            if info.uname not in ("", "root") or info.gname not in ("", "root") or info.uid or info.gid:
                raise WrongError(f"{path.name}: {info.name}: belongs to {info.uname or info.uid}")
            if not info.isfile():
                raise WrongError(f"{path.name}: {info.name}: is no plain file")
            file = archive.extractfile(info)
            assert file is not None
            yield info.name.partition("/")[2], file.read()


def traces_of_this_machine() -> list[bytes]:
    """Texts that no file which is given away may hold: where this tree is, whose, and on which machine."""
    words = {str(ROOT), str(Path.home()), sys.prefix, socket.gethostname(), getpass.getuser()}
    # "root" or "localhost" say nothing
    return [word.encode() for word in words if len(word) > 5 and word != "localhost"]


def check_members(path: Path, expected: set[str]) -> None:
    """Compare the files of an archive with those expected, and look into them.

    Raises
    ------
    WrongError
        With all that is wrong.
    """
    found = dict(members(path))
    wrong = [f"{name}: is missing" for name in sorted(expected - {*found})]
    wrong += [f"{name}: should not be there" for name in sorted({*found} - expected)]
    traces = traces_of_this_machine()
    for name, content in found.items():
        wrong += [f"{name}: holds {trace.decode()!r}" for trace in traces if trace in content]
        if (ROOT / name).is_file() and content != (ROOT / name).read_bytes():
            wrong.append(f"{name}: is not as in the tree")
    if wrong:
        raise WrongError(f"{path.name}: " + "; ".join(wrong[:10]) + f" ({len(wrong)} in all)")
    print(f"{path.name}: {len(found)} files, {path.stat().st_size >> 10} KiB, as expected", flush=True)


def check_sdist(path: Path) -> None:
    """Check that a source distribution holds what is under version control and is meant for others."""
    folders = tuple(f"{one}/" for one in _FOLDERS)
    files = {name for name in tracked() if name.startswith(folders) or name in _FILES + _BUILD}
    files = {name for name in files if not name.startswith(_NOT_IN_SDIST)}
    check_members(path, files | {*_ADDED})


def check_wheel(path: Path, kernels: list[str] | None = None) -> None:
    """Check that a wheel holds the package, what describes it, and its kernels, no more; and that it is small."""
    about = f"{'-'.join(path.name.split('-')[:2])}.dist-info"
    files = {name for name in tracked() if name.startswith("assoc/")}
    described = {f"{about}/{one}" for one in _DESCRIBED}
    check_members(path, files | described | {*(kernels or [])})
    if path.stat().st_size > _LARGEST_WHEEL:
        raise WrongError(f"{path.name}: {path.stat().st_size} bytes, expected {_LARGEST_WHEEL} at the most")


def smoke(python: Path, folder: Path) -> None:
    """Try what is installed, from an empty folder: the package, and the help of its programs."""
    place = folder / "empty"
    place.mkdir()
    for before in ("", WITHOUT):
        run(python, "-W", "error", "-c", before + SMOKE, cwd=place)
    for program in _PROGRAMS:
        if f"python -m {program}" not in run(python, "-W", "error", "-m", program, "--help", cwd=place):
            raise WrongError(f"{program} --help: does not say how it is called")


COUNTED = """
import importlib, sys
from numba.core import event
seen = event.RecordingListener()
event.register("numba:compile", seen)
code = importlib.import_module(sys.argv[1]).main(sys.argv[2:])
assert "ortools" not in sys.modules, "only milp needs ortools"
with open("compiled.txt", "a") as file:
    print(sum(1 for _, one in seen.buffer if one.is_start), *sys.argv[1:], file=file)
sys.exit(code)
"""
"""Runs a program and notes how many kernels were compiled in its process."""

_USUAL = (
    ("simulate", "three-radar", "-o", "scene.npz"),
    ("simulate", "crowd", "--targets", "30", "-o", "crowd.npz"),
    ("solve", "scene.npz", "--json", "exact.json", "--csv", "exact.csv"),
    ("solve", "scene.npz", "--solver", "aco", "--json", "aco.json"),
    ("solve", "scene.npz", "--solver", "aco", "--jobs", "2", "--json", "aco2.json"),
    ("solve", "scene.npz", "--kbest", "3", "--scans", "0:10", "--json", "kbest.json"),
    ("solve", "crowd.npz", "--json", "crowd.json"),
    ("track", "scene.npz", "-o", "tracks.csv"),
    *OF_RADARS,
    ("sweep", "scene.npz", "--solver", "aco", "--grid", "ants=2,3", "--scans", "0:2", "-o", "study"),
)
_COMPILING = (*_USUAL[:1], *_USUAL[2:4])
"""What is run where kernels must be compiled."""


def without_times(path: Path) -> str:
    """Content of a result file without its measurements of time."""

    def cleaned(value: object) -> object:
        if isinstance(value, dict):
            return {
                key: cleaned(one) for key, one in value.items() if key not in ("runtime", "compile_time", "seconds")
            }
        return [cleaned(one) for one in value] if isinstance(value, list) else value

    return json.dumps(cleaned(json.loads(path.read_text())))


def compiled(python: Path, place: Path, programs: tuple[tuple[str, ...], ...], **more: str) -> int:
    """Run programs in a new folder with an empty cache; how many kernels they and their processes compiled."""
    place.mkdir()
    (place / "radars.toml").write_text(RADARS)
    for program, *words in programs:
        command = [python, "-W", "error", "-c", COUNTED, f"assoc.{program}", *words]
        # what is missing must be compiled and counted, not interpreted
        run(*command, cwd=place, NUMBA_CACHE_DIR=str(place / "cache"), ASSOC_INTERPRET="0", **more)
    counts = [int(line.split()[0]) for line in (place / "compiled.txt").read_text().splitlines()]
    if len(counts) != len(programs):
        raise WrongError(f"{place.name}: {len(counts)} programs of {len(programs)} say what they compiled")
    # other processes say nothing, but what they compile they keep
    return max(sum(counts), sum(1 for _ in place.rglob("*.nbc")))


def check_kernels(python: Path, folder: Path) -> None:
    """Check that shipped kernels are taken, that others are compiled where they do not fit, and give the same."""
    place = folder / "usual"
    count = compiled(python, place, _USUAL)
    print(f"compiled: {count}", flush=True)
    if count:
        raise WrongError((place / "compiled.txt").read_text())
    made = {path.name for path in place.iterdir()} - {"cache", "compiled.txt", "radars.toml"}
    endings = (".npz", ".json", ".csv", ".kml")
    written = {word for _, *words in _USUAL for word in words if word.endswith(endings)} | {"study"}
    if made != written:
        raise WrongError(f"the programs leave {sorted(made)}")
    for name, settings in (("generic", {"NUMBA_CPU_NAME": "generic"}), ("other-numba", {})):
        if name == "other-numba":
            _spoil(python)
        count = compiled(python, folder / name, _COMPILING, **settings)
        print(f"compiled, {name}: {count}", flush=True)
        if not count:
            raise WrongError(f"{name}: shipped kernels are taken that do not fit")
        for answer in ("exact.json", "aco.json"):
            if without_times(folder / name / answer) != without_times(place / answer):
                raise WrongError(f"{name}, {answer}: compiled kernels give other answers than shipped ones")


def _spoil(python: Path) -> None:
    """Let the shipped kernels of an environment be those of another version of numba."""
    (package,) = (python.parents[1] / "lib").glob("*/site-packages/assoc")
    for path in (package / "_kernels").rglob("*.nbi"):
        with open(path, "rb") as file:
            pickle.load(file)
            rest = file.read()
        path.write_bytes(pickle.dumps("0.1") + rest)


def check(done: Built, folder: Path) -> None:
    """Check all that was built."""
    check_sdist(done.sdist)
    check_wheel(done.plain)
    check_wheel(done.compiled, done.kernels)
    for archive in (done.compiled, done.sdist):
        place = folder / archive.suffix.strip(".")
        place.mkdir()
        python = installed(archive, place)
        smoke(python, place)
        if archive is done.compiled:
            check_kernels(python, place)
        print(f"{archive.name}: installs and works in an empty environment", flush=True)


def main() -> int:
    """Run the program; exit code 1 if something is wrong."""
    parser = argparse.ArgumentParser(description="Build the sdist and the wheels, and try them.")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="where to put them")
    dist = parser.parse_args().folder.absolute()
    # a program that has ended lets its helper finish a kernel, which may be written while the folder is removed
    with tempfile.TemporaryDirectory(prefix="assoc-dist-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        try:
            done = build(dist)
            check(done, folder)
        except WrongError as error:
            print(error, file=sys.stderr)
            return 1
    size, kernels = done.compiled.stat().st_size / 1e6, sum(name.endswith(".nbc") for name in done.kernels)
    print(f"Python {platform.python_version()}: {size:.2f} MB with {kernels} compiled kernels; wheel and sdist work")
    return 0


if __name__ == "__main__":
    sys.exit(main())

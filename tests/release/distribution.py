"""What is given away: sdist and wheel, built, looked through, installed into empty environments and tried.

    python -m tests.release.distribution      (make check-dist)

takes some minutes and a network (or an index that pip knows): each environment gets all dependencies anew, and
compiles the kernels it needs.
"""

from __future__ import annotations

import getpass
import os
import re
import socket
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

from tests.release.requirements import ROOT

_FOLDERS = ("assoc", "docs", "experiments", "tests")
_FILES = ("Makefile", "CHANGELOG.md", "CONTRIBUTING.md", "SECURITY.md", "README.md", "LICENSE", "pyproject.toml")
_ADDED = ("PKG-INFO", ".gitignore")
"""What the build adds to a source distribution."""
_PROGRAMS = ("assoc.simulate", "assoc.solve", "assoc.track", "assoc.sweep")

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


class WrongError(Exception):
    """Something is not as it should be."""


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
    files = {name for name in tracked() if name.startswith(tuple(f"{one}/" for one in _FOLDERS)) or name in _FILES}
    check_members(path, files | {*_ADDED})


def check_wheel(path: Path) -> None:
    """Check that a wheel holds the package and what describes it, no more."""
    about = f"{'-'.join(path.name.split('-')[:2])}.dist-info"
    files = {name for name in tracked() if name.startswith("assoc/")}
    check_members(path, files | {f"{about}/{one}" for one in ("METADATA", "WHEEL", "RECORD", "licenses/LICENSE")})


def run(*command: object, cwd: Path, **more: str) -> str:
    """Run a command that knows nothing of this tree.

    Raises
    ------
    WrongError
        It fails, or complains.
    """
    kept = {name: value for name, value in os.environ.items() if not re.match("PYTHON|NUMBA|VIRTUAL_ENV", name)}
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=cwd, env={**kept, **more}, capture_output=True, text=True, timeout=1200)
    if done.returncode:
        raise WrongError(f"{' '.join(words)[:200]}: exit code {done.returncode}: {done.stderr[-2000:]}")
    return done.stdout


def installed(archive: Path, folder: Path) -> Path:
    """Install an archive, with nothing but its dependencies, into an empty environment; its Python."""
    run(sys.executable, "-m", "venv", folder / "env", cwd=folder)
    python = folder / "env" / "bin" / "python"
    run(python, "-m", "pip", "install", "--quiet", archive, cwd=folder)
    run(python, "-m", "pip", "check", cwd=folder)
    return python


def smoke(python: Path, folder: Path, *, programs: bool) -> None:
    """Try what is installed, from an empty folder; with all programs, or their help alone."""
    place = folder / "empty"
    place.mkdir()
    strict = [python, "-W", "error", "-m"]
    run(python, "-W", "error", "-c", SMOKE, cwd=place)
    for program in _PROGRAMS:
        if f"python -m {program}" not in run(*strict, program, "--help", cwd=place):
            raise WrongError(f"{program} --help: does not say how it is called")
    if programs:
        run(*strict, "assoc.simulate", "three-radar", "-o", "scene.npz", cwd=place)
        run(*strict, "assoc.solve", "scene.npz", "--solver", "aco", "--scans", "0", "--json", "a.json", cwd=place)
        run(*strict, "assoc.solve", "scene.npz", "--scans", "0", "--csv", "a.csv", cwd=place)
        run(*strict, "assoc.track", "scene.npz", "-o", "tracks.csv", cwd=place)
        sweep = ["scene.npz", "--solver", "aco", "--grid", "ants=2,3", "--scans", "0", "-o", "study"]
        run(*strict, "assoc.sweep", *sweep, cwd=place)
        made = {path.name for path in place.iterdir()}
        if made != {"scene.npz", "a.json", "a.csv", "tracks.csv", "study"}:
            raise WrongError(f"the programs leave {sorted(made)}")


def main() -> int:
    """Run the program; exit code 1 if something is wrong."""
    with tempfile.TemporaryDirectory(prefix="assoc-dist-") as name:
        folder = Path(name)
        try:
            run(sys.executable, "-m", "build", "--outdir", folder / "dist", ROOT, cwd=folder)
            (sdist,) = (folder / "dist").glob("*.tar.gz")
            (wheel,) = (folder / "dist").glob("*.whl")
            check_sdist(sdist)
            # built from the sdist, not from the tree
            check_wheel(wheel)
            for archive in (wheel, sdist):
                place = folder / archive.suffix.strip(".")
                place.mkdir()
                smoke(installed(archive, place), place, programs=archive is wheel)
                print(f"{archive.name}: installs and works in an empty environment", flush=True)
        except WrongError as error:
            print(error, file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

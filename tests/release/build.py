"""Build what is given away: the sdist, a wheel of Python alone, and a wheel with compiled kernels.

    python -m tests.release.build FOLDER      (make dist; takes some minutes, most of them compiling)

The kernels are compiled in an empty environment into which the first wheel is installed, so by the numba that whoever
installs today gets. The second wheel is for this Python and this system. Both are built from the sdist, not the tree.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from typing import NamedTuple

from tests.release.requirements import ROOT

_KERNELS = ROOT / "tests" / "release" / "kernels.py"


class WrongError(Exception):
    """Something is not as it should be."""


class Built(NamedTuple):
    """What was built.

    Attributes
    ----------
    sdist : Path
    plain : Path
        The wheel for every system.
    compiled : Path
        The wheel with kernels.
    kernels : list of str
        Files that the wheel with kernels has more.
    """

    sdist: Path
    plain: Path
    compiled: Path
    kernels: list[str]


def run(*command: object, cwd: Path, **more: str) -> str:
    """Run a command that knows nothing of this tree; its standard output.

    Raises
    ------
    WrongError
        It fails, or complains.
    """
    kept = {name: value for name, value in os.environ.items() if not re.match("PYTHON|NUMBA|VIRTUAL_ENV", name)}
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=cwd, env={**kept, **more}, capture_output=True, text=True, timeout=3600)
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


def build(folder: Path) -> Built:
    """Build all into a folder."""
    with tempfile.TemporaryDirectory(prefix="assoc-build-") as name:
        place = Path(name)
        run(sys.executable, "-m", "build", "--outdir", place / "plain", ROOT, cwd=place)
        (sdist,) = (place / "plain").glob("*.tar.gz")
        (plain,) = (place / "plain").glob("*.whl")
        python, kernels = installed(plain, place), place / "kernels"
        run(python, _KERNELS, kernels, cwd=place)
        with tarfile.open(sdist) as archive:
            archive.extractall(place / "source", filter="data")
        (source,) = (place / "source").iterdir()
        how = ("-m", "build", "--wheel", "--outdir", place / "compiled")
        run(sys.executable, *how, source, cwd=place, ASSOC_KERNELS=str(kernels))
        (compiled,) = (place / "compiled").glob("*.whl")
        folder.mkdir(parents=True, exist_ok=True)
        done = [Path(shutil.move(path, folder / path.name)) for path in (sdist, plain, compiled)]
        added = [f"assoc/_kernels/{path.relative_to(kernels)}" for path in kernels.rglob("*") if path.is_file()]
    return Built(*done, added)


def main() -> int:
    """Run the program; exit code 1 if something fails."""
    parser = argparse.ArgumentParser(description="Build the sdist and the wheels.")
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="where to put them")
    try:
        done = build(parser.parse_args().folder)
    except WrongError as error:
        print(error, file=sys.stderr)
        return 1
    for path in done[:3]:
        print(f"{path}: {path.stat().st_size >> 10} KiB")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""What an installation takes on the disk, package by package, with and without the bytecode that pip makes.

Installs a wheel, such as one with compiled kernels (``make dist``), with its dependencies into an empty environment
(this needs a network, or an index that pip knows; nothing comes from pip's cache).
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from experiments.common.claims import Claim
from experiments.common.command import add_files, report

# bytes of each installed package, with and without bytecode; what came with the environment is left out
_WEIGH = """
import json
from importlib import metadata
sizes = {}
for one in metadata.distributions():
    files = [path for name in one.files or () if (path := one.locate_file(name)).is_file()]
    every = sum(path.stat().st_size for path in files)
    sizes[f"{one.name} {one.version}"] = every, every - sum(p.stat().st_size for p in files if p.suffix == ".pyc")
print(json.dumps({name: size for name, size in sizes.items() if name.split()[0] not in ("pip", "setuptools")}))
"""


def install(wheel: Path, folder: Path) -> str:
    """Install a wheel into an empty environment; its Python.

    Raises RuntimeError: It cannot be installed.
    """
    subprocess.run([sys.executable, "-m", "venv", folder], check=True)
    python = str(folder / "bin" / "python")
    command = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-cache-dir", str(wheel)]
    if subprocess.run(command, check=False).returncode:
        raise RuntimeError(f"{wheel} cannot be installed")
    return python


def weighed(python: str) -> list[Claim]:
    """What each package of an environment weighs, the largest first."""
    done = subprocess.run([python, "-c", _WEIGH], check=True, capture_output=True, text=True)
    sizes = sorted(json.loads(done.stdout).items(), key=lambda item: -item[1][0])
    kinds = enumerate(("installed", "without bytecode"))
    return [Claim(f"{kind}, {name}", "MB", ours=size[k] / 1e6) for k, kind in kinds for name, size in sizes]


def wheel_of(parser: argparse.ArgumentParser, wheel: Path) -> Path:
    """Return the wheel that a program was given, or end the program."""
    if not (wheel.suffix == ".whl" and wheel.is_file()):
        parser.error(f"{wheel} is no wheel, expected a file that ends with .whl")
    return wheel


def main(arguments: Sequence[str] | None = None) -> int:
    """Install, weigh, print and keep the sizes; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m experiments.installation", description="What an installation takes on the disk."
    )
    parser.add_argument("wheel", type=Path, metavar="WHEEL", help="what to install")
    add_files(parser, "installation")
    chosen = parser.parse_args(arguments)
    wheel = wheel_of(parser, chosen.wheel)
    with tempfile.TemporaryDirectory() as folder:
        claims = [Claim("wheel", "MB", ours=wheel.stat().st_size / 1e6), *weighed(install(wheel, Path(folder)))]
    report(chosen, claims, "installation", __doc__)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

"""Kernels that came with the package are taken where they fit, and give the bytes of those compiled here."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest
from llvmlite.binding import get_host_cpu_features

from assoc._system.numba_private import NEEDED
from tests.release.kernels import PROCESSOR, pack

_PROGRAM = """
import sys
from pathlib import Path
import numpy as np
from numba.core import event
from assoc._system import numba_private
from assoc.packing.kernels.matching import match
from assoc._system.kernels.sorting import ascending

numba_private.SHIPPED = Path(sys.argv[1])
seen = event.RecordingListener()
event.register("numba:compile", seen)
rng = np.random.default_rng(4)
rows = 60
found = [ascending(rng.normal(size=6000))]
found += match(np.arange(rows + 1) * 9, rng.integers(0, rows, rows * 9), np.exp(rng.normal(size=rows * 9)),
               np.full(rows, 2.0), np.full(rows, 2.1))
print(sum(1 for _, one in seen.buffer if one.is_start))
print(b"".join(np.asarray(part).tobytes() for part in found).hex())
"""

pytestmark = pytest.mark.skipif(
    not all(get_host_cpu_features().get(name, False) for name in NEEDED), reason="needs x86-64 with AVX2"
)


def solved(shipped: Path, cache: Path, **settings: str) -> tuple[int, str]:
    """Call two kernels in a new process; how many were compiled, and the bytes of the answer."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA")}
    command = [sys.executable, "-c", _PROGRAM, str(shipped)]
    environment = {**kept, "NUMBA_CACHE_DIR": str(cache), "ASSOC_INTERPRET": "0", **settings}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600, check=True)
    compiled, answer = done.stdout.split()
    return int(compiled), answer


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Kernels as a wheel ships them, and the bytes that they gave."""
    cache, folder = tmp_path_factory.mktemp("made"), tmp_path_factory.mktemp("kernels")
    compiled, answer = solved(Path("nowhere"), cache, **PROCESSOR)
    assert compiled
    pack(cache, [str(path) for path in cache.rglob("*.nbc")], folder)
    return folder, answer


def spoil_version(path: Path) -> None:
    if path.suffix == ".nbi":
        with open(path, "rb") as file:
            version = pickle.load(file)
            rest = file.read()
        path.write_bytes(pickle.dumps(f"{version}.1") + rest)


def spoil_code(path: Path) -> None:
    if path.suffix == ".nbc":
        path.write_bytes(path.read_bytes()[:-100])


@pytest.mark.slow
def test_nothing_is_compiled(made, tmp_path):
    folder, answer = made
    assert solved(folder, tmp_path) == (0, answer)
    assert not any(tmp_path.rglob("*.nb?"))


@pytest.mark.slow
def test_the_same_bytes_as_compiled_here(made, tmp_path):
    compiled, answer = solved(Path("nowhere"), tmp_path)
    assert compiled
    assert answer == made[1]


@pytest.mark.slow
@pytest.mark.parametrize("spoil", [spoil_version, spoil_code])
def test_what_does_not_fit_is_compiled(made, tmp_path, spoil):
    folder, answer = made
    other = tmp_path / "kernels"
    for path in folder.rglob("*.nb?"):
        copy = other / path.relative_to(folder)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
        spoil(copy)
    compiled, found = solved(other, tmp_path / "cache")
    assert compiled
    assert found == answer

"""Kernels that came with the package are taken where they fit, and give the bytes of those compiled here."""

import functools
import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest
from llvmlite.binding import get_host_cpu_features, parse_bitcode

from assoc._system.numba_private import NEEDED
from tests.release.kernels import PROCESSOR, pack

_PROGRAM = """
import sys
from pathlib import Path
import numpy as np
from numba.core import event
from assoc._system import numba_private
from assoc.packing.kernels.matching import match
from assoc.packing.kernels.sorting import ascending

numba_private.SHIPPED = Path(sys.argv[1])
seen = event.RecordingListener()
event.register("numba:compile", seen)
rng = np.random.default_rng(4)
rows = 60
found = [ascending(rng.normal(size=6000))]
if sys.argv[2] == "both":
    found += match(np.arange(rows + 1) * 9, rng.integers(0, rows, rows * 9), np.exp(rng.normal(size=rows * 9)),
                   np.full(rows, 2.0), np.full(rows, 2.1))
print(sum(1 for _, one in seen.buffer if one.is_start))
print(b"".join(np.asarray(part).tobytes() for part in found).hex())
"""

pytestmark = pytest.mark.skipif(
    not all(get_host_cpu_features().get(name, False) for name in NEEDED), reason="needs x86-64 with AVX2"
)


def solved(shipped: Path, cache: Path, what: str = "sorting", **settings: str) -> tuple[int, str]:
    """Call one kernel or both in a new process; how many were compiled, and the bytes of the answer."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA")}
    command = [sys.executable, "-c", _PROGRAM, str(shipped), what]
    environment = {**kept, "NUMBA_CACHE_DIR": str(cache), "ASSOC_INTERPRET": "0", **settings}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=600, check=True)
    compiled, answer = done.stdout.split()
    return int(compiled), answer


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Makes kernels as a wheel ships them, and the bytes that they gave."""

    @functools.cache
    def make(what):
        return _made(tmp_path_factory, what)

    return make


@pytest.fixture
def kernels(made):
    return made("sorting")


def _made(tmp_path_factory, what):
    cache, folder = tmp_path_factory.mktemp("made"), tmp_path_factory.mktemp("kernels")
    compiled, answer = solved(Path("nowhere"), cache, what, **PROCESSOR)
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
@pytest.mark.parametrize("what", ["both"])
def test_nothing_is_compiled(made, tmp_path, what):
    folder, answer = made(what)
    assert solved(folder, tmp_path, what) == (0, answer)
    assert not any(tmp_path.rglob("*.nb?"))


@pytest.mark.slow
@pytest.mark.parametrize("what", ["sorting", "both"])
def test_the_same_bytes_as_compiled_here(made, tmp_path, what):
    compiled, answer = solved(Path("nowhere"), tmp_path, what)
    assert compiled
    assert answer == made(what)[1]


@pytest.mark.slow
def test_a_kernel_that_is_compiled_here_takes_in_shipped_ones(made, tmp_path):
    folder, answer = made("both")
    for path in folder.rglob("*.nb?"):
        if not path.name.startswith("matching.match"):
            copy = tmp_path / "kernels" / path.relative_to(folder)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(path.read_bytes())
    compiled, found = solved(tmp_path / "kernels", tmp_path / "cache", "both")
    own = {path.name.split("-")[0] for path in (tmp_path / "cache").rglob("*.nbc")}
    assert compiled and own and all(name.startswith("matching.match") for name in own)
    assert found == answer


@pytest.mark.slow
def test_numbas_second_copy_has_no_names_of_local_values(made):
    files = [*made("both")[0].rglob("*.nbc")]
    assert files
    for path in files:
        (_, _, (_, bitcode)), *_ = pickle.loads(path.read_bytes())
        functions = [one for one in parse_bitcode(bitcode).functions if not one.is_declaration]
        values = [value for one in functions for block in one.blocks for value in (block, *block.instructions)]
        assert values and not any(value.name for value in values)


@pytest.mark.slow
@pytest.mark.parametrize("spoil", [spoil_version, spoil_code])
def test_what_does_not_fit_is_compiled(kernels, tmp_path, spoil):
    folder, answer = kernels
    other = tmp_path / "kernels"
    for path in folder.rglob("*.nb?"):
        copy = other / path.relative_to(folder)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
        spoil(copy)
    compiled, found = solved(other, tmp_path / "cache")
    assert compiled
    assert found == answer


@pytest.mark.slow
def test_a_processor_that_the_user_named_is_compiled_for(kernels, tmp_path):
    folder, answer = kernels
    compiled, found = solved(folder, tmp_path, NUMBA_CPU_NAME="generic")
    assert compiled
    assert found == answer

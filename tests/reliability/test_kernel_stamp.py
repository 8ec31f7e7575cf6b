"""Compiled code is kept as long as what the kernel can reach is the same, and no longer."""

import json
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import pytest

import assoc
from assoc._system.kernel_stamp import KernelStamp
from tests.reliability.test_processes import copied
from tests.running import printed
from tests.sizes import few_or_all

KERNEL = '''"""Kernels."""
from typing import Any

from assoc import helper
from assoc._system.compiled import njit
from assoc.helper import scale

OFFSET = 1.0


@njit
def shifted(pair: Any) -> float:
    """Scale and shift."""
    # as the paper does
    return scale(pair.first) + helper.SHIFT + OFFSET


@njit
def other(x: float) -> float:
    return x + 1.0
'''
HELPER = '''"""Helpers."""
from typing import NamedTuple

from assoc._system.compiled import njit

FACTOR = 2.0
SHIFT = 10.0
UNUSED = 5.0


class Pair(NamedTuple):
    first: float
    second: float


@njit
def scale(x):
    """Scale."""
    return FACTOR * x
'''
RUN = """
import json
from assoc.helper import Pair
from assoc.kernel import other, shifted
value = shifted(Pair(first=3.0, second=4.0)), other(1.0)
print(json.dumps([value, [sum(k.stats.cache_misses.values()) for k in (shifted, other)]]))
"""
NOTHING_NEW = (
    ("kernel", '"""Scale and shift."""', '"""Shift and\n    scale."""'),
    ("kernel", "OFFSET = 1.0", "# a comment\n\nOFFSET = 1.0"),
    ("kernel", "pair: Any", "pair: object"),
    ("helper", "UNUSED = 5.0", "UNUSED = 6.0"),
    ("helper", '"""Scale."""', '"""Make it larger."""'),
)
# one after another, with the value after each
NEW = {
    "callee in another file": ("helper", "FACTOR * x", "FACTOR * x * x", 29.0),
    "constant": ("kernel", "OFFSET = 1.0", "OFFSET = 2.0", 30.0),
    "constant of a callee": ("helper", "FACTOR = 2.0", "FACTOR = 3.0", 39.0),
    "constant of a module": ("helper", "SHIFT = 10.0", "SHIFT = 20.0", 49.0),
    "kind of a constant": ("helper", "FACTOR = 3.0", "FACTOR = 3", 49.0),
    "order of fields": ("helper", "first: float\n    second: float", "second: float\n    first: float", 49.0),
}


def run(folder: Path) -> list:
    variables = {"PYTHONPATH": folder, "PYTHONDONTWRITEBYTECODE": 1, "NUMBA_CACHE_DIR": ""}
    return json.loads(printed("-W", "error", "-c", RUN, cwd=folder, **variables))


def edit(folder: Path, file: str, before: str, after: str) -> None:
    path = folder / "assoc" / f"{file}.py"
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after, 1))


@pytest.fixture
def folder(tmp_path):
    folder = copied(tmp_path)
    (folder / "assoc" / "kernel.py").write_text(KERNEL)
    (folder / "assoc" / "helper.py").write_text(HELPER)
    return folder


@few_or_all("edits", 1, len(NEW))
def test_what_is_compiled_anew_after_an_edit(folder, edits):
    assert run(folder) == [[17.0, 2.0], [1, 1]]
    for one in NOTHING_NEW:
        edit(folder, *one)
    assert run(folder) == [[17.0, 2.0], [0, 0]]
    for name, (*one, value) in [*NEW.items()][:edits]:
        edit(folder, *one)
        assert run(folder) == [[value, 2.0], [1, 0]], name
    assert run(folder) == [[value, 2.0], [0, 0]]


def test_what_is_not_understood_takes_the_whole_package(folder):
    # a class of the package without fields, of which a constant is taken
    strange = "class Limits:\n    least = 1.0\n\n\nOFFSET = 1.0"
    edit(folder, "kernel", "OFFSET = 1.0", strange)
    edit(folder, "kernel", "+ OFFSET", "+ (OFFSET if Limits else 0.0)")
    code = (
        "from assoc._system.kernel_stamp import KernelStamp\nimport assoc.kernel as k\n"
        "assert 'whole package' in str(KernelStamp(k.shifted.py_func, {}))\n"
        "assert 'whole package' not in str(KernelStamp(k.other.py_func, {}))"
    )
    printed("-c", code, cwd=folder, PYTHONPATH=folder)


def test_all_kernels_of_the_package_are_understood():
    kernels = {}
    for found in walk_packages(assoc.__path__, "assoc."):
        if found.name.endswith("__main__") or found.name.startswith("assoc.integrations"):
            continue
        module = import_module(found.name)
        kernels |= {id(one): one.py_func for one in vars(module).values() if hasattr(one, "py_func")}
    stamps = [str(KernelStamp(one, {})) for one in kernels.values()]
    assert len(stamps) > 100 and len(set(stamps)) == len(stamps)
    assert not [one for one in stamps if "whole package" in one]

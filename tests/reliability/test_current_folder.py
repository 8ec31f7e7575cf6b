"""Data folders are not trusted: no program, and no process that is started, imports what lies in the current folder."""

import sys
from pathlib import Path

import pytest

from assoc.simulation import simulate
from tests.running import printed, process
from tests.sizes import sample

DEPENDENCIES = {"cloudpickle", "llvmlite", "numba", "numpy", "pandas", "rich", "scipy", "shtab"}
PLANTED = "import os, sys\nos.write(2, b'executed ' + __name__.encode() + b'\\n')\nos._exit(77)\n"
SWEEP = ["-m", "assoc.sweep", "scene.npz", "--solver", "greedy", "--repeats", "3", "-o", "study", "--jobs", "2"]
PLAIN = "import assoc\nif __name__ == '__main__':\n    {}\n"
ASSOCIATE = "print(len(assoc.associate(assoc.load('scene.npz'), jobs=2).scans))"
AHEAD = (
    "from assoc._system.compiled import compile_ahead, wait_for_kernels\n    from assoc._system.clock import is_over\n"
    "    from assoc._system.compile_time import compile_seconds\n    assert compile_ahead(is_over, compile_seconds)\n"
    "    from assoc._system import compiled\n    assert compiled._under_way[0].wait() == 0"
)
WAYS = {
    "solve, kernels compiled beside": ["-m", "assoc.solve", "scene.npz"],
    "solve, processes": ["-m", "assoc.solve", "scene.npz", "--solver", "greedy", "--jobs", "2"],
    "the command": [Path(sys.executable).with_name("assoc"), "solve", "scene.npz"],
    "sweep, processes": SWEEP,
    "library, processes": PLAIN.format(ASSOCIATE),
    "library, kernels compiled ahead": PLAIN.format(AHEAD),
}


@pytest.fixture
def data(tmp_path):
    folder = tmp_path / "data"
    folder.mkdir()
    simulate("three-radar", 2, scans=4).save(folder / "scene.npz")
    # `python -m` itself imports some modules of the standard library before the package
    (tmp_path / "probe.py").write_text("import sys\nprint(*sys.modules)")
    probe = printed("-m", "probe", cwd=tmp_path)
    for name in {*sys.stdlib_module_names, *DEPENDENCIES} - {*probe.split()}:
        (folder / f"{name}.py").write_text(PLANTED)
    return folder


@sample("way", WAYS, every=6)
def test_nothing_there_runs(data, way):
    words = WAYS[way]
    if isinstance(words, str):
        (data.parent / "script.py").write_text(words)
        words = [data.parent / "script.py"]
    done = process(*words, cwd=data, NUMBA_CACHE_DIR=data.parent / "cache", ASSOC_INTERPRET=1)
    assert "executed" not in done.stderr and done.returncode == 0, done.stderr

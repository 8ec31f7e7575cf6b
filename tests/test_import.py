"""`import assoc` is quick, its names are there, and the program `assoc.solve` stays out of it."""

import ast
import importlib
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import assoc
from tests.running import printed

SLOW = ("numba", "scipy", "pandas", "ortools", "rich", "numpy")


def test_import_loads_nothing_slow():
    loaded = printed("-W", "error", "-c", "import assoc, sys; print(*sys.modules)").split()
    assert not {name.split(".")[0] for name in loaded} & {*SLOW}


@pytest.mark.parametrize("module", ["assoc.simulate", "assoc.solve", "assoc.solvers"])
def test_programs_and_registry_load_no_compiler(module):
    code = f"import {module}, contextlib, io, sys\nimport assoc.solvers as s\n"
    code += "for name in s.names(): s.parameters(name)\n"
    if module == "assoc.solve":
        # with the options of a solver, which come from its parameters
        code += "with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.suppress(SystemExit):\n"
        code += "    assoc.solve.main(['--solver', 'aco', '--help'])\nassert '--alpha' in said.getvalue()\n"
    code += "print(*sys.modules)"
    loaded = {name.split(".")[0] for name in printed("-W", "error", "-c", code).split()}
    assert not loaded & {"numba", "scipy", "pandas", "ortools", "rich"}


def test_trackers_load_no_statistics():
    """They take as long to import as all else: a program that starts again is to go on within seconds."""
    assert "scipy.stats" not in printed("-W", "error", "-c", "import assoc.tracking, sys; print(*sys.modules)").split()


def test_public_names_resolve():
    for package in (assoc, assoc.plotting, importlib.import_module("assoc.plotting.report"), assoc.sweeps):
        assert {*package.__all__} <= {*dir(package)}
        assert all(getattr(package, name) is not None for name in package.__all__)
        # completion offers these and nothing else
        assert {name for name in dir(package) if not name.startswith("_")} <= {*package.__all__}
    with pytest.raises(AttributeError, match="no attribute 'solve_everything'"):
        assoc.solve_everything  # noqa: B018


def test_no_files_import_each_other_in_a_circle():
    """Imports inside functions and for types alone count, too."""
    root = Path(assoc.__file__).parents[1]
    files = {
        ".".join(path.relative_to(root).with_suffix("").parts): path
        for path in root.glob("assoc/**/*.py")
        if path.name != "__init__.py"
    }
    graph = {}
    for name, path in files.items():
        imports = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.ImportFrom)]
        found = {f"{one.module}.{alias.name}" for one in imports for alias in one.names}
        graph[name] = (found | {one.module for one in imports}) & files.keys() - {name}
    assert sum(map(len, graph.values())) > 1000
    TopologicalSorter(graph).prepare()

"""The pages agree with the code: rooms and paths exist, API targets import, README's figures come from the CSV."""

import ast
import re
import shlex
import shutil
import tomllib
from dataclasses import fields
from functools import reduce
from glob import glob
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from types import FunctionType

import pandas as pd
import pytest

import assoc
from assoc import solvers
from assoc._version import __version__ as version
from assoc.recordings import read_plots
from experiments.benchmarks import markdown, rows
from tests.recordings.test_arrivals import quakes

ROOT = Path(__file__).parents[1]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md", "SECURITY.md", "paper.md")),
    *sorted(path for path in (ROOT / "docs").rglob("*.md") if "_build" not in path.parts),
]
ARCHITECTURE = ROOT / "docs" / "architecture.md"
NAMES = [str(path.relative_to(ROOT)) for path in PAGES]


def rooms() -> list[str]:
    """Folders (``solvers/``) and modules (``errors.py``) at the top of the package."""
    top = ROOT / "assoc"
    folders = [f"{path.parent.name}/" for path in top.glob("*/__init__.py")]
    modules = [path.name for path in top.glob("*.py") if not path.name.startswith("__")]
    return sorted(folders + modules)


def house() -> str:
    """The plan on the page: its first block of code."""
    text = ARCHITECTURE.read_text(encoding="utf-8")
    return text.split("```")[1]


@pytest.mark.parametrize("room", rooms())
def test_every_room_is_in_the_plan_of_the_house(room):
    assert re.search(rf"(?<![\w/]){re.escape(room)}(?!\w)", house()), f"docs/architecture.md: {room} is missing"


@pytest.mark.parametrize("page", NAMES)
def test_paths_on_the_pages_exist(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    paths = re.findall(r"(?<![\w/.-])(?:assoc|experiments|tests)/[\w/.]*\w/?", text)
    for path in paths:
        assert (ROOT / path).exists(), f"{page}: {path} does not exist"


def test_kernels_take_at_most_eight_arguments():
    wide = []
    for path in (ROOT / "assoc").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and any("njit" in ast.unparse(d) for d in node.decorator_list):
                wide += [f"{path}: {node.name}"] * (len(node.args.args) > 8)
    assert wide == []


def test_paths_of_the_architecture_exist():
    heads = "|".join(re.escape(room.rstrip("/")) for room in rooms() if room.endswith("/"))
    text = ARCHITECTURE.read_text(encoding="utf-8")
    paths = re.findall(rf"`((?:{heads})/[\w/.]*)`", text)
    assert len(paths) > 50
    for path in paths:
        assert "NAME" in path or (ROOT / "assoc" / path).exists(), f"docs/architecture.md: {path} does not exist"


@pytest.mark.parametrize("page", NAMES)
def test_modules_on_the_pages_exist(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for name in re.findall(r"python\s+-m\s+((?:assoc|experiments|tests)[\w.]*\w)", text):
        assert find_spec(name) is not None, f"{page}: python -m {name} does not exist"


@pytest.mark.parametrize("page", NAMES)
def test_links_lead_somewhere(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#\s]+)", text):
        if "://" not in target:
            assert ((ROOT / page).parent / target).exists(), f"{page}: {target} does not exist"


def test_every_page_is_in_a_list_of_contents():
    listed = set()
    for page in PAGES:
        for block in re.findall(r"```\{toctree\}(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
            lines = [line.strip() for line in block.splitlines() if line.strip() and not line.startswith(":")]
            listed |= {(page.parent / f"{line}.md").resolve() for line in lines}
    pages = {path for path in PAGES if path.parent not in (ROOT, ROOT / "docs" / "_tables")}
    assert pages - listed == {ROOT / "docs" / "index.md"}


def targets() -> list[str]:
    """What the API pages let autodoc describe."""
    found = []
    for path in sorted((ROOT / "docs" / "api").glob("*.md")):
        found += re.findall(r"\.\. auto\w+:: ([\w.]+)", path.read_text(encoding="utf-8"))
    return found


@pytest.mark.parametrize("target", targets())
def test_what_the_api_pages_describe_can_be_imported(target):
    module, _, name = target.rpartition(".")
    if module.startswith("assoc.integrations.stonesoup"):
        pytest.importorskip("stonesoup")
    if module == "assoc.plotting":
        pytest.importorskip("matplotlib")
    assert getattr(import_module(module), name).__doc__


def used(page: str) -> set[str]:
    """Names of the package on a page: those in its text, and those that its code imports."""
    text = (ROOT / page).read_text(encoding="utf-8")
    names = set(re.findall(r"`(assoc(?:\.\w+)+)", text))
    for block in re.findall(r"```(?:python|\{code-cell\})\n(.*?)```", text, re.DOTALL):
        for node in ast.walk(ast.parse(re.sub(r"^:.*$", "", block, flags=re.MULTILINE))):
            if isinstance(node, ast.ImportFrom) and f"{node.module}.".startswith("assoc."):
                names |= {f"{node.module}.{one.name}" for one in node.names}
    return {name for name in names if "._" not in name}


@pytest.mark.parametrize("page", [name for name in NAMES if used(name)])
def test_what_the_pages_use_is_on_the_api_pages(page):
    described = [value_of(target) for target in targets() if can_import(target)]
    for name in filter(can_import, sorted(used(page))):
        value, owner = value_of(name), value_of(name.rpartition(".")[0])
        if isinstance(value, type | FunctionType):
            assert value in described or owner in described, f"{page}: {name} is on no page of docs/api"


def can_import(name: str) -> bool:
    """Whether the extra that a name needs is installed."""
    extra = {"assoc.plotting": "matplotlib", "assoc.integrations.stonesoup": "stonesoup"}
    return all(find_spec(needed) for start, needed in extra.items() if f"{name}.".startswith(f"{start}."))


def value_of(name: str) -> object:
    """The object of a dotted name.

    Raises AttributeError: There is none.
    """
    parts = name.split(".")
    cut = next(n for n in range(len(parts), 0, -1) if find_spec_of(parts[:n]))
    return reduce(getattr, parts[cut:], import_module(".".join(parts[:cut])))


def defaults() -> list[tuple[str, str, str]]:
    """Solver, parameter and default as docs/solvers.md gives them."""
    text = (ROOT / "docs" / "solvers.md").read_text(encoding="utf-8")
    found = []
    for section in text.split("\n## ")[1:]:
        name = section.split()[0]
        if name in solvers.names():
            pairs = re.findall(r"`(\w+)` \(([\d.e-]*\d)", section)
            found += [(name, parameter, value) for parameter, value in pairs]
    return found


@pytest.mark.parametrize(("solver", "parameter", "value"), defaults())
def test_defaults_on_the_page_of_solvers(solver, parameter, value):
    known = {field.name: field.default for field in fields(solvers.parameters(solver))}
    assert known[parameter] == float(value)


@pytest.mark.parametrize("page", NAMES)
def test_names_on_the_pages_exist(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    for name in filter(can_import, set(re.findall(r"`(assoc(?:\.\w+)+)", text))):
        value_of(name)


def find_spec_of(parts: list[str]) -> bool:
    """Whether there is a module of that name."""
    try:
        return find_spec(".".join(parts)) is not None
    except ModuleNotFoundError:
        return False


def test_the_example_of_an_own_sensor_runs(capsys):
    text = (ROOT / "docs" / "own_sensor.md").read_text(encoding="utf-8")
    cells = "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))
    exec(compile(cells, "own_sensor.md", "exec", dont_inherit=True), {"__name__": "page"})
    assert "[10." in capsys.readouterr().out


def test_the_example_of_an_own_solver_runs(capsys):
    text = (ROOT / "docs" / "own_solver.md").read_text(encoding="utf-8")
    cells = "\n".join(re.findall(r"```\{code-cell\}\n(.*?)```", text, re.DOTALL))
    exec(compile(cells, "own_solver.md", "exec", dont_inherit=True), {"__name__": "page"})
    assert "annealing" in capsys.readouterr().out
    # the benchmark's row is of the same code
    code = (ROOT / "experiments" / "common" / "annealing.py").read_text(encoding="utf-8")
    assert code[code.index("@dataclass") : code.index("\n\n\ndef make_known")] in cells


@pytest.mark.parametrize("page", ["README.md", "paper.md"])
def test_tables_are_those_of_the_benchmark(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    measured = rows.load(ROOT / "docs" / "benchmarks.csv")
    assert markdown.insert(text, measured) == text, "run python -m experiments.benchmarks --report-only"


def test_the_paper_has_figures_of_our_tables_and_cites_what_it_lists():
    paper, works = ((ROOT / name).read_text(encoding="utf-8") for name in ("paper.md", "paper.bib"))
    tables = " ".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "_tables").glob("*.md"))
    found = re.findall(r"(?<![\w.])\d+\.\d+\b", paper.split(markdown.END)[1])
    assert (
        len(found) > 5 and [one for one in found if not re.search(rf"(?<![\d.]){re.escape(one)}(?!\d)", tables)] == []
    )
    assert set(re.findall(r"@(\w+\d{4}|ortools)", paper)) == set(re.findall(r"^@\w+\{(\w+),", works, re.MULTILINE))


def test_the_version_stands_in_one_place():
    assert f'"{version}"' not in (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    assert "version: 0" not in (ROOT / "CITATION.cff").read_text(encoding="utf-8")


@pytest.mark.parametrize("path", sorted((ROOT / ".github").rglob("*.yml")), ids=lambda path: path.name)
def test_workflows_call_the_makefile(path):
    yaml = pytest.importorskip("yaml")
    text, makefile = (one.read_text(encoding="utf-8") for one in (path, ROOT / "Makefile"))
    content = yaml.safe_load(text)
    called = set(re.findall(r"make ([\w-]+)", text))
    assert called <= set(re.findall(r"^([\w-]+):", makefile, re.MULTILINE))
    assert called if "jobs" in content else content["body"]


def test_the_conda_recipe_has_our_version_and_requirements():
    yaml, jinja2 = pytest.importorskip("yaml"), pytest.importorskip("jinja2")
    here = ROOT / "conda"

    def data(path, from_recipe_dir):
        return tomllib.loads((here / path).read_text(encoding="utf-8"))

    def regex(path, pattern, from_recipe_dir):
        return re.search(pattern, (here / path).read_text(encoding="utf-8"))

    recipe = jinja2.Template((here / "meta.yaml").read_text(encoding="utf-8"), undefined=jinja2.StrictUndefined)
    found = yaml.safe_load(recipe.render(load_file_data=data, load_file_regex=regex, PYTHON="python"))
    assert found["package"]["version"] == version
    ours = data("../pyproject.toml", True)
    named = [
        one.replace("ortools", "ortools-python").replace(">=", " >=", 1) for one in ours["project"]["dependencies"]
    ]
    python = "python " + ours["project"]["requires-python"]
    assert found["requirements"]["run"] == [python, *named]
    built = [one.replace(">=", " >=") for one in ours["build-system"]["requires"]]
    assert found["requirements"]["host"] == [python, "pip", *built]
    assert found["build"]["entry_points"] == [" = ".join(one) for one in ours["project"]["scripts"].items()]


def test_the_page_of_stability_names_what_is_public():
    text = (ROOT / "docs" / "stability.md").read_text(encoding="utf-8")
    for name in re.findall(r"`([A-Za-z_]\w*)`", text.partition("| scenes and sensors")[0].partition("|---|")[2]):
        assert hasattr(assoc, name), name


def program(name: str):
    """The module of a program: assoc's own `main` would change what signals do in this process."""
    return import_module(f"assoc.{name}")


def commands(page: str) -> list[list[str]]:
    """Commands of a page: indented lines that begin with assoc or python -m assoc; words of each."""
    text = (ROOT / page).read_text(encoding="utf-8")
    lines = re.findall(r"^    (?:python -m assoc\.|assoc )(\w+ .+)$", text, re.MULTILINE)
    return [shlex.split(line, comments=True) for line in lines]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """A folder with the files that pages' commands read."""
    folder = tmp_path_factory.mktemp("inputs")

    def run(*words):
        assert program(words[0]).main([*words[1:-1], str(folder / words[-1])]) == 0

    run("simulate", "three-radar", "--scans", "4", "-o", "scene.npz")
    run("simulate", "rotating-radar", "--duration", "120", "-o", "plots.csv")
    first = "docs/from_files.md"
    for words in commands(first):
        if words[0] == "simulate":
            run(*words)
    toml = re.search(r"```toml\n(.*?)```", (ROOT / first).read_text(encoding="utf-8"), re.DOTALL)
    (folder / "radars.toml").write_text(toml[1], encoding="utf-8")
    flights = (ROOT / "docs" / "tutorials" / "7_real_flights.md").read_text(encoding="utf-8")
    names: dict[str, object] = {}
    exec(re.search(r"```\{code-cell\}\n(.*?)```", flights, re.DOTALL)[1], names)
    names["flights"].to_csv(folder / "flights.csv", index=False)
    own = (ROOT / "docs" / "own_solver.md").read_text(encoding="utf-8")
    cells = re.findall(r"```\{code-cell\}\n(.*?)```", own, re.DOTALL)
    (folder / "mine.py").write_text(next(cell for cell in cells if "register(" in cell), encoding="utf-8")
    Path(quakes(folder)[0]).rename(folder / "stations.csv")
    (folder / "day").mkdir()
    pd.read_csv(folder / "plots.csv").to_parquet(folder / "day" / "1.parquet")
    if find_spec("asterix"):
        from assoc.integrations.asterix import write_plots

        write_plots(folder / "radars.pcap", read_plots(folder / "plots.csv"), (25, 201))
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("page", [name for name in NAMES if commands(name)])
def test_commands_of_the_pages_run(page, inputs, tmp_path, monkeypatch, capsys):
    """As printed, one after the other, but for fewer scans and runs."""
    pytest.importorskip("plotly")
    shutil.copytree(inputs, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    for words in commands(page):
        if words[1].endswith(".pcap") and not find_spec("asterix"):
            continue
        # no page makes an old study
        if words[:2] == ["sweep", "import"]:
            continue
        if words[:2] == ["simulate", "three-radar"]:
            words += ["--scans", "4"]
        if words[0] == "sweep" and words[1] != "compare" and "--summary" not in words:
            words += ["--scans", "0"]
            for flag, fewer in (("--repeats", "2"), ("--tune", "4")):
                if flag in words:
                    words[words.index(flag) + 1] = fewer
        # as a shell does
        words = [name for word in words for name in (sorted(glob(word)) if "*" in word else [word])]
        assert program(words[0]).main(words[1:]) == 0, (words, capsys.readouterr().err)


@pytest.mark.parametrize(
    ("page", "section"),
    [("ant_colony", "## Equations 7 to 11"), ("own_loop", "# Only the assignment")],
)
def test_python_of_the_pages_runs(page, section, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
    names: dict[str, object] = {}
    blocks = re.findall(r"```python\n(.*?)```", text[text.index(section) :], re.DOTALL)
    assert blocks
    for block in blocks:
        exec(block, names)
    if page == "own_loop":
        assert names["lost"].tolist() == [2] and names["new"].tolist() == [] and names["again"].cost == -15.0
    if page == "live":
        assert (tmp_path / "radars.npz").exists()

"""The compiled kernels that a wheel ships: made for any x86-64 processor with AVX2, for this Python and this numba.

    python tests/release/kernels.py FOLDER      (a part of make dist; takes some minutes)

compiles what the usual road calls (simulate, solve, kbest, marginals, track, live, sweep, by default settings) with the
``assoc`` that this Python imports, into an empty cache. A second process goes the same road, must compile nothing, and
tells which of the files it read: those are the kernels called from Python, and they alone are copied to FOLDER. What a
kernel calls itself is a part of its code. FOLDER has the folders of the package, with numba's own files in them.
"""

import contextlib
import io
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

PROCESSOR = {"NUMBA_CPU_NAME": "x86-64-v3", "NUMBA_CPU_FEATURES": ""}
"""What the kernels are compiled for; ``assoc/_system/numba_private.py`` says the same."""

_SCENES = {
    "radars": ("three-radar", "--scans", "12"),
    "crowd": ("crowd",),
    "crowd-radars": ("crowd", "--sensor", "radar", "--targets", "20", "--scans", "5"),
    "bearings": ("bearing-only", "--targets", "12", "--scans", "2"),
    "uav": ("dubins-uav",),
}
_SOLVERS = ("greedy", "exact", "aco", "genetic", "tabu", "lagrangian")
_TRACKERS = ("multi-sensor", "static", "mht", "mht-hypothesis", "nearest-neighbour", "joint-probabilistic")
_FILTERS = ("imm-cv", "ekf", "modified-ekf", "ukf", "imm")
_PLOT_FILTERS = ("ekf", "ukf")

RADARS = """
[[radar]]
name = "north"
file = "north.csv"
place = [47.5, 8.0, 0.0]
noise = [150.0, 0.1]

[[radar]]
name = "south"
file = "south.csv"
place = [46.8, 8.6, 0.0]
noise = [150.0, 0.1]
"""
"""A radars.toml of the plots that `OF_RADARS` simulates."""
_RADAR = ("simulate", "rotating-radar", "--duration", "90", "--range-step", "0.25")
OF_RADARS = (
    (*_RADAR, "--latitude", "47.5", "--longitude", "8", "-o", "north.csv"),
    (*_RADAR, "--latitude", "46.8", "--longitude", "8.6", "-o", "south.csv"),
    ("track", "radars.toml", "--map", "map.kml", "-o", "radars.csv"),
    ("live", "radars.toml", "--replay", "0", "--page", "0", "--state", "live.npz", "-o", "live.csv"),
)


def usual_road() -> Iterator[tuple[str, ...]]:
    """The programs' command lines, in the order in which each finds the files it reads."""
    for name, words in _SCENES.items():
        yield ("simulate", *words, "-o", f"{name}.npz")
    yield ("simulate", "rotating-radar", "--duration", "300", "-o", "plots.csv")
    for name in _SCENES:
        for solver in _SOLVERS:
            yield ("solve", f"{name}.npz", "--solver", solver)
        yield ("solve", f"{name}.npz", "--time-limit", "5", "--scans", "0")
        yield ("solve", f"{name}.npz", "--kbest", "3", "--scans", "0")
    yield ("solve", "radars.npz", "--solver", "aco", "--mode", "paper", "--scans", "0:2")
    for tracker in _TRACKERS:
        for name in ("radars", "crowd-radars", "uav"):
            yield ("track", f"{name}.npz", "--tracker", tracker, "-o", f"{name}-{tracker}.csv")
    for choice in _FILTERS:
        yield ("track", "radars.npz", "--filter", choice, "-o", f"{choice}.csv")
    for choice in _PLOT_FILTERS:
        yield ("track", "plots.csv", "--filter", choice, "-o", f"plots-{choice}.csv")
    for tracker in ("nearest-neighbour", "mht-hypothesis"):
        yield ("track", "plots.csv", "--tracker", tracker, "-o", f"plots-{tracker}.csv")
    yield from OF_RADARS
    # the same without altitudes: heights by slant ranges alone
    for name in ("north.csv", "south.csv"):
        rows = Path(name).read_text().splitlines()
        Path(name).write_text("\n".join(",".join(row.split(",")[:3]) for row in rows))
    yield ("track", "radars.toml", "-o", "heights.csv")
    yield ("simulate", "rotating-radars", "--duration", "60", "-o", "turning.npz")
    yield ("track", "turning.npz", "-o", "turning.csv")
    yield ("live", "turning.npz", "--turns", "4,5,5.5", "--replay", "0", "-o", "turning-live.csv")
    yield ("sweep", "radars.npz", "--solver", "aco", "exact", "--grid", "aco.ants=2,3", "--scans", "0:2", "-o", "study")


def go() -> None:
    """Go the usual road in this process; prints how often the compiler was asked, and the data files that it read.

    Raises
    ------
    RuntimeError
        A program fails.
    """
    import importlib

    from numba.core import event

    Path("radars.toml").write_text(RADARS)
    read: set[str] = set()

    def note(what: str, arguments: Any) -> None:
        # those that are written get their names when they are complete
        if what == "open" and isinstance(arguments[0], str) and arguments[0].endswith(".nbc"):
            read.add(arguments[0])

    sys.addaudithook(note)
    compiled = event.RecordingListener()
    event.register("numba:compile", compiled)
    with contextlib.redirect_stdout(io.StringIO()):
        for program, *words in usual_road():
            code = importlib.import_module(f"assoc.{program}").main(words)
            if code:
                raise RuntimeError(f"{program} {' '.join(words)}: exit code {code}")
        import assoc

        scene = assoc.Scene.load("radars.npz")
        assoc.marginals(assoc.build_problem(scene, 0))
        assoc.associate(scene)
        assoc.warm_up()
    print(sum(1 for _, one in compiled.buffer if one.is_start))
    for name in sorted(read):
        print(name)


def pack(cache: Path, names: list[str], folder: Path) -> None:
    """Copy the named data files of a cache, and what their index files say of them."""
    from numba.core import caching, serialize

    import assoc

    package = Path(assoc.__file__).resolve().parent
    wanted = {Path(name) for name in names}
    for source in sorted({package, *(path.parent for path in package.rglob("*.py"))}):
        place = cache / caching.UserProvidedCacheLocator.get_suitable_cache_subpath(str(source / "any.py"))
        target = folder / source.relative_to(package)
        for index in sorted(place.glob("*.nbi")):
            with open(index, "rb") as file:
                version = pickle.load(file)
                stamp, overloads = pickle.loads(file.read())
            kept = {key: name for key, name in overloads.items() if place / name in wanted}
            if not kept:
                continue
            target.mkdir(parents=True, exist_ok=True)
            content = pickle.dumps(version, protocol=-1) + serialize.dumps((stamp, kept))
            (target / index.name).write_bytes(content)
            for name in kept.values():
                library, *about, _, reload_init, environments = pickle.loads((place / name).read_bytes())
                mangled, kind, (machine_code, bitcode) = library
                library = mangled, kind, (machine_code, _without_names(bitcode))
                # the text with types, which only numba's inspect_types shows, is longer than the code
                parts = (library, *about, "", reload_init, environments)
                (target / name).write_bytes(serialize.dumps(parts))


def _without_names(bitcode: bytes) -> bytes:
    """Return a module of LLVM's without the names of local values, which are more than half of it.

    Beside the machine code, numba keeps what it takes to compile a kernel into another one that calls it.
    """
    from llvmlite import binding

    module = binding.parse_bitcode(bitcode)
    for function in module.functions:
        for argument in function.arguments:
            argument.name = ""
        for block in function.blocks:
            block.name = ""
            for instruction in block.instructions:
                instruction.name = ""
    return bytes(module.as_bitcode())


def _road(cache: Path) -> tuple[int, list[str]]:
    """Go the road in a new process with a cache; how much it compiled, and the files it read."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA")}
    # Intel's library of functions would be missing where it is not installed
    own = {**PROCESSOR, "NUMBA_CACHE_DIR": str(cache), "NUMBA_DISABLE_INTEL_SVML": "1", "ASSOC_INTERPRET": "0"}
    with tempfile.TemporaryDirectory() as place:
        command = [sys.executable, str(Path(__file__).resolve()), "--road"]
        done = subprocess.run(command, cwd=place, env={**kept, **own}, stdout=subprocess.PIPE, text=True, check=True)
    count, *names = done.stdout.splitlines()
    return int(count), names


def main() -> int:
    """Run the program; exit code 1 if something was compiled that had been compiled before."""
    if sys.argv[1] == "--road":
        go()
        return 0
    folder = Path(sys.argv[1]).absolute()
    with tempfile.TemporaryDirectory() as name:
        cache = Path(name)
        compiled, _ = _road(cache)
        print(f"kernels compiled: {compiled}", flush=True)
        compiled, names = _road(cache)
        pack(cache, names, folder)
    size = sum(path.stat().st_size for path in folder.rglob("*.nb?"))
    print(f"kernels called from Python: {len(names)}, {size >> 10} KiB")
    return 1 if compiled else 0


if __name__ == "__main__":
    sys.exit(main())

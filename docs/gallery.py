"""All pictures of the documentation, drawn again: ``python -m docs.gallery [NAME ...] [-o docs/images]``.

Pictures are of fixed scenes and seeds. They have two pixels for each
of a plain screen, so that they are sharp on good ones. Only the report's screenshot shows measured times.
"""

import argparse
import io
import shutil
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import assoc
from assoc._files.output import write_atomically
from assoc.plotting.study_figures import new_figure
from assoc.simulation import simulate

FOLDER = Path(__file__).parent / "images"
LARGEST = 250_000
"""Bytes that a picture may take."""
DPI = 180
"""Twice what a page shows."""

_COLOURS = 256


@cache
def _radars() -> tuple[assoc.Scene, assoc.Association]:
    scene = simulate("three-radar", 0)
    return scene, assoc.associate(scene, "aco")


def first_sight(figure: Any) -> None:
    """Draw what goes in and what comes out: plots of three sensors, and which of them are one target."""
    from assoc.plotting import plot_scene, plot_solution

    figure.set_size_inches(9, 4.9)
    made = simulate("crowd", 4, targets=12, width=2_000.0, height=1_000.0, noise=50.0, false_alarms_per_target=0.3)
    # the truth is not known to the package either
    scene = assoc.Scene(made.sensors, made.times, made.measurements, made.region)
    scan = assoc.associate(scene).scans[0]
    left, right = figure.subplots(1, 2)
    plot_scene(scene, 0, ax=left).set_title("in: what three sensors measured")
    alone = int((scan.solution.tuples > 0).sum(axis=1).tolist().count(1))
    found = f"{scan.solution.num_targets} targets, {alone} false alarms"
    plot_solution(scene, scan, ax=right).set_title(f"out: {found}, {scan.solution.status}")
    for ax in (left, right):
        ax.set(xlim=(-0.2, 2.2), ylim=(-0.2, 2.2))
    left.get_legend().remove()


def scene(figure: Any) -> None:
    """Draw what three radars see in 100 scans."""
    from assoc.plotting import plot_scene

    plot_scene(_radars()[0], ax=figure.subplots())


def solution(figure: Any) -> None:
    """Draw one scan associated, and one target of it from near."""
    from assoc.plotting import plot_solution

    figure.set_size_inches(11, 5.2)
    left, right = figure.subplots(1, 2)
    scene, association = _radars()
    plot_solution(scene, association.scans[50], ax=left).set_title("scan 50")
    plot_solution(scene, association.scans[50], target=0, ax=right).set_title("its first target")
    left.get_legend().remove()


def ghosts(figure: Any) -> None:
    """Draw three bearing sensors, whose lines of sight cross where nobody is."""
    from assoc.plotting import plot_solution

    scene = simulate("bearing-only", 0, targets=8, scans=1)
    plot_solution(scene, assoc.associate(scene, "exact").scans[0], ax=figure.subplots())


def convergence(figure: Any) -> None:
    """Draw cost and bound of two searches on a hard problem, which neither of them closes."""
    from assoc.plotting import plot_convergence

    problem = assoc.build_problem(simulate("bearing-only", 0, targets=60, scans=1), 0)
    limits: dict[str, dict[str, int]] = {"lagrangian": {"iterations": 40}, "tabu": {"iterations": 100}}
    found = {name: assoc.assign(problem, name, seed=0, **limit) for name, limit in limits.items()}
    plot_convergence(found, ax=figure.subplots())


def pheromone(figure: Any) -> None:
    """Draw what the ants of the paper see, how they agree on a tour, and what both say of the next draw."""
    from assoc.plotting import plot_pheromone
    from assoc.solvers import pheromone

    problem = assoc.build_problem(simulate("crowd", 0, targets=8, scans=1), 0)
    figure.set_size_inches(7, 8.4)
    history = pheromone(problem, mode="paper", rho=0.9)
    for axes, of in zip(figure.subplots(3), ("visibility", "pheromone", "probability"), strict=True):
        plot_pheromone(history, of=of, nodes=12, ax=axes)
        axes.set(xlabel="cycle (number)" if of == "probability" else "", ylabel="tuple")
        # one for the three, where it is in nothing's way
        axes.legend(loc="lower left", fontsize=8) if of == "visibility" else axes.get_legend().remove()


def tracks(figure: Any) -> None:
    """Draw the tracks that a multi-sensor tracker makes of the radars' scene, over the truth."""
    from assoc.plotting import plot_tracks
    from assoc.tracking import MultiSensorTracker, track_scene

    scene = _radars()[0]
    table, _ = track_scene(MultiSensorTracker.for_scene(scene), scene)
    plot_tracks(table.to_frame(), scene, ax=figure.subplots())


_DRAWN = (first_sight, scene, solution, ghosts, convergence, pheromone, tracks)
PICTURES: dict[str, Callable[[Any], None]] = {draw.__name__.replace("_", "-"): draw for draw in _DRAWN}


def drawn(draw: Callable[[Any], None]) -> bytes:
    """Return a picture as a small PNG."""
    figure = new_figure()
    figure.set_size_inches(7, 5.6)
    draw(figure)
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=DPI, metadata={"Software": None})
    return small(content.getvalue())


def small(picture: bytes) -> bytes:
    """Return the same PNG in fewer bytes, with fewer colours only where it must be."""
    from PIL import Image

    content = io.BytesIO()
    image = Image.open(io.BytesIO(picture)).convert("RGB")
    image.save(content, format="png", optimize=True)
    if content.tell() > LARGEST:
        content = io.BytesIO()
        image.quantize(_COLOURS, dither=Image.Dither.NONE).save(content, format="png", optimize=True)
    return content.getvalue()


def screenshot() -> bytes | None:
    """Return a picture of a report in headless Chromium; None where that is missing."""
    if not (shutil.which("chromium") and shutil.which("chromedriver")):
        return None
    from assoc.plotting.report import write_association_report
    from tests.browser import opened, show

    scene, association = _radars()
    with tempfile.TemporaryDirectory() as folder, opened() as browser:
        page = Path(folder) / "report.html"
        words = ["scene.npz", "--solver", "aco", "--report", "report.html"]
        write_association_report(page, association, scene, ["scene.npz"] * len(association.scans), words=words)
        show(browser, page, (1100, 1150), scale=2)
        browser.execute_script("Plotly.animate('scene-0', ['50'], {mode: 'immediate', frame: {duration: 0}})")
        time.sleep(0.5)
        return small(browser.get_screenshot_as_png())


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw the pictures named, or all."""
    parser = argparse.ArgumentParser(
        prog="python -m docs.gallery", description="Draw the pictures of the documentation again."
    )
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help=f"pictures to draw (default: all): {', '.join([*PICTURES, 'report'])}"
    )
    parser.add_argument(
        "-o", "--output", type=Path, default=FOLDER, metavar="FOLDER", help="where to write them (default docs/images)"
    )
    given = parser.parse_args(arguments)
    names = given.names or [*PICTURES, "report"]
    for name in names:
        if name not in (*PICTURES, "report"):
            parser.error(f"no picture is called {name!r}")
    given.output.mkdir(parents=True, exist_ok=True)
    for name in names:
        picture = screenshot() if name == "report" else drawn(PICTURES[name])
        if picture is None:
            print(f"{name:<20} left out: chromium and chromedriver are not installed")
            continue
        if len(picture) > LARGEST:
            raise SystemExit(f"{name}: {len(picture)} bytes, more than {LARGEST}")
        write_atomically(given.output / f"{name}.png", lambda file, content=picture: file.write(content))
        print(f"{name:<20} {len(picture) / 1e3:6.1f} kB")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

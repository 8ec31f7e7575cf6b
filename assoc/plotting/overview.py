"""Four plots of an association: the scene, a scan, its candidates, and the solver's convergence."""

from __future__ import annotations

from typing import Any

from assoc._system.imports import load_extra
from assoc._system.wrong_types import explains_wrong_types
from assoc.association.association import Association
from assoc.costs import build_problem
from assoc.errors import InvalidInputError
from assoc.plotting.convergence import plot_convergence
from assoc.plotting.costs import belongs, plot_costs
from assoc.plotting.scene import plot_scene
from assoc.plotting.solution import plot_solution
from assoc.scene.scene import Scene


@explains_wrong_types
def plot_overview(scene: Scene, association: Association, scan: int = 0, *, axes: Any = None) -> Any:
    """Draw the scene, the association of one scan, the costs it chose from, and its convergence.

    Parameters
    ----------
    scene : Scene
    association : Association
        Association of this scene.
    scan : int
        Number of the scan to show.
    axes : array of four matplotlib Axes, optional
        Where to draw; default: those of a new figure.

    Returns
    -------
    ndarray of Axes (4,)

    Raises
    ------
    InvalidInputError
        The association does not contain that scan.
    """
    found = [item for item in association.scans if item.scan == scan]
    if not found:
        raise InvalidInputError(f"scan: the association has no scan {scan!r}")
    if axes is None:
        pyplot = load_extra("matplotlib.pyplot", "plot")
        axes = pyplot.subplots(2, 2, figsize=(11, 9), layout="constrained")[1]
    four = axes.ravel()
    plot_scene(scene, ax=four[0]).set_title("Scene")
    plot_solution(scene, found[0], ax=four[1]).set_title(f"Association of scan {scan}")
    problem, solution = build_problem(scene, scan), found[0].solution
    plot_costs(problem, solution if belongs(solution, problem) else None, ax=four[2]).set_title("Candidates and choice")
    plot_convergence(found[0].solution, ax=four[3]).set_title("Cost and lower bound")
    return four

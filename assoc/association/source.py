"""What can be associated: a scene, or an assignment problem."""

from __future__ import annotations

from assoc._files.npz import format_of
from assoc.errors import InvalidInputError
from assoc.problem import AssignmentProblem
from assoc.scene.scene import Scene
from assoc.solvers.doubts import doubts_about_costs

Source = Scene | AssignmentProblem


def load_source(path: str) -> Source:
    """Load a scene or a problem, whichever the file says it is.

    Raises
    ------
    InvalidInputError
        It is neither, or cannot be read.
    """
    if path.endswith(".txt"):
        return AssignmentProblem.load(path)
    found = format_of(path)
    if found == "assoc.problem":
        return AssignmentProblem.load(path)
    if found is not None and found != "assoc.scene":
        raise InvalidInputError(f"{path}: has the format {found[:60]!r}, expected 'assoc.scene' or 'assoc.problem'")
    return Scene.load(path)


def warnings_of(source: Source) -> tuple[str, ...]:
    """What is almost surely a mistake in a scene or a problem, one line each."""
    return source.warnings if isinstance(source, Scene) else doubts_about_costs(source)

"""What can be associated: a scene, or an assignment problem."""

from __future__ import annotations

from typing import TYPE_CHECKING

from assoc._files.npz import format_of
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc.problem import AssignmentProblem
    from assoc.scene.scene import Scene


def load_source(path: str) -> Scene | AssignmentProblem:
    """Load a scene or a problem, whichever the file says it is.

    Raises
    ------
    InvalidInputError
        It is neither, or cannot be read.
    """
    found = format_of(path)
    if found == "assoc.problem":
        from assoc.problem import AssignmentProblem

        return AssignmentProblem.load(path)
    if found is not None and found != "assoc.scene":
        raise InvalidInputError(f"{path}: has the format {found[:60]!r}, expected 'assoc.scene' or 'assoc.problem'")
    from assoc.scene.scene import Scene

    return Scene.load(path)

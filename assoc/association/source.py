"""Sources of an association: a scene, or an assignment problem."""

from __future__ import annotations

import os

from assoc._files.npz import format_of
from assoc._files.problem_text import is_text
from assoc._files.reading import refuse_pipe
from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError
from assoc.problem import AssignmentProblem
from assoc.scene.scene import Scene
from assoc.solvers.plausibility import cost_warnings

Source = Scene | AssignmentProblem


@explains_wrong_types
def load(path: str | os.PathLike[str]) -> Source:
    """Load a scene or a problem, by the format that the file names.

    Parameters
    ----------
    path : path-like
        scene.npz or problem.npz; a problem as plain text ends in .txt.

    Returns
    -------
    Scene or AssignmentProblem

    Raises
    ------
    InvalidInputError
        It is neither, or cannot be read.
    """
    return load_source(os.fspath(path))


def load_source(path: str) -> Source:
    """Load a scene or a problem from a file; see `load`."""
    if is_text(path):
        return AssignmentProblem.load(path)
    refuse_pipe(path)
    refuse_text(path)
    found = format_of(path)
    if found == "assoc.problem":
        return AssignmentProblem.load(path)
    if found is not None and found != "assoc.scene":
        raise InvalidInputError(f"{path}: has the format {found[:60]!r}, expected 'assoc.scene' or 'assoc.problem'")
    return Scene.load(path)


def refuse_text(path: str) -> None:
    """Refuse a description of radars, or a table, where a scene is expected; say which program takes it."""
    if path.lower().endswith(".toml"):
        raise InvalidInputError(
            f"{path}: is a description, expected a scene or problem (.npz); that of radars is looked at by "
            "'assoc inspect' and tracked by 'assoc track', settings come with --config"
        )
    if format_of(path) is None and _is_table(path):
        raise InvalidInputError(
            f"{path}: is a table, expected a scene or problem (.npz); radar plots become tracks with 'assoc track', or "
            "come to 'assoc live radars.toml' on stdin; recorded trajectories become a scene with 'assoc simulate "
            "from-tracks'"
        )


def _is_table(path: str) -> bool:
    """Whether a file looks like a table of text: its first line has several columns."""
    try:
        with open(path, "rb") as file:
            start = file.read(4096)
        line = start.partition(b"\n")[0].decode("utf-8-sig")
    except (OSError, ValueError):  # ValueError: no text, or no name of a file
        return False
    named = path.lower().endswith((".csv", ".tsv"))
    return line.replace("\t", " ").strip().isprintable() and (named or any(line.count(mark) >= 2 for mark in ",;\t"))


def warnings_of(source: Source) -> tuple[str, ...]:
    """Probable mistakes in a scene or a problem, one line each."""
    return source.warnings if isinstance(source, Scene) else cost_warnings(source)

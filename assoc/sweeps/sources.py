"""What a study runs on, and a digest of it: the same content is the same source, whatever the name of its file."""

from __future__ import annotations

import hashlib
import os
import tempfile
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from assoc.association.source import Source, load_source
from assoc.errors import InvalidInputError
from assoc.problem import AssignmentProblem
from assoc.scene.scene import Scene


@dataclass(frozen=True)
class StudySource:
    """A scene or a problem under its name.

    Parameters
    ----------
    content : Scene or AssignmentProblem
    name : str
        For people: the file's name, say.

    Attributes
    ----------
    fingerprint : str
        Sixteen hexadecimal digits of the digest of all arrays.
    """

    content: Source
    name: str
    fingerprint: str = field(default="")

    def __post_init__(self) -> None:
        # names of files may hold bytes that are no text, and columns of tables cannot
        object.__setattr__(self, "name", self.name.encode("utf-8", "backslashreplace").decode())
        if not self.fingerprint:
            object.__setattr__(self, "fingerprint", fingerprint(self.content))

    @property
    def num_scans(self) -> int:
        """Number of problems: the scans of a scene; 1 for a problem."""
        return self.content.num_scans if isinstance(self.content, Scene) else 1


def fingerprint(content: Source) -> str:
    """Digest of what a file of it would hold (its arrays; not the archive's dates)."""
    digest = hashlib.sha256(type(content).__name__.encode())
    with tempfile.TemporaryDirectory(prefix="assoc-") as folder:
        path = Path(folder) / "content.npz"
        content.save(path)
        with zipfile.ZipFile(path) as archive:
            for name in sorted(archive.namelist()):
                digest.update(name.encode() + b"\0" + archive.read(name))
    return digest.hexdigest()[:16]


def load_sources(files: Sequence[str]) -> tuple[StudySource, ...]:
    """Load scenes and problems from files.

    Raises
    ------
    InvalidInputError
        A file is neither, or the same content is given twice.
    """
    return named_sources([load_source(file) for file in files], files)


def named_sources(contents: Sequence[Source], files: Sequence[str]) -> tuple[StudySource, ...]:
    """Sources under the names of their files: the last part of the path where that tells them apart.

    Raises
    ------
    InvalidInputError
        The same content is given twice.
    """
    short = [os.path.basename(file) for file in files]
    names = files if len(set(short)) < len(short) else short
    sources = tuple(StudySource(content, name) for content, name in zip(contents, names, strict=True))
    seen: dict[str, str] = {}
    for source, file in zip(sources, files, strict=True):
        if source.fingerprint in seen:
            raise InvalidInputError(f"{file}: is the same as {seen[source.fingerprint]}; give it once")
        seen[source.fingerprint] = file
    return sources


def study_sources(given: Any) -> tuple[StudySource, ...]:
    """Scenes and problems, one or several, with or without names, as sources; unnamed ones are numbered.

    Raises
    ------
    InvalidInputError
        There are none, or something is neither a scene nor a problem.
    """
    every = (given,) if isinstance(given, (StudySource, Scene, AssignmentProblem)) else tuple(given)
    if not every:
        raise InvalidInputError("the study has no scenes and no problems")
    found = []
    for number, one in enumerate(every, start=1):
        if isinstance(one, (Scene, AssignmentProblem)):
            kind = "scene" if isinstance(one, Scene) else "problem"
            one = StudySource(one, getattr(one, "name", "") or f"{kind} {number}")
        if not isinstance(one, StudySource):
            raise InvalidInputError(f"sources: expected scenes or problems, got a {type(one).__name__}")
        found.append(one)
    names = [one.name for one in found]
    # tables tell sources apart by their names
    return tuple(
        replace(one, name=f"{one.name} ({number})") if names.count(one.name) > 1 else one
        for number, one in enumerate(found, start=1)
    )

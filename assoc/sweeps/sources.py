"""The scenes and problems of a study, identified by a digest: equal content is the same source in any file."""

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
    """A scene or a problem with a name for display, for example the file's."""

    content: Source
    name: str
    fingerprint: str = field(default="")
    """Sixteen hexadecimal digits of the digest of all arrays."""

    def __post_init__(self) -> None:
        # file names may hold bytes that are not valid text, which table columns refuse
        object.__setattr__(self, "name", self.name.encode("utf-8", "backslashreplace").decode())
        if not self.fingerprint:
            object.__setattr__(self, "fingerprint", fingerprint(self.content))

    @property
    def num_scans(self) -> int:
        """Number of problems: the scans of a scene; 1 for a problem."""
        return self.content.num_scans if isinstance(self.content, Scene) else 1


def fingerprint(content: Source) -> str:
    """Digest of the arrays that a file of the content holds (not of the archive's dates)."""
    digest = hashlib.sha256(type(content).__name__.encode())
    with tempfile.TemporaryDirectory(prefix="assoc-") as folder:
        path = Path(folder) / "content.npz"
        content.save(path)
        with zipfile.ZipFile(path) as archive:
            for name in sorted(archive.namelist()):
                digest.update(name.encode() + b"\0" + archive.read(name))
    return digest.hexdigest()[:16]


def load_sources(files: Sequence[str]) -> tuple[StudySource, ...]:
    """Load scenes and problems, named by their files, by the last part of the path where that is unique.

    The same content twice is refused.
    """
    contents = [load_source(file) for file in files]
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
    """Scenes and problems, one or several, with or without names, as sources; those without a name are numbered."""
    every = (given,) if isinstance(given, (StudySource, Scene, AssignmentProblem)) else tuple(given)
    if not every:
        raise InvalidInputError("the study has no scenes and no problems")
    found = []
    for number, item in enumerate(every, start=1):
        if isinstance(item, (Scene, AssignmentProblem)):
            kind = "scene" if isinstance(item, Scene) else "problem"
            item = StudySource(item, getattr(item, "name", "") or f"{kind} {number}")
        if not isinstance(item, StudySource):
            raise InvalidInputError(f"sources: expected scenes or problems, got a {type(item).__name__}")
        found.append(item)
    names = [source.name for source in found]
    # tables distinguish sources by their names
    return tuple(
        replace(source, name=f"{source.name} ({number})") if names.count(source.name) > 1 else source
        for number, source in enumerate(found, start=1)
    )

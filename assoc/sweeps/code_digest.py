"""A digest of the code that results depend on: it changes during development, when the version does not."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

_ROOMS = ("costs", "sensors", "packing", "solvers", "ranking")


@cache
def code_digest() -> str:
    """Sixteen hexadecimal digits of the digest of the solvers' and costs' source files; empty if there are none."""
    package = Path(__file__).resolve().parent.parent
    files = sorted(path for room in _ROOMS for path in (package / room).rglob("*.py"))
    digest = hashlib.sha256()
    for path in files:
        content = path.read_bytes()
        digest.update(f"{path.relative_to(package).as_posix()} {len(content)}\n".encode() + content)
    return digest.hexdigest()[:16] if files else ""

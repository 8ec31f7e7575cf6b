"""What a comparison found, as a file."""

from __future__ import annotations

import datetime
import json
import platform
from pathlib import Path
from typing import Any

from assoc._files.output import write_text


def write_comparison(path: str | Path, rows: list[dict[str, Any]], seconds: float) -> None:
    """Write the rows of a run."""
    head = {
        "format": "assoc.sdlib.comparison",
        "version": 1,
        "date": datetime.date.today().isoformat(),
        "seconds": seconds,
        "machine": f"one core of {platform.machine()}, Python {platform.python_version()}",
    }
    lines = ",\n".join(json.dumps(row) for row in rows)
    write_text(path, f'{json.dumps(head)[:-1]}, "rows": [\n{lines}\n]}}\n')

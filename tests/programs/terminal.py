"""What a program shows a user who sits before it."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence


def shown(words: Sequence[object], *, only_errors: bool = False, columns: int = 200, **options: object) -> str:
    """Run ``python -m words`` on a pseudo terminal and return what it shows; of stderr alone with ``only_errors``."""
    main, side = os.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", *map(str, words)],
        stdout=subprocess.DEVNULL if only_errors else side,
        stderr=side,
        env={**os.environ, "TERM": "xterm", "COLUMNS": str(columns)},
        **options,
    )
    os.close(side)
    seen = b""
    while True:
        try:
            part = os.read(main, 4096)
        except OSError:  # Linux says so that the other side is closed
            break
        if not part:
            break
        seen += part
    os.close(main)
    assert process.wait(60) == 0
    return seen.decode()

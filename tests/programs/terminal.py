"""What a program shows a user who sits before it."""

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence


def shown(
    words: Sequence[object],
    *,
    only_errors: bool = False,
    columns: int = 200,
    variables: Mapping[str, str] | None = None,
    **options: object,
) -> str:
    """Run ``python -m words`` on a pseudo terminal and return what it shows; of stderr alone with ``only_errors``."""
    main, side = os.openpty()
    process = subprocess.Popen(
        [sys.executable, "-m", *map(str, words)],
        stdout=subprocess.DEVNULL if only_errors else side,
        stderr=side,
        env={**os.environ, "TERM": "xterm", "COLUMNS": str(columns), **(variables or {})},
        **options,
    )
    os.close(side)
    seen = _read(main)
    status = process.wait(600)
    assert status == 0
    return seen


def _read(main: int) -> str:
    """Read what was written to the other side of a pseudo terminal until that is closed."""
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
    return seen.decode()

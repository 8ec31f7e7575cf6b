"""What a program shows a user who sits before it."""

import os
import re
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


def shown_at(widths: Sequence[int], words: Sequence[object], *, status: int = 0, **options: object) -> dict[int, str]:
    """Show the program ``words`` on terminals of several widths; one process, without what moves the cursor."""
    program, *rest = map(str, words)
    code = (
        f"import os, importlib; main = importlib.import_module({program!r}).main\n"
        f"for width in {[*widths]}:\n"
        "    os.environ['COLUMNS'] = str(width)\n"
        "    print('=' * 9, width, flush=True)\n"
        f"    code = main({rest!r})\n"
        f"    if code != {status}:\n"
        "        raise SystemExit(f'exit code {code}')"
    )
    main, side = os.openpty()
    command = [sys.executable, "-c", code]
    environment = {**os.environ, "TERM": "xterm"}
    process = subprocess.Popen(command, stdout=side, stderr=subprocess.PIPE, env=environment, **options)
    os.close(side)
    text = _read(main)
    _, errors = process.communicate()
    assert process.returncode == 0, errors
    text = re.sub(r"\x1b\[[?0-9;]*[A-Za-z]", "", text.replace("\r\n", "\n"))
    parts = re.split(r"^=========\s(\d+)\n", text, flags=re.MULTILINE)
    return {int(width): part for width, part in zip(parts[1::2], parts[2::2], strict=True)}


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

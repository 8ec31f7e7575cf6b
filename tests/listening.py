"""When a program has taken over its signals."""

import signal
from pathlib import Path


def listens(process: int) -> bool:
    """Whether a program blocks Ctrl-C, for its own thread to take: one that comes before ends Python itself."""
    fields = dict(line.split(":", 1) for line in Path(f"/proc/{process}/status").read_text().splitlines())
    return bool(int(fields.get("SigBlk", "0"), 16) >> (signal.SIGINT - 1) & 1)

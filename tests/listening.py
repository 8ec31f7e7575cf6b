"""When a program has taken over its signals."""

import signal
import subprocess
import time
from pathlib import Path


def listens(process: int) -> bool:
    """Whether a program blocks Ctrl-C, for its own thread to take: one that comes before ends Python itself."""
    fields = dict(line.split(":", 1) for line in Path(f"/proc/{process}/status").read_text().splitlines())
    return bool(int(fields.get("SigBlk", "0"), 16) >> (signal.SIGINT - 1) & 1)


def wait_until_it_listens(process: "subprocess.Popen[str]") -> None:
    """Wait until a program has begun, or ended."""
    if not Path("/proc/self/status").exists():
        time.sleep(1.0)
        return
    last = time.monotonic() + 120.0
    while process.poll() is None and not listens(process.pid):
        assert time.monotonic() < last, "it never listened"
        time.sleep(0.02)

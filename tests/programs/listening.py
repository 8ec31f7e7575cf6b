"""When a program has taken over its signals."""

import signal
import time
from pathlib import Path


def wait_until_it_listens(process):
    """Wait until a program blocks Ctrl-C, for its own thread to take: one that comes before ends Python itself."""
    if not Path("/proc/self/status").exists():
        time.sleep(1.0)
        return
    last = time.monotonic() + 120.0
    while process.poll() is None:
        fields = dict(line.split(":", 1) for line in Path(f"/proc/{process.pid}/status").read_text().splitlines())
        if int(fields.get("SigBlk", "0"), 16) >> (signal.SIGINT - 1) & 1:
            return
        assert time.monotonic() < last, "it never listened"
        time.sleep(0.02)

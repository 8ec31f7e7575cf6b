"""Available memory, and refusal of work that would take more.

The limit is the lesser of what is left of the machine's memory and of the address space (``ulimit -v``). A constant
would be too small for a server and too large for a laptop. Where the system gives no figures nothing is refused.
"""

from __future__ import annotations

import math
import os
from pathlib import Path

from assoc.errors import LimitExceededError

# below this the system is not asked
_SMALL = 64 * 1024**2
# reserve for what estimates leave out
_SHARE = 0.9


def require(needed: float, what: str, advice: str, *, here: bool = True) -> None:
    """Refuse work that would take more memory, ``needed`` bytes at the peak, than there is: LimitExceededError.

    The message begins with ``what`` the memory is for, which names the argument that causes it, and ends with
    ``advice``. ``here``: this process takes the memory, so that the limit of its address space applies.
    """
    if needed <= _SMALL:
        return
    free = available(here)
    if not needed <= free:
        raise LimitExceededError(
            f"{what} would take about {in_words(needed)} of memory, {in_words(free)} are available; {advice}"
        )


def fits(needed: float) -> bool:
    """Whether so many more bytes are available: for searches that can do with less."""
    return needed <= _SMALL or needed <= available()


def at_most(count: int, each: float) -> int:
    """Return how many of ``count`` objects of ``each`` bytes fit into memory; at least one."""
    if count * each <= _SMALL:
        return count
    return min(count, int(max(1.0, min(available() / each, 2.0**31))))


def available(here: bool = True) -> float:
    """Bytes that this process (or others that it starts) may still take; infinite where the system gives no figures."""
    return _SHARE * max(min(_of_machine(), _of_address_space() if here else math.inf), 0.0)


def in_words(count: float) -> str:
    """Bytes for a message: 3.2 GB."""
    if not count < 1e18:
        return "more than 1e18 bytes"
    for unit, size in (("TB", 1e12), ("GB", 1e9)):
        if count >= size:
            return f"{count / size:.3g} {unit}"
    return f"{count / 1e6:.0f} MB"


def _of_machine() -> float:
    try:
        with open("/proc/meminfo", "rb") as file:
            for line in file:
                if line.startswith(b"MemAvailable:"):
                    return 1024.0 * int(line.split()[1])
    except (OSError, ValueError, IndexError):
        pass
    try:
        # an upper limit, not what is free
        return float(os.sysconf("SC_PHYS_PAGES")) * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return math.inf


def _of_address_space() -> float:
    try:
        import resource
    except ImportError:  # Windows
        return math.inf
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return math.inf
    try:
        pages = int(Path("/proc/self/statm").read_bytes().split()[0])
    except (OSError, ValueError, IndexError):
        return float(limit)
    return float(limit - pages * os.sysconf("SC_PAGE_SIZE"))

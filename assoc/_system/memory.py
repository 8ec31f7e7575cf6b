"""Available memory, and refusal of work that would take more.

The limit is the least of what is left of the machine's memory, of the control group's (a container), and of the address
space (``ulimit -v``). A constant would be too small for a server and too large for a laptop. Where the system gives no
figures nothing is refused.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from assoc.errors import LimitExceededError

# below this the system is not asked
_SMALL = 64 * 1024**2
# the kernel's value for a control group without a limit
_ENDLESS = 1 << 60
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
    return _SHARE * max(min(_of_machine(), _of_group(), _of_address_space() if here else math.inf), 0.0)


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


def _of_group() -> float:
    return min(_left_in_groups(_groups()), default=math.inf)


def _left_in_groups(groups: Iterable[tuple[str, str, str, str, bytes]]) -> Iterator[float]:
    """Bytes left in the control group of this process and in the groups that contain it."""
    for root, path, limit, usage, cache in groups:
        folder = root + path
        while True:
            most = _number(f"{folder}/{limit}")
            used = _number(f"{folder}/{usage}")
            if most is not None and used is not None and most < _ENDLESS:
                yield most - used + _reclaimable(f"{folder}/memory.stat", cache)
            if len(folder) <= len(root):
                break
            folder = folder.rpartition("/")[0]


def _groups() -> Iterator[tuple[str, str, str, str, bytes]]:
    """Folder of the hierarchy, path within it, file names of limit and usage, and field of the reclaimable cache."""
    try:
        lines = Path("/proc/self/cgroup").read_text().splitlines()
    except OSError:
        return
    for line in lines:
        _, _, rest = line.partition(":")
        names, _, path = rest.partition(":")
        path = path.rstrip("/")
        if not names:
            yield "/sys/fs/cgroup", path, "memory.max", "memory.current", b"inactive_file"
        elif "memory" in names.split(","):
            yield (
                "/sys/fs/cgroup/memory", path, "memory.limit_in_bytes", "memory.usage_in_bytes", b"total_inactive_file",
            )  # fmt: skip


def _number(path: str) -> float | None:
    try:
        return float(Path(path).read_bytes())
    except (OSError, ValueError):  # no such file, or "max"
        return None


def _reclaimable(path: str, name: bytes) -> float:
    try:
        for line in Path(path).read_bytes().splitlines():
            key, _, value = line.partition(b" ")
            if key == name:
                return float(value)
    except (OSError, ValueError):
        pass
    return 0.0


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

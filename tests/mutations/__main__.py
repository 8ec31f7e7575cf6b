"""Put in one fault after the other, in a copy of the project, and see whether its tests fail: ``make mutants``.

The faults are chosen by hand (faults.txt). Programs that make them do not fit: mutmut leaves out decorated functions,
as all kernels are. cosmic-ray makes 340 mutants of a file, and kernels must be interpreted here: the tests of one
mutant take 10 to 30 seconds.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.mutations.faults import FAULTS, Fault

_ROOT = Path(__file__).parents[2]
# a fault may also show by never ending: tests may take so many times what they take without it, and this many seconds
_LONGER, _LEAST = 5.0, 60.0
# what the tests of one room may take without a fault
_MOST = 1800.0


class _Copy:
    """A copy of the project in which faults are put in and taken out."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in ("assoc", "experiments", "tests"):
            shutil.copytree(_ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(_ROOT / "pyproject.toml", folder)
        # interpreted: compiling each fault would take longer than its tests
        self._environment = {**os.environ, "PYTHONPATH": str(folder), "NUMBA_DISABLE_JIT": "1"}
        self._environment["PYTHONDONTWRITEBYTECODE"] = "1"

    def passes(self, test: str, limit: float = _MOST) -> tuple[bool, str]:
        """Whether a test file passes within so many seconds, and pytest's last line."""
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", test]
        try:
            done = subprocess.run(
                command, cwd=self.folder, env=self._environment, capture_output=True, text=True, timeout=limit
            )
        except subprocess.TimeoutExpired:
            return False, "it did not end"
        lines = done.stdout.strip().splitlines()
        failed = [line for line in lines if line.startswith(("FAILED", "ERROR"))]
        if done.returncode not in (0, 1):
            raise RuntimeError(f"pytest could not run {test}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
        return done.returncode == 0, (failed or lines or [""])[-1].split(" - ")[0]

    def try_fault(self, fault: Fault, limit: float) -> tuple[bool, str]:
        """Whether the tests notice a fault, and which."""
        path = self.folder / fault.file
        text = path.read_text(encoding="utf-8")
        path.write_text(fault.put_in(text), encoding="utf-8")
        try:
            passed, said = self.passes(fault.test, limit)
        finally:
            path.write_text(text, encoding="utf-8")
        return not passed, said


def main(arguments: Sequence[str] | None = None) -> int:
    """Try the faults; returns 0 when all were noticed."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutations", description=__doc__.split("\n")[0])
    parser.add_argument("--only", default="", metavar="TEXT", help="faults whose words or files contain this")
    parser.add_argument("--processes", type=int, default=2, metavar="N", help="faults at a time (default 2)")
    parsed = parser.parse_args(arguments)
    chosen = [fault for fault in FAULTS if parsed.only in fault.what or parsed.only in fault.file]
    for fault in chosen:
        fault.put_in((_ROOT / fault.file).read_text(encoding="utf-8"))
    started, missed = time.monotonic(), 0
    with tempfile.TemporaryDirectory(prefix="assoc-mutants-") as folder, ThreadPoolExecutor(parsed.processes) as pool:
        free = [_Copy(Path(folder) / str(number)) for number in range(parsed.processes)]

        def in_a_copy(act: Callable[[_Copy], tuple[bool, str]]) -> tuple[bool, str, float]:
            copy, begin = free.pop(), time.monotonic()
            try:
                return *act(copy), time.monotonic() - begin
            finally:
                free.append(copy)

        limits: dict[str, float] = {}
        tests = sorted({fault.test for fault in chosen})
        without = pool.map(lambda test: in_a_copy(lambda copy: copy.passes(test)), tests)
        for test, (passed, said, seconds) in zip(tests, without, strict=True):
            if not passed:
                print(f"without any fault {test} fails: {said}", file=sys.stderr)
                return 1
            limits[test] = max(_LONGER * seconds, _LEAST)
        tried = pool.map(lambda fault: in_a_copy(lambda copy: copy.try_fault(fault, limits[fault.test])), chosen)
        for fault, (noticed, said, _) in zip(chosen, tried, strict=True):
            missed += not noticed
            print(f"{'caught' if noticed else 'MISSED'}  {fault.what}\n        {said}", flush=True)
    print(f"{len(chosen) - missed} of {len(chosen)} caught in {time.monotonic() - started:.0f} s")
    return 1 if missed else 0


if __name__ == "__main__":
    raise SystemExit(main())

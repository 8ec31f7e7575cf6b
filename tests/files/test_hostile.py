"""Small files that want much memory: each is refused by one line, below a gigabyte at the peak."""

from pathlib import Path

import pytest

from tests.files.hostile import HOSTILE, MOST, Hostile, run

pytestmark = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="asks Linux for the peak of memory")


FEW = ("long-names.parquet", "texts.npz")
CASES = [pytest.param(one, id=one.name, marks=() if one.name in FEW else pytest.mark.slow) for one in HOSTILE]


@pytest.mark.parametrize("case", CASES)
def test_memory_stays_small(case: Hostile, tmp_path: Path) -> None:
    found = run(case, tmp_path)
    assert found.peak < MOST, found
    assert found.code == case.code and "Traceback" not in found.said, found
    assert case.code == 0 or (case.name in found.said and "\n" not in found.said), found

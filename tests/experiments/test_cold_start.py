"""What a user waits for after an installation: the clock of the experiment, and its table."""

import math
import os
import sys

import pytest

from experiments import cold_start
from experiments.common.claims import save_json
from experiments.pages.measured import first_call

PRINTS = """
import time
print("scan  cost", flush=True)
time.sleep(0.2)
print("   0  9 8 9  -12.5", flush=True)
time.sleep(0.3)
print("   1  9 9 9  -12.5")
"""


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="needs a pseudo terminal")
def test_the_first_row_is_seen_when_it_is_there(tmp_path):
    seconds = cold_start.measure(sys.executable, ["-c", PRINTS], tmp_path, tmp_path)
    # it sleeps before the row and behind it
    assert 0.2 <= seconds.first <= seconds.wall - 0.25 and seconds.cpu > 0
    silent = cold_start.measure(sys.executable, ["-c", "pass"], tmp_path, tmp_path)
    assert math.isnan(silent.first)
    fails = ["-c", "import sys; print('no such scene'); sys.exit(3)"]
    with pytest.raises(RuntimeError, match=r"exit code 3: .*no such scene"):
        cold_start.measure(sys.executable, fails, tmp_path, tmp_path)


def test_what_is_no_wheel_is_refused(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        cold_start.main(["--wheel", str(tmp_path / "assoc.whl")])
    assert ended.value.code == 2 and "expected a file that ends with .whl" in capsys.readouterr().err


def test_the_table_has_every_command_and_marks_what_misses_its_goal(tmp_path):
    assert "make bench-cold" in first_call(tmp_path)
    claims = []
    for label, goal in cold_start.GOALS.items():
        for way, wall in (("fresh clone", 16.0), ("again", 1.25), ("wheel", 2.5)):
            most = goal if way == "fresh clone" else None
            claims += [cold_start._claim(f"{label}: {way}, wall", [wall - 1, wall, wall + 1], most)]
            claims += [cold_start._claim(f"{label}: {way}, cpu", [30.0], None)]
    save_json(str(tmp_path / "cold_start.json"), claims, "cold_start", 0, "")
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in first_call(tmp_path).splitlines()[2:]]
    assert [row[0] for row in rows] == [*cold_start.COMMANDS]
    for row in rows:
        missed = cold_start.GOALS[row[0]] < 16
        assert row[1:] == ["**16**" if missed else "16", "2.5", "1.2", "30", f"{cold_start.GOALS[row[0]]:g}"]

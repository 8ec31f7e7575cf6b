"""What a scan takes, part by part: that the parts are timed which the table names."""

import pytest

from experiments import scan_time
from experiments.common.results import Results
from experiments.pages.measured import scan_time as table_of_parts


def test_only_the_call_is_timed_and_what_it_is_given_is_new(monkeypatch):
    clock, given, seen = [0.0], [], []
    monkeypatch.setattr(scan_time.time, "thread_time", lambda: clock[0])

    def prepare():
        clock[0] += 7.0
        given.append(object())
        return given[-1]

    def call(one):
        clock[0] += 1e-3
        seen.append(one)

    assert scan_time.median_ms(call, prepare) == pytest.approx(1.0)
    assert seen == given and len(set(map(id, given))) == len(given) > 3


def test_parts_of_a_scan():
    found = scan_time.parts_of(scan_time.KINDS["three radars, 3 targets"].make(1))
    assert tuple(found) == scan_time.PARTS and min(found.values()) > 0.0


def test_the_page_shows_every_kind():
    rows = [line for line in table_of_parts().splitlines() if line.startswith(("| 3", "| three"))]
    assert len(rows) == len(scan_time.KINDS)
    goal = Results("scan_time")[f"3 sensors x 1,000 targets: {scan_time.TOGETHER}"]
    assert goal.band == (None, 15.0)

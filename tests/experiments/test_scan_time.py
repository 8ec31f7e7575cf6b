"""What a scan takes, part by part: that the parts are timed which the table names."""

from __future__ import annotations

import time

from experiments import scan_time
from experiments.common.results import Results
from experiments.pages.measured import scan_time as table_of_parts


def test_only_the_call_is_timed_and_what_it_is_given_is_new():
    given = []

    def prepare():
        time.sleep(1e-3)
        begin = time.thread_time()
        while time.thread_time() - begin < 5e-3:
            pass
        given.append(object())
        return given[-1]

    seen = []
    assert scan_time.median_ms(seen.append, prepare) < 2.0
    assert seen == given and len(set(map(id, given))) == len(given) > 3


def test_parts_of_a_scan():
    found = scan_time.parts_of(scan_time.KINDS["three radars, 3 targets"].make(1))
    assert tuple(found) == scan_time.PARTS and all(0 < value < 1e3 for value in found.values())


def test_the_page_shows_every_kind():
    rows = [line for line in table_of_parts().splitlines() if line.startswith(("| 3", "| three"))]
    assert len(rows) == len(scan_time.KINDS)
    goal = Results("scan_time")[f"3 sensors x 1,000 targets: {scan_time.TOGETHER}"]
    assert goal.band == (None, 15.0)

"""Times as people read them, in every place that shows them."""

import io

import numpy as np
import pandas as pd
import pytest

from assoc._cli.track.plot_lines import TrackWriter
from assoc._text.times import decimals, moment
from assoc.tracking import Picture, Track, TrackTable

NOON = 1_626_098_402.5
"""2021-07-12 14:00:02.5 UTC"""


@pytest.mark.parametrize(
    ("time", "text"),
    [
        (NOON, "2021-07-12 14:00:02.5Z"),
        (NOON - 0.5, "2021-07-12 14:00:02Z"),
        (NOON + 0.4996, "2021-07-12 14:00:03Z"),
        (NOON + 0.001, "2021-07-12 14:00:02.501Z"),
        (43_201.25, "43201.25 s"),
        (1234567.125, "1234567.125 s"),
        (100.0, "100 s"),
        (-0.0001, "0 s"),
        (1e12, "1000000000000 s"),
    ],
)
def test_a_moment(time, text):
    assert moment(time) == text
    assert decimals(100.0, 0) == "100"


def track(time, place=(1e5, 2e5, -4e3)):
    life = {"confirmed": True, "score": 3.0, "hits": 4, "started": time - 1.25, "last_detection": time}
    velocity = np.array([10.0, 0.0, 0.0])
    return Track(7, time, np.zeros(6), np.eye(6), np.array(place), velocity, **life, existence=0.9)


def test_live_tracks_have_fractions_and_places_on_earth():
    """The same as the table of `assoc track`, with and without a height."""
    origin = (0.8, 0.1, 400.0)
    for positions in ((0, 2, 4), (0, 2)):
        out, table = io.StringIO(), TrackTable(origin)
        writer = TrackWriter(out, positions, origin)
        writer.write(Picture(NOON, [track(NOON)], [], np.zeros((0, 3)), np.zeros(0, int)))
        table.add([track(NOON)], positions)
        live, whole = pd.read_csv(io.StringIO(out.getvalue())), table.to_frame()
        assert (live.time[0], live.started[0], live.last_detection[0]) == (NOON, NOON - 1.25, NOON)
        assert live.latitude[0] == pytest.approx(whole.latitude[0], abs=1e-7)
        assert live.longitude[0] == pytest.approx(whole.longitude[0], abs=1e-7)
        assert live.altitude[0] == pytest.approx(whole.altitude[0], abs=0.01, nan_ok=True)
        # 224 km away the plane is 4 km above the ground
        assert np.isnan(live.altitude[0]) if len(positions) == 2 else live.altitude[0] == pytest.approx(324, abs=1)
        assert "2021-07-12 14:00:02.5Z" in repr(track(NOON))

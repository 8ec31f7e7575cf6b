"""Recordings for tests."""

import math

import numpy as np

from assoc.recordings import Recording

TABLE_2_1 = """\
Time,Range,Bearing,Mode3,Altitude
0:13:06,117,220.8352,902,220
0:13:06,21,235.2527,908,191
0:13:07,90,248.6154,903,314
0:13:07,98,277.0989,0,2
0:13:11,163,54.85714,1694,2
0:13:11,144,61.18681,3673,388
0:13:11,46,73.84615,1332,331
0:13:13,56,212.3956,906,242
0:13:16,118,220.8352,902,220
0:13:16,22,234.9011,908,192
0:13:16,91,247.9121,903,319
0:13:17,98,277.0989,958,2
0:13:20,162,54.85714,1694,400
0:13:21,47,73.84615,1332,328
0:13:25,57,213.8022,906,243
0:13:25,120,220.8352,902,222
0:13:25,23,235.6044,908,193
0:13:25,92,248.6154,903,316
0:13:26,97,277.0989,958,79
0:13:29,161,54.85714,1694,402
"""
"""Table 2.1 of G. P. Cahyono's thesis (ITS Surabaya, 2014), as printed."""

GROUPS_WITH_WINDOW = [
    {(46, 1332), (90, 903), (21, 908), (98, 0), (163, 1694), (117, 902), (144, 3673), (56, 906)},
    {(118, 902), (22, 908), (91, 903), (162, 1694), (47, 1332), (98, 958)},
]
"""Range and Mode 3 of its tables 4.1 and 4.2; table 4.3 goes beyond table 2.1."""


def circling(turn=9.5, turns=40, aircraft=9, seed=0, jitter=0.0, bearings=None, start=1000.0, step=0.0, drift=0.02):
    """Plots of aircraft that circle the radar slowly, each seen once in a turn; sources are known.

    Parameters
    ----------
    jitter : float
        Largest error of a time stamp, seconds; step: stamps are rounded down to multiples of it; drift: the largest
        change of bearing in a turn, radians.
    """
    rng = np.random.default_rng(seed)
    first = rng.uniform(0, 2 * math.pi, aircraft) if bearings is None else np.asarray(bearings)
    drifts = rng.uniform(-drift, drift, len(first))
    rows = []
    for number in range(turns):
        for one in range(len(first)):
            # radians a turn; the antenna meets the aircraft where both are
            bearing = (first[one] % (2 * math.pi)) + drifts[one] * number
            time = start + turn * (number + bearing / (2 * math.pi)) + rng.uniform(-jitter, jitter)
            if rng.random() < 0.8:
                rows.append((time if not step else step * math.floor(time / step), bearing, one))
    rows.sort(key=lambda row: row[0])
    time, bearing, source = (np.array(column) for column in zip(*rows, strict=True))
    return Recording(
        times=time,
        ranges=np.full(len(time), 1e5) + 1e3 * source,
        azimuths=math.pi / 2 - bearing,
        identities=source + 1,
        sources=source,
    )

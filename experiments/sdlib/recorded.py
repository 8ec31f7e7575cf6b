"""Recorded air traffic under simulated radars: instances for whose making the recording is needed, which is not here.

The recording is an excerpt of the OpenSky Network's state vectors of 12 July 2021, 14:00 to 14:20 UTC: a row for each
aircraft every 10 seconds, from 50.0 to 54.5 degrees north and 5.0 degrees west to 1.6 east. It may not be given away
here. What is stored are instances alone: indices, and costs of tuples of measurements that simulated radars made of the
traffic, with noise, misses and false alarms; no position, time or aircraft can be had from them. Who has the recording
can make them anew: the environment variable named by `PATH` says where it lies.
"""

import os
from typing import NamedTuple

from assoc.costs import build_problem
from assoc.problem import AssignmentProblem
from assoc.simulation import simulate

PATH = "SDLIB_RECORDING"


class Watch(NamedTuple):
    """Radars over the traffic: how many, how good, how much else they see, and which scan (10 s each) it is.

    ``noise`` is the standard deviation of range, and across the line of sight at 50 km, metres.
    """

    radars: int
    detection_probability: float
    false_alarms: float
    noise: float
    scan: int
    seed: int

    def make(self) -> AssignmentProblem:
        """Make the problem from the recording."""
        if PATH not in os.environ:
            raise FileNotFoundError(f"{PATH}: names no recording; without it this instance cannot be made anew")
        options = self._asdict()
        seed, scan = options.pop("seed"), options.pop("scan")
        return build_problem(simulate("from-tracks", seed, file=os.environ[PATH], scans=scan + 1, **options), scan)


WATCHES = {
    "recorded-3-1": Watch(3, 0.9, 20.0, 300.0, 30, 1),
    "recorded-3-2": Watch(3, 0.7, 60.0, 1500.0, 50, 2),
    "recorded-3-3": Watch(3, 0.6, 400.0, 4000.0, 70, 3),
    "recorded-4-1": Watch(4, 0.6, 100.0, 3000.0, 40, 1),
    "recorded-4-2": Watch(4, 0.6, 300.0, 4000.0, 60, 2),
    "recorded-4-3": Watch(4, 0.7, 150.0, 8000.0, 80, 3),
    "recorded-5-1": Watch(5, 0.5, 100.0, 6000.0, 45, 1),
    "recorded-5-2": Watch(5, 0.6, 200.0, 5000.0, 90, 2),
    "recorded-6-1": Watch(6, 0.5, 80.0, 5000.0, 55, 1),
    "recorded-6-2": Watch(6, 0.7, 40.0, 3000.0, 100, 2),
}

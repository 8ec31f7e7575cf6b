"""Radars that are off by 150 m and 0.5 degrees: the biases are found and taken off while they report."""

import numpy as np
from associator import hypothesiser, with_associator
from scene import SENSORS, make, show
from stonesoup.dataassociator.neighbour import GNNWith2DAssignment

from assoc.integrations.stonesoup import RegistrationFeeder

BIASES = np.array([[0.009, 150.0], [-0.009, 150.0], [0.009, -150.0]])
SPREADS = {"range_spread": 150.0, "angle_spread": 0.01}


def ways(seed):
    """The same tracker with radars without biases, with biased ones, and with the feeder in between."""
    for name, biases in (("Stone Soup's GNN", 0.0 * BIASES), ("with biases", BIASES), ("registered", BIASES)):
        stream, paths = make(seed, biases)
        if name == "registered":
            stream = RegistrationFeeder(stream, SENSORS, SPREADS)
        yield name, with_associator(GNNWith2DAssignment(hypothesiser), stream), paths


def found(seed):
    """What the feeder has found at the end: the mean errors of bearing (rad) and range (m) that remain."""
    feeder = RegistrationFeeder(make(seed, BIASES)[0], SENSORS, SPREADS)
    for _ in feeder:
        pass
    left = feeder.registration.biases.reshape(3, 2)[:, ::-1] - BIASES
    return np.abs(left).mean(axis=0)


if __name__ == "__main__":
    show(ways)
    print("left: {:.4f} rad, {:.0f} m".format(*found(1)))

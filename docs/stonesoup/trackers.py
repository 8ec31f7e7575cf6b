"""Track-oriented MHT and JIPDA as trackers of Stone Soup: they start and end tracks by themselves."""

from scene import SENSORS, make, show

from assoc.integrations.stonesoup import AssocTracker


def ways(seed):
    """The tracks of both have `exist_prob`, the probability that the target is there."""
    stream, paths = make(seed)
    yield "MHT", AssocTracker(stream, SENSORS, "mht", interval=4), paths
    yield "JIPDA", AssocTracker(stream, SENSORS, "joint-probabilistic", interval=4), paths


if __name__ == "__main__":
    show(ways)

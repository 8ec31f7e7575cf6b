"""The third radar's detections come 8 s late: each is put into the scan that it belongs to."""

from datetime import timedelta

from scene import RADARS, SENSORS, make, show

from assoc.integrations.stonesoup import AssocTracker


def as_they_come(stream):
    """The same sets in the order in which they arrive, with their own times."""
    late = timedelta(seconds=8.5)
    return sorted(stream, key=lambda one: one[0] + late * any(d.measurement_model is RADARS[2] for d in one[1]))


def ways(seed):
    """All in time; the late ones left out; and put where they belong."""
    stream, paths = make(seed)
    two = [one for k, one in enumerate(stream) if k % 3 < 2]
    yield "in time", AssocTracker(stream, SENSORS, interval=4), paths
    yield "late ones left out", AssocTracker(two, SENSORS[:2], interval=4), paths
    late = AssocTracker(as_they_come(stream), SENSORS, interval=4, horizon=30, asynchronous=True)
    yield "late ones put in", late, paths


if __name__ == "__main__":
    show(ways)

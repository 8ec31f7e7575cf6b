"""Trackers taken through scenes."""


def stepped(tracker, scene, first=0, last=None, *, times=False):
    """Step through a scene's scans up to `last`, with or without times and sectors; returns what the steps say."""
    scans = [scene.scan(k) for k in range(first, scene.num_scans if last is None else last)]
    return [
        tracker.step(scan.time, scan.measurements, *((scan.times, scan.sectors) if times else ())) for scan in scans
    ]

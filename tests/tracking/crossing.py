"""A recording of two aircraft that cross, with codes and addresses."""

import numpy as np

from assoc.recordings import Recording, radar_of

TURN = 4.0


def crossing(seed, wrong=(), address=False, begin=0.0):
    """Two aircraft that fly side by side for long, 150 m apart, and cross; codes as (plot of aircraft 0, code)."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(50):
        for aircraft in (0, 1):
            time = TURN * k + 0.3 * aircraft
            x, y = -20_000.0 + 200.0 * time, 30_000.0 + (2 * aircraft - 1) * 8.0 * (time - TURN * 25)
            code = (0o1234, 0o4567)[aircraft]
            if aircraft == 0 and k in wrong:
                code = 0o7654
            noisy = np.hypot(x, y) + rng.normal(0.0, 100.0), np.arctan2(y, x) + rng.normal(0.0, 2e-3)
            rows.append((begin + time, *noisy, code, 0xA00000 + aircraft if address else 0, aircraft))
    rows.sort()
    times, ranges, azimuths, codes, addresses, sources = map(np.array, zip(*rows, strict=True))
    return Recording(times, ranges, azimuths, identities=codes, addresses=addresses, sources=sources)


def radar(recording):
    """The radar that made it."""
    return radar_of(recording, detection_probability=0.9, range_noise=100.0, azimuth_noise=2e-3, false_alarm_rate=2.5)

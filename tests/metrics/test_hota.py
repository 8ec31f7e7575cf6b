"""HOTA against its definition written out in loops, and cases known by hand."""

import itertools

import numpy as np
import pytest

from assoc.metrics import Trajectories, hota

CUTOFF = 100.0


def by_definition(truth, tracks, cutoff):
    """Luiten et al., word by word: sets of true positives, of their associations, the matching by trying all."""
    times = sorted({*truth.times.tolist(), *tracks.times.tolist()})
    at = {t: (np.flatnonzero(truth.times == t), np.flatnonzero(tracks.times == t)) for t in times}

    def alike(i, j):
        return max(0.0, 1.0 - float(np.linalg.norm(truth.positions[i] - tracks.positions[j])) / cutoff)

    together = {}
    for rows, columns in at.values():
        for i, j in itertools.product(rows, columns):
            s = alike(i, j)
            either = sum(alike(i, k) for k in columns) + sum(alike(k, j) for k in rows) - s
            if s > 0:
                key = (truth.ids[i], tracks.ids[j])
                together[key] = together.get(key, 0.0) + s / either

    def fit(g, t):
        c = together.get((g, t), 0.0)
        return c / ((truth.ids == g).sum() + (tracks.ids == t).sum() - c)

    pairs = []
    for rows, columns in at.values():
        best, most = [], -1.0
        wide = [*columns, *[None] * len(rows)]
        for choice in set(itertools.permutations(wide, len(rows))):
            value = sum(
                fit(truth.ids[i], tracks.ids[j]) * alike(i, j)
                for i, j in zip(rows, choice, strict=True)
                if j is not None
            )
            if value > most + 1e-12:
                best, most = [(i, j) for i, j in zip(rows, choice, strict=True) if j is not None], value
        pairs += [(truth.ids[i], tracks.ids[j], alike(i, j)) for i, j in best]
    values = []
    for k in range(1, 20):
        hits = [(g, t) for g, t, s in pairs if s >= k / 20 - 1e-12]
        if not hits:
            values.append(0.0)
            continue
        detection = len(hits) / (len(truth) + len(tracks) - len(hits))
        one = []
        for g, t in hits:
            both = hits.count((g, t))
            one.append(both / ((truth.ids == g).sum() + (tracks.ids == t).sum() - both))
        values.append(np.sqrt(detection * np.mean(one)))
    return float(np.mean(values))


def random_case(seed):
    rng = np.random.default_rng(seed)
    times, ids, places, estimates = [], [], [], []
    for k in range(6):
        for target in range(3):
            if rng.random() < 0.8:
                place = np.array([target * 60.0 + 5.0 * k, 0.0, 0.0]) + rng.normal(0, 10, 3)
                times.append(float(k))
                ids.append(target)
                places.append(place)
                if rng.random() < 0.8:
                    name = 10 + (target if k < 3 or rng.random() < 0.5 else (target + 1) % 3)
                    if (float(k), name) not in {(t, n) for t, n, _ in estimates}:
                        estimates.append((float(k), name, place + rng.normal(0, 30, 3)))
        if rng.random() < 0.3:
            estimates.append((float(k), 20, rng.uniform(0, 150, 3)))
    t, n, p = zip(*estimates, strict=True)
    return Trajectories(times, ids, np.array(places)), Trajectories(t, n, np.array(p))


@pytest.mark.parametrize("seed", range(25))
def test_hota_is_its_definition(seed):
    truth, tracks = random_case(seed)
    found = hota(truth, tracks, CUTOFF)
    assert found.hota == pytest.approx(by_definition(truth, tracks, CUTOFF), abs=1e-9)
    assert 0 < found.detection < 1 and 0 < found.association < 1


def line(ids, times=range(10), offset=0.0):
    """Targets side by side, 1 km apart."""
    rows = [(float(t), one, [1_000.0 * place, 10.0 * t + offset, 0.0]) for t in times for place, one in enumerate(ids)]
    t, n, p = zip(*rows, strict=True)
    return Trajectories(t, n, np.array(p))


def test_known_cases():
    truth = line([0, 1])
    assert hota(truth, line([5, 6]), CUTOFF).hota == pytest.approx(1.0)
    # names that change in the middle: each target goes half of the time with each
    first, second = line([5, 6], range(5)), line([6, 5], range(5, 10))
    swapped = Trajectories(
        np.append(first.times, second.times),
        np.append(first.ids, second.ids),
        np.append(first.positions, second.positions, axis=0),
    )
    found = hota(truth, swapped, CUTOFF)
    assert found.detection == pytest.approx(1.0) and found.association == pytest.approx(1 / 3)
    assert found.hota == pytest.approx(np.sqrt(1 / 3))
    # half of the targets found, and both found 50 m off: at ten of nineteen thresholds
    assert hota(truth, line([5]), CUTOFF).hota == pytest.approx(np.sqrt(0.5))
    assert hota(truth, line([5, 6], offset=50.0), CUTOFF).hota == pytest.approx(10 / 19)

"""The definitions of the metrics, written down directly: all permutations, plain loops."""

import itertools
import math


def matchings(m, n):
    """All partial matchings of m things to n things, as lists of pairs."""
    for size in range(min(m, n) + 1):
        for rows in itertools.combinations(range(m), size):
            for columns in itertools.permutations(range(n), size):
                yield list(zip(rows, columns, strict=True))


def ospa(between, m, n, c, p):
    """Schuhmacher et al. 2008, eq. 3; between(i, j) is a distance."""
    if max(m, n) == 0:
        return 0.0
    if m > n:
        return ospa(lambda i, j: between(j, i), n, m, c, p)
    best = min(
        sum(min(between(i, j), c) ** p for i, j in enumerate(chosen)) for chosen in itertools.permutations(range(n), m)
    )
    return ((best + c**p * (n - m)) / n) ** (1 / p)


def gospa(between, m, n, c, p):
    """Rahmathullah et al. 2017, proposition 1: over all partial matchings; distance, missed, false."""
    return min(
        (
            (sum(between(i, j) ** p for i, j in pairs) + c**p / 2 * (m + n - 2 * len(pairs))) ** (1 / p),
            c**p / 2 * (m - len(pairs)),
            c**p / 2 * (n - len(pairs)),
        )
        for pairs in matchings(m, n)
    )


def ospa2(truth, tracks, window, c, p, q):
    """Beard et al. 2020: truth and tracks are {id: {instant: point}}; window holds the instants that count."""

    def base(f, g):
        instants = [t for t in window if t in f or t in g]
        total = sum(min(math.dist(f[t], g[t]), c) ** q if t in f and t in g else c**q for t in instants)
        return (total / len(instants)) ** (1 / q)

    fs = [f for f in truth.values() if any(t in f for t in window)]
    gs = [g for g in tracks.values() if any(t in g for t in window)]
    return ospa(lambda i, j: base(fs[i], gs[j]), len(fs), len(gs), c, p)

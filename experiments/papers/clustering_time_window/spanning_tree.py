"""Clusters by a minimum spanning tree, which the thesis names (Park and Lee 2011), as tracks.

Plots are points in place and time (250 metres a second); points of different turns near each other are joined, the
least spanning tree of these edges is cut where one is longer than three and a half turns (an aircraft that was missed
once leaves less), and a part of three plots or more is a track. There is no prediction and no filter. The recordings
are those on which papers.clustering_time_window runs Reid's MHT; the pairs are drawn anew. Full size: 6 recordings of
1,130 s, 15 pairs of each kind (600 s).
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree
from scipy.spatial import cKDTree

from assoc.recordings import Recording, Window, clustering_time_window
from assoc.simulation import simulate_recording
from experiments.common.claims import Claim
from experiments.common.command import main, mean_interval
from experiments.papers.clustering_time_window import pairs, traffic
from experiments.papers.clustering_time_window.judging import Taken

NAMED = "section 1.1, named there"
SPEED, LONGEST, LEAST = 250.0, 3.5, 3
"""Metres that weigh as a second, longest edge in turns, fewest plots of a track."""


def clusters(recording: Recording, windows: list[Window]) -> Taken:
    """The parts of the tree as tracks of the plots."""
    rows = np.concatenate([window.rows for window in windows])
    turns = np.repeat(np.arange(len(windows)), [len(window) for window in windows])
    points = np.column_stack([recording.positions[rows], SPEED * recording.times[rows]])
    near = cKDTree(points).query_pairs(LONGEST * SPEED * traffic.ROTATION, output_type="ndarray")
    near = near[turns[near[:, 0]] != turns[near[:, 1]]]
    lengths = np.linalg.norm(points[near[:, 0]] - points[near[:, 1]], axis=1)
    # older scipy takes no wider numbers
    edges = coo_array((lengths, near.T.astype(np.int32)), shape=(len(rows), len(rows)))
    tree = minimum_spanning_tree(edges)
    _, parts = connected_components(tree, directed=False)
    return Taken(turns, rows, parts, np.bincount(parts)[parts] >= LEAST)


def experiment(quick: bool, rng: np.random.Generator) -> list[Claim]:
    """CT, MT and IT, then pairs."""
    found = []
    for recording, groups in traffic.recordings(2 if quick else 6, rng, 300.0 if quick else traffic.DURATION):
        rates = clusters(recording, groups["window"]).rates(recording)
        found.append((rates.ct, rates.mt, rates.it))
    claims = [
        Claim(f"{rate}, spanning tree, CTW", "%", None, float(values.mean()), mean_interval(values),
              source=NAMED)
        for rate, values in zip(("CT", "MT", "IT"), np.array(found).T, strict=True)
    ]  # fmt: skip
    for kind in pairs.TRAFFIC:
        good = []
        for _ in range(2 if quick else 15):
            recording = simulate_recording(
                "rotating-radar", int(rng.integers(2**31)), traffic=kind, duration=pairs.DURATION
            ).recording
            taken = clusters(recording, clustering_time_window(recording, traffic.ROTATION))
            own = [np.unique(taken.tracks[(recording.sources[taken.rows] == k) & taken.confirmed]) for k in (0, 1)]
            good.append(not np.isin(*own).any())
        what, share = f"{kind}: pairs whose plots share no track, spanning tree", 100.0 * float(np.mean(good))
        claims.append(Claim(what, "%", None, share, pairs.wilson(good), source=NAMED))
    return claims


if __name__ == "__main__":
    raise SystemExit(main("papers.clustering_time_window.spanning_tree", experiment, __doc__))

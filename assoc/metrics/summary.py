"""The metrics of tracks against a truth in one go, and errors of positions."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._text.shown import Shown
from assoc.metrics.gospa import gospa_over_time, mean_gospa
from assoc.metrics.identity import Identity, identity
from assoc.metrics.ospa import distances, ospa_over_time
from assoc.metrics.ospa2 import ospa2
from assoc.metrics.trajectories import Trajectories, epochs


@dataclass(frozen=True)
class Summary(Shown):
    """Averages over all instants, metres, and identity metrics.

    Attributes
    ----------
    gospa, gospa_localisation, gospa_missed, gospa_false : float
        Order 2, root mean squares over the instants: the squares of the parts add up to the square of the whole
        (see `mean_gospa`).
    ospa, ospa2 : float
        Order 1, means; OSPA(2) over windows of 10 instants.
    rmse : float
        Of tracks closer to their target than the cutoff; NaN without any.
    identity : Identity
    """

    gospa: float
    gospa_localisation: float
    gospa_missed: float
    gospa_false: float
    ospa: float
    ospa2: float
    rmse: float
    identity: Identity

    def to_dict(self) -> dict[str, float]:
        """All values, those of `identity` included, by name."""
        values = asdict(self)
        return {**{name: value for name, value in values.items() if name != "identity"}, **values["identity"]}


@explains_wrong_types
def summarise(truth: Trajectories, tracks: Trajectories, cutoff: float) -> Summary:
    """Compare tracks with the truth.

    Parameters
    ----------
    truth, tracks : Trajectories
    cutoff : float
        Metres: beyond this a track does not match a target.
    """
    _, values = gospa_over_time(truth, tracks, cutoff)
    parts = mean_gospa(values)
    means = []
    for _, of_instants in (ospa_over_time(truth, tracks, cutoff), ospa2(truth, tracks, cutoff)):
        means.append(float(np.mean([value.distance for value in of_instants])) if of_instants else 0.0)
    return Summary(
        gospa=parts["distance"],
        gospa_localisation=parts["localisation"],
        gospa_missed=parts["missed"],
        gospa_false=parts["false"],
        ospa=means[0],
        ospa2=means[1],
        rmse=track_rmse(truth, tracks, cutoff)[0],
        identity=identity(truth, tracks, cutoff),
    )


@explains_wrong_types
def track_rmse(truth: Trajectories, tracks: Trajectories, cutoff: float) -> tuple[float, dict[int, float]]:
    """Root mean square position error of tracks that are closer than a cutoff to their target.

    Targets and tracks are paired at each instant as GOSPA of order 2 pairs them.

    Returns
    -------
    overall : float
        Metres; NaN if nothing was paired.
    by_target : dict of int to float
        For each target that was ever paired.
    """
    squared: dict[int, list[float]] = {}
    _, values = gospa_over_time(truth, tracks, cutoff)
    for (_, rows, columns), pairing in zip(epochs(truth, tracks), values, strict=True):
        between = distances(truth.positions[rows], tracks.positions[columns])
        i = np.searchsorted(truth.ids[rows], pairing.pairs[:, 0])
        j = np.searchsorted(tracks.ids[columns], pairing.pairs[:, 1])
        for target, distance in zip(pairing.pairs[:, 0].tolist(), between[i, j].tolist(), strict=True):
            squared.setdefault(target, []).append(distance**2)
    every = [value for values in squared.values() for value in values]
    by_target = {target: float(np.sqrt(np.mean(values))) for target, values in sorted(squared.items())}
    return float(np.sqrt(np.mean(every))) if every else float("nan"), by_target

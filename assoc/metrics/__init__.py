"""How good tracks and associations are, against the truth."""

from __future__ import annotations

from assoc._system.imports import lazy_names
from assoc.metrics.ct_mt_it import CtMtIt, ct_mt_it
from assoc.metrics.gospa import Gospa, gospa, gospa_over_time, mean_gospa
from assoc.metrics.hota import Hota, hota
from assoc.metrics.identity import Identity, identity, label_switches
from assoc.metrics.ospa import Ospa, ospa, ospa_over_time
from assoc.metrics.ospa2 import ospa2
from assoc.metrics.plot_identity import identity_after_each, plot_identity_switches, tracks_of_one_identity
from assoc.metrics.summary import Summary, summarise, track_rmse
from assoc.metrics.trajectories import Trajectories

__all__ = [
    "CtMtIt",
    "Gospa",
    "Hota",
    "Identity",
    "Ospa",
    "Summary",
    "Trajectories",
    "ct_mt_it",
    "gospa",
    "gospa_over_time",
    "hota",
    "identity",
    "identity_after_each",
    "label_switches",
    "mean_gospa",
    "ospa",
    "ospa2",
    "ospa_over_time",
    "plot_identity_switches",
    "summarise",
    "track_rmse",
    "tracks_of_one_identity",
]

__getattr__, __dir__ = lazy_names(__name__, {})

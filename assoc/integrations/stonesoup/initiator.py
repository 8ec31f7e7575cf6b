"""Stone Soup's initiator of several measurements, for every hypothesiser and associator."""

from __future__ import annotations

from copy import copy
from typing import Any

from stonesoup.hypothesiser.mfa import MFAHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator

from assoc.integrations.stonesoup.associator import AssignmentAssociator


class AssignmentInitiator(MultiMeasurementInitiator):  # type: ignore[misc]
    """``MultiMeasurementInitiator`` that takes the associator of any tracker.

    Stone Soup's own needs an associator that gives each track a single hypothesis. This one associates its tentative
    tracks by an `AssignmentAssociator` with the hypothesiser of ``data_associator``, so that the associator of a
    tracker of mixtures (``PDA``, ``JPDA``) may be given, and one of several frames (``MFADataAssociator``, inside a
    ``GaussianMixtureInitiator``). An `AssignmentAssociator` is used as it is.
    """

    data_associator: Any

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if not isinstance(self.data_associator, AssignmentAssociator):
            self.data_associator = AssignmentAssociator(_of_one_state(self.data_associator.hypothesiser))


def _of_one_state(hypothesiser: Any) -> Any:
    """The hypothesiser, and those that it wraps, without the one of mixtures: tentative tracks are not yet mixtures."""
    inner = getattr(hypothesiser, "hypothesiser", None)
    if inner is None:
        return hypothesiser
    if isinstance(hypothesiser, MFAHypothesiser):
        return _of_one_state(inner)
    outer = copy(hypothesiser)
    outer.hypothesiser = _of_one_state(inner)
    return outer

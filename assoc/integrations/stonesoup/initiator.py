"""Stone Soup's initiator of several measurements, for every hypothesiser and associator."""

from __future__ import annotations

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
            hypothesiser = self.data_associator.hypothesiser
            # it hypothesises on mixtures, and tentative tracks are not yet mixtures
            if isinstance(hypothesiser, MFAHypothesiser):
                hypothesiser = hypothesiser.hypothesiser
            self.data_associator = AssignmentAssociator(hypothesiser)

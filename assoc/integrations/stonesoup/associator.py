"""Stone Soup's data association solved as an assignment problem of two dimensions, and its initiator with that."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from copy import copy
from datetime import datetime
from typing import Any

import numpy as np
from ordered_set import OrderedSet
from stonesoup.base import Property
from stonesoup.dataassociator.base import DataAssociator
from stonesoup.hypothesiser.mfa import MFAHypothesiser
from stonesoup.initiator.simple import MultiMeasurementInitiator
from stonesoup.types.hypothesis import Hypothesis, ProbabilityHypothesis
from stonesoup.types.track import Track

from assoc.errors import InvalidInputError
from assoc.integrations.stonesoup.ordering import sorted_detections, sorted_paths
from assoc.problem import AssignmentProblem
from assoc.solution import Solution
from assoc.solvers.assign import assign


class AssignmentAssociator(DataAssociator):  # type: ignore[misc]
    """Assign detections to tracks with any of our solvers; each track and each detection is used once.

    With hypotheses that have probabilities (``PDAHypothesiser``) the joint probability is maximised: the costs
    are negative log ratios of "this detection" to "missed". With distances (``DistanceHypothesiser``) their sum
    is minimised, a missed detection counting its ``missed_distance``; if that is infinite, as many tracks as
    possible get a detection.

    Attributes
    ----------
    solution : Solution or None
        The last solution, with its lower bound; None if there was nothing to choose.
    """

    solver: str = Property(default="exact", doc="One of ``assoc.solvers.names()``.")
    parameters: Mapping[str, Any] = Property(default_factory=dict, doc="Parameters of the solver.")
    seed: int = Property(default=0, doc="The same seed gives the same association.")
    time_limit: float = Property(default=None, doc="Seconds for each scan.")

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.solution: Solution | None = None

    def associate(
        self, tracks: Iterable[Track], detections: Iterable[Any], timestamp: datetime, **kwargs: Any
    ) -> dict[Track, Hypothesis]:
        """Associate tracks and detections.

        Parameters
        ----------
        tracks : set of Track
        detections : set of Detection
        timestamp : datetime
            Time of the prediction for missed detections.

        Returns
        -------
        dict of Track to Hypothesis
            Tracks for which the hypothesiser offers nothing are left out.
        """
        self.solution = None
        ordered = sorted_paths(tracks)
        found = OrderedSet(sorted_detections(detections))
        index = {id(detection): d for d, detection in enumerate(found, start=1)}
        offered = self.generate_hypotheses(ordered, found, timestamp, **kwargs)
        missed: dict[int, Hypothesis] = {}
        pairs: dict[tuple[int, int], Hypothesis] = {}
        for t, track in enumerate(ordered, start=1):
            for hypothesis in offered[track]:
                if hypothesis:
                    pairs[t, index[id(hypothesis.measurement)]] = hypothesis
                else:
                    missed[t] = hypothesis
        chosen = dict(missed)
        if pairs:
            problem = _problem(pairs, missed, (len(ordered), len(found)))
            self.solution = assign(
                problem, self.solver, seed=self.seed, time_limit=self.time_limit, advise=False, **self.parameters
            )
            for t, d in self.solution.tuples.tolist():
                if t and d:
                    chosen[t] = pairs[t, d]
        return {track: chosen[t] for t, track in enumerate(ordered, start=1) if t in chosen}


def _problem(
    pairs: Mapping[tuple[int, int], Hypothesis], missed: Mapping[int, Hypothesis], sizes: tuple[int, int]
) -> AssignmentProblem:
    """Tracks and detections as the two sensors of a problem; a single index is a missed track, or clutter."""
    kinds = {isinstance(hypothesis, ProbabilityHypothesis) for hypothesis in (*pairs.values(), *missed.values())}
    if len(kinds) > 1:
        raise InvalidInputError("hypotheses: some have probabilities and some distances, expected one kind")
    by_probability = kinds.pop()

    def cost(hypothesis: Hypothesis) -> float:
        return -float(hypothesis.probability.log_value) if by_probability else float(hypothesis.distance)

    costs = {pair: cost(hypothesis) for pair, hypothesis in pairs.items()}
    alone = {t: cost(missed[t]) if t in missed else math.inf for t, _ in pairs}
    finite = [abs(value) for value in (*costs.values(), *alone.values()) if math.isfinite(value)]
    # costs more than any choice that misses one track fewer
    forced = 2.0 * (sizes[0] + 1) * max(finite, default=0.0) + 1.0
    base = {t: value if math.isfinite(value) else forced for t, value in alone.items()}
    return AssignmentProblem(
        np.array(list(costs), dtype=np.int64),
        np.array([value - base[t] for (t, _), value in costs.items()]),
        sizes,
    )


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

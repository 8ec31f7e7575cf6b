"""The optimiser inside Stone Soup's multi-frame assignment, on any problem with dummies.

Stone Soup poses a problem of tracks and scans: each track takes one of its hypotheses (a measurement of each scan, or
none), each measurement is used once, and what no track uses is a false alarm at no cost. It is solved by dual
decomposition, a 2-D assignment a scan, and SCIP on what the scans do not agree about; at a gap of 2 % it stops.

Here the first sensor's measurements are the tracks, and each tuple without one is a track of its own that may also use
nothing. Costs are against false alarms; a track's are raised together so that its cheapest is at 0, since the rule of
2 % is meant for costs above 0.
"""

import importlib.util

import numpy as np

from assoc._types import Ints
from assoc.problem import AssignmentProblem
from experiments.common.packing_peers import Chosen, savings, with_false_alarms

# cells of its dense matrix of constraints (measurements and tracks by hypotheses)
_MOST_CELLS = 60_000_000


def _candidates(problem: AssignmentProblem) -> Ints:
    """Tuples of two measurements or more that save something, by their first index; those without one last."""
    count = (problem.tuples > 0).sum(axis=1)
    chosen = np.flatnonzero((savings(problem) > 0) & (count > 1))
    first = problem.tuples[chosen, 0]
    return chosen[np.argsort(np.where(first > 0, first, problem.sizes[0] + 1), kind="stable")]


def available(problem: AssignmentProblem) -> bool:
    """Whether Stone Soup is installed and its matrix is not too large."""
    if not problem.dummy or problem.num_sensors < 2 or importlib.util.find_spec("stonesoup") is None:
        return False
    chosen = _candidates(problem)
    lonely = int((problem.tuples[chosen, 0] == 0).sum())
    others = int(problem.sizes[1:].sum())
    tracks = int(problem.sizes[0]) + lonely
    hypotheses = chosen.size + tracks + 2 * others
    return (tracks + 2 * others) * hypotheses <= _MOST_CELLS


def multi_frame(problem: AssignmentProblem, time_limit: float) -> Chosen:
    """Choose tuples; it takes no time limit and gives no bound."""
    from stonesoup.dataassociator.mfa._init import Hyp, init_hyp_info
    from stonesoup.dataassociator.mfa._step import MAX_ITERATION_COUNT, AlgorithmState, algorithm_step

    window = problem.num_sensors - 1
    chosen = _candidates(problem)
    saved = savings(problem)
    by_track: dict[int, list[int]] = {index: [] for index in range(1, int(problem.sizes[0]) + 1)}
    lonely = int(problem.sizes[0])
    for place in chosen.tolist():
        first = int(problem.tuples[place, 0])
        if first == 0:
            lonely += 1
            first = lonely
        by_track.setdefault(first, []).append(place)
    hyps, places = [], []
    for track, own in enumerate(by_track.values()):
        most = max((float(saved[place]) for place in own), default=0.0)
        for place in [-1, *own]:
            history = [0] * window if place < 0 else problem.tuples[place, 1:].tolist()
            hyps.append(Hyp.create(track, most - (0.0 if place < 0 else float(saved[place])), history, window))
            places.append(place)
    # what no hypothesis uses is in none of its lists, and its lists must not be empty
    if not chosen.size:
        return with_false_alarms(problem, chosen), None, False
    info = init_hyp_info(hyps, window)
    state = AlgorithmState.initialise(window, len(info.hyps))
    for _ in range(MAX_ITERATION_COUNT):
        algorithm_step(state, info)
        if state.should_break:
            break
    best = [places[i] for i in state.get_best_hypothesis_indices() if i < len(places) and places[i] >= 0]
    return with_false_alarms(problem, np.array(sorted(best), dtype=np.intp)), None, False

"""Probabilities of pairs of tracks and measurements: sums over joint events, bounds, parts of tracks."""

from __future__ import annotations

from tests.mutations.faults.fault import Fault

_SWEEP = "assoc/ranking/pairs/sweep.py"
_EVENTS = "assoc/ranking/pairs/events.py"
_MESSAGES = "assoc/ranking/pairs/messages.py"
_PARTS = "assoc/tracking/track_parts.py"

_OF_PAIRS = "tests/ranking/test_pairs.py"
_OF_TRACKER = "tests/tracking/test_joint_probabilistic.py"

FAULTS = (
    Fault(
        "a member that stays alone weighs nothing in particular",
        _SWEEP,
        "table[i] = free[what] * table[with_it] + table[with_it | low]",
        "table[i] = table[with_it] + table[with_it | low]",
        _OF_PAIRS,
    ),
    Fault(
        "a member may be in two pairs",
        _SWEEP,
        "                if not i & low and not i & high:\n                    table[i | low | high] +=",
        "                if not i & low:\n                    table[i | low | high] +=",
        _OF_PAIRS,
    ),
    Fault(
        "weights are not relative to the best event's",
        _EVENTS,
        "np.exp(dual[graph.ends].sum(axis=1) - costs), np.exp(dual + log_free)",
        "np.exp(-costs), np.exp(log_free)",
        _OF_PAIRS,
    ),
    Fault(
        "pairs left out change nothing",
        _EVENTS,
        "np.add.at(width, first_label, most[out])",
        "np.add.at(width, first_label, 0.0)",
        _OF_PAIRS,
    ),
    Fault(
        "nothing stands for pairs left out",
        _EVENTS,
        "plan.kept, log_beliefs(graph, weight))",
        "plan.kept, log_beliefs(graph, weight) - 50.0)",
        _OF_PAIRS,
    ),
    Fault(
        "an upper bound with what is known to be too low",
        _MESSAGES,
        "_log_share(graph, v, x, log_weight, high[y], low)",
        "_log_share(graph, v, x, log_weight, low[y], low)",
        _OF_PAIRS,
    ),
    Fault(
        "a vertex hears itself",
        _MESSAGES,
        "        if y != but:\n            total +=",
        "        if True:\n            total +=",
        _OF_PAIRS,
    ),
    Fault(
        "belief propagation does not begin",
        _MESSAGES,
        "        next_round(graph, log_weight, said, heard)\n",
        "",
        _OF_PAIRS,
    ),
    Fault("the best part of a track stands for all", _PARTS, "np.logaddexp.at(mean", "np.maximum.at(mean", _OF_TRACKER),
    Fault(
        "what one sensor saw does not change a part's share",
        _PARTS,
        "within = self.share[parent] * np.exp(grown.gain - grown.pairs.gain[grown.pair])",
        "within = self.share[parent]",
        _OF_TRACKER,
    ),
    Fault(
        "a miss is not weighed against a detection",
        "assoc/tracking/joint_probabilistic.py",
        "odds = existence + missed + np.log1p(detected / np.maximum(there, 1e-300))",
        "odds = existence + np.log1p(detected / np.maximum(there, 1e-300))",
        _OF_TRACKER,
    ),
)

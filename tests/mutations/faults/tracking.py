"""Multiple hypothesis tracking: how hypotheses are found, weighed and cut."""

from __future__ import annotations

from tests.mutations.faults.fault import Fault

_PRUNING = "assoc/tracking/mht/pruning.py"
_SEARCH = "assoc/tracking/mht/best_hypothesis.py"
_LOSSES = "assoc/tracking/mht/losses.py"
_BRANCHES = "assoc/tracking/mht/branches.py"
_CLUSTERS = "assoc/tracking/mht/clusters.py"

_OF_HYPOTHESES = "tests/tracking/test_best_hypothesis.py"
_OF_CLUSTERS = "tests/tracking/test_clusters.py"

FAULTS = (
    # track trees
    Fault(
        "branches are kept by number, not by what they cost the best hypothesis",
        _PRUNING,
        "group = group[order_of(loss[group])]",
        "group = group[order_of(-loss[group])]",
        _OF_HYPOTHESES,
    ),
    Fault(
        "a tree in the making is cut for what it lacks",
        _PRUNING,
        "limit = drop + max(0.0, -score[group].max())",
        "limit = drop",
        _OF_HYPOTHESES,
    ),
    Fault("no branch is cut for its loss", _PRUNING, "if loss[group[rank]] <= limit:", "if True:", _OF_HYPOTHESES),
    Fault(
        "trees may take what has been decided for another",
        _PRUNING,
        "free = free and not taken[s, oldest[row, s]]",
        "free = free",
        _OF_HYPOTHESES,
    ),
    Fault(
        "branches stay that contradict the decision", _PRUNING, "kept[row] or same", "kept[row] or True", _OF_HYPOTHESES
    ),
    Fault(
        "two branches may take one measurement",
        _SEARCH,
        "        if m > 0 and used[first[c] + m - 1]:\n            return False\n",
        "        if False:\n            return False\n",
        _OF_HYPOTHESES,
    ),
    Fault(
        "the first hypothesis found is the best", _SEARCH, "bound < least - margin", "least == np.inf", _OF_HYPOTHESES
    ),
    Fault(
        "groups that took too long are not named",
        _SEARCH,
        "visits, chosen) < 0:",
        "visits, chosen) < -np.inf:",
        _OF_HYPOTHESES,
    ),
    Fault(
        "measurements have no price",
        _LOSSES,
        "contested[m] or (holder[m] >= 0",
        "contested[m] or (False",
        _OF_HYPOTHESES,
    ),
    Fault(
        "prices of trees with large scores never settle",
        _LOSSES,
        "np.minimum(np.maximum(START * spread(packing), 2.0 * _COLDEST), _HOTTEST)",
        "np.maximum(1e3 * START * spread(packing), 2.0 * _COLDEST)",
        _OF_HYPOTHESES,
    ),
    Fault(
        "no solver is asked where the search took too long", _BRANCHES, "if doubtful.size:", "if False:", _OF_HYPOTHESES
    ),
    # clusters of hypotheses
    Fault(
        "combinations are kept whatever may become of them",
        _CLUSTERS,
        "one.weight + one.holds @ potential[one.branches]",
        "one.weight",
        _OF_CLUSTERS,
    ),
    Fault(
        "hypotheses that differ in what is gone do not add up",
        _CLUSTERS,
        "np.logaddexp.at(weight",
        "np.maximum.at(weight",
        _OF_CLUSTERS,
    ),
    Fault(
        "what deleted tracks left behind is lost",
        _CLUSTERS,
        "holds @ score[own] + rest",
        "holds @ score[own]",
        _OF_CLUSTERS,
    ),
    Fault(
        "several stories of the oldest scan stay",
        _CLUSTERS,
        "(said == said[0]).all(axis=(1, 2))",
        "said[:, 0, 0] > -1",
        _OF_CLUSTERS,
    ),
)

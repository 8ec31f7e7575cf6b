"""The k best: enumeration, parts split on counts."""

from __future__ import annotations

from tests.mutations.faults.fault import Fault

_COMPONENT = "assoc/ranking/component_ranking.py"
_LEAVES = "assoc/packing/branching/leaves.py"
_ENUMERATION = "assoc/ranking/enumeration.py"

_OF_PARTS = "tests/ranking/test_ranking_in_parts.py"

FAULTS = (
    Fault(
        "enumeration begins above the node's bound",
        _COMPONENT,
        "work.trial.size, bound, own, True",
        "work.trial.size, bound + 0.2, own, True",
        _OF_PARTS,
    ),
    Fault(
        "a solution weighs what the multipliers say",
        _ENUMERATION,
        "                    weight = 0.0\n                    for t in range(count):",
        "                    weight = spent[depth]\n                    for t in range(0):",
        _OF_PARTS,
    ),
    Fault(
        "where there is nothing to ask a ranking branches on the last row",
        _COMPONENT,
        "if pair[0] < 0:",
        "if pair[0] < -1:",
        _OF_PARTS,
    ),
    Fault(
        "what another part has listed is listed again",
        _COMPONENT,
        "bound, own, True, store)",
        "bound, own, False, store)",
        _OF_PARTS,
    ),
    Fault(
        "parts of a ranking that wait have no bound",
        _COMPONENT,
        "min(cut, self._open.least_bound, waiting)",
        "min(cut, self._open.least_bound)",
        _OF_PARTS,
    ),
    Fault(
        "parts of a ranking that wait are forgotten",
        _COMPONENT,
        "return self._open.count == 0 and not self._waiting",
        "return self._open.count == 0",
        _OF_PARTS,
    ),
    Fault(
        "what was given up in one part is forgotten in the next",
        _LEAVES,
        "    nodes.given_up = given_up\n",
        "",
        _OF_PARTS,
    ),
)

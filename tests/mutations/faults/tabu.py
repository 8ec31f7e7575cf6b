"""Tabu search."""

from __future__ import annotations

from tests.mutations.faults.fault import Fault

_TABU = "assoc/solvers/tabu/moves.py"

_OF_TABU = "tests/solvers/test_tabu.py"

FAULTS = (
    Fault(
        "tenure is 0",
        _TABU,
        "until[ejected[i]] = clock + tenure + rng.integers(0, tenure + 1)",
        "until[ejected[i]] = clock",
        _OF_TABU,
    ),
    Fault(
        "no aspiration", _TABU, "(until[j] < clock or current + gain[j] < record - 1e-9)", "until[j] < clock", _OF_TABU
    ),
    Fault(
        "what is tabu is chosen all the same",
        _TABU,
        "(until[j] < clock or current + gain[j] < record - 1e-9)",
        "until[j] > -1",
        _OF_TABU,
    ),
    Fault(
        "the worst insertion is made",
        _TABU,
        "if gain[j] < least and (until",
        "if -gain[j] < least and (until",
        _OF_TABU,
    ),
    Fault(
        "open rows stay open",
        _TABU,
        "            if fill >= 0 and num",
        "            if False and fill >= 0 and num",
        _OF_TABU,
    ),
    Fault(
        "gains are not kept up to date",
        _TABU,
        "                gain[row_cols[k]] = insertion_gain(cols, weights, owner, row_cols[k])\n",
        "                pass\n",
        _OF_TABU,
    ),
    Fault("a forced column is not held", _TABU, "held = forced if 3 * move < moves else -1", "held = -1", _OF_TABU),
    Fault(
        "the best cover met is not kept", _TABU, "            copy_to(best, owner)\n", "            pass\n", _OF_TABU
    ),
    Fault(
        "never back to the best",
        _TABU,
        "                self.owner = component.best.copy()\n                forced",
        "                forced",
        _OF_TABU,
    ),
    Fault("never a new cover", _TABU, "if self.restarts % _FRESH == 0:", "if False:", _OF_TABU),
    Fault("the tabu list outlives a restart", _TABU, "            self.until[:] = 0\n", "", _OF_TABU),
    Fault("rows are forced whatever they cost", _TABU, "p=excess / total", "p=None", _OF_TABU),
)

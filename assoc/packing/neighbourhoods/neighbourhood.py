"""What every way to improve a cover has in common.

A new one is a file in this folder with a class of this form, and an entry in `NEIGHBOURHOODS`
(components/component.py), which says when it is tried and how often.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from assoc.packing.bounds.priced import Priced


class Neighbourhood(Protocol):
    """A way to improve a cover of one component; may keep a state from one call to the next."""

    def __init__(self, priced: Priced) -> None: ...

    def improve(
        self,
        priced: Priced,
        owner: NDArray[np.int32],
        weight: float,
        rng: np.random.Generator,
        tries: int,
        deadline: float = np.inf,
    ) -> float:
        """Improve a complete cover in place, never for the worse.

        Parameters
        ----------
        priced : Priced
            The component.
        owner : int32 array, shape (R,)
            The chosen column of each row, or -1; every row without slack is covered.
        weight : float
            Its weight.
        rng : Generator
        tries : int
            How much to try.
        deadline : float
            Nothing is begun after this (clock.py).

        Returns
        -------
        float
            The weight of the cover then.
        """
        ...

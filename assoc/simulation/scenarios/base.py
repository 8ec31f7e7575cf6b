"""What the scenarios share: checks of their parameters."""

from __future__ import annotations

import math
from typing import Any

from assoc.errors import InvalidInputError


class ScenarioParameters:
    """Base of the scenarios' parameter dataclasses; gives them one way to check and to complain."""

    def _whole(self, *names: str, least: int = 1, most: int = 10_000_000) -> None:
        """Refuse fields that are not whole numbers from least to most."""
        for name in names:
            value: Any = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
                raise InvalidInputError(
                    f"{name}: expected a whole number from {least} to {most}, got {value!r}"
                )

    def _number(self, *names: str, above: float = -math.inf, least: float = -math.inf) -> None:
        """Refuse fields that are not finite numbers above a limit, or at least a limit."""
        expected = f"a number above {above:g}" if above > -math.inf else f"a number, at least {least:g}"
        for name in names:
            value: Any = getattr(self, name)
            good = isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)
            if not good or not (value > above and value >= least):
                raise InvalidInputError(f"{name}: expected {expected}, got {value!r}")

    def _probability(self, *names: str) -> None:
        """Refuse fields that are not strictly between 0 and 1."""
        for name in names:
            value: Any = getattr(self, name)
            if not isinstance(value, (int, float)) or not 0 < value < 1:
                raise InvalidInputError(f"{name}: expected a number strictly between 0 and 1, got {value!r}")

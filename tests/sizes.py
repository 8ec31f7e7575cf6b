"""How much of a test `make test` does: a sample. `make test-all` does all of it."""

from collections.abc import Iterable
from typing import Any

import pytest


def few_or_all(name: str, few: Any, whole: Any) -> Any:
    """Give a test a small number as its argument ``name``, or, where slow tests run, the whole number."""
    whole_one = pytest.param(whole, marks=pytest.mark.slow)
    return pytest.mark.parametrize(name, [pytest.param(few, marks=pytest.mark.few), whole_one])


def sample(name: str, cases: Iterable[Any], every: int) -> Any:
    """Give a test all cases, of which all but the first of each ``every`` are slow tests."""
    values = [case if "," in name else (case,) for case in cases]
    marks = [() if place % every == 0 else (pytest.mark.slow,) for place in range(len(values))]
    chosen = [pytest.param(*one, marks=own) for one, own in zip(values, marks, strict=True)]
    return pytest.mark.parametrize(name, chosen)

"""What tests of experiments share."""

from collections.abc import Iterator

import pytest

from assoc.solvers import registry


@pytest.fixture(autouse=True)
def _same_solvers() -> Iterator[None]:
    """Forget the solvers that an experiment registers: later tests ask for all names."""
    known = dict(registry._REGISTERED)
    yield
    registry._REGISTERED.clear()
    registry._REGISTERED.update(known)

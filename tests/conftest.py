"""What all tests share."""

import contextlib
import os
import signal
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings

from assoc.solvers import registry

# fixtures of several folders
pytest_plugins = ["tests.dask_cluster"]

# tests are of compiled kernels, and what they start is not to compile beside them; those of interpreting switch it on
os.environ.setdefault("ASSOC_INTERPRET", "0")

# the first example pays for compilation, and machines differ: clocks would only find that out. The same examples each
# time; `pytest --hypothesis-profile=search` tries others
settings.register_profile("search", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("assoc", settings.get_profile("search"), derandomize=True)
settings.load_profile("assoc")

# a job in the background ignores Ctrl-C, and so would the programs that the tests start
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def _same_signals() -> Iterator[None]:
    """Fail a test that changes what signals do: processes of later tests would inherit it, and not hear Ctrl-C."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ()), signal.getsignal(signal.SIGINT)
    yield
    after = signal.pthread_sigmask(signal.SIG_BLOCK, ()), signal.getsignal(signal.SIGINT)
    signal.pthread_sigmask(signal.SIG_SETMASK, before[0])
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, before[1])
    assert after == before, "the test left signals blocked or handled"


@pytest.fixture(autouse=True)
def _same_solvers() -> Iterator[None]:
    """Forget the solvers that a test registers, which cannot be taken back otherwise: later tests ask for all names."""
    known = dict(registry._REGISTERED)
    yield
    registry._REGISTERED.clear()
    registry._REGISTERED.update(known)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Where slow tests run, leave out the few cases of a test that has all of them, too (sizes.py)."""
    if config.option.markexpr:
        return
    few = [item for item in items if item.get_closest_marker("few")]
    config.hook.pytest_deselected(items=few)
    items[:] = [item for item in items if not item.get_closest_marker("few")]

"""Optional dependencies: imported on use; the error for a missing one gives the command that installs it."""

from __future__ import annotations

import importlib
from importlib.util import find_spec
from types import ModuleType

from assoc.errors import MissingExtraError


def check_extra(package: str, extra: str) -> None:
    """Raise at once, without importing anything, if an optional package is missing.

    Parameters
    ----------
    package : str
        Name of the top-level package.
    extra : str
        The extra of assoc that installs it.

    Raises
    ------
    MissingExtraError
        An ImportError; its message names the command.
    """
    try:
        found = find_spec(package) is not None
    except (ImportError, ValueError):  # ValueError: sys.modules holds None
        found = False
    if not found:
        raise MissingExtraError(f"{package} is not installed: python -m pip install 'assoc[{extra}]'")


def load_extra(module: str, extra: str) -> ModuleType:
    """Import a module of an optional package, or raise as `check_extra` does."""
    check_extra(module.partition(".")[0], extra)
    return importlib.import_module(module)

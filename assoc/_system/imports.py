"""Imports on first use: public names of packages (PEP 562), so that importing them is quick, and optional packages."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from types import ModuleType
from typing import Any, NoReturn

from assoc._text.removed import removed
from assoc.errors import MissingExtraError, RemovedError


def lazy_names(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a package, given the public names, with blanks, that a module defines.

    Modules are within the package, or elsewhere if they begin with ``assoc.``; the names of "" are subpackages.
    """
    content = vars(sys.modules[package])
    home_of = {name: home for home, names in homes.items() for name in names.split()}

    def load(name: str) -> Any:
        if name not in home_of:
            if line := removed(f"{package}.{name}"):
                # from package import name hides what an AttributeError says
                raise RemovedError(line)
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        home = home_of[name] or name
        module = importlib.import_module(home if home.startswith("assoc.") else f"{package}.{home}")
        content[name] = value = getattr(module, name) if home_of[name] else module
        return value

    def names() -> list[str]:
        # names that the package imports for itself are not offered
        return sorted({*home_of, *content.get("__all__", ()), *(name for name in content if name.startswith("__"))})

    return load, names


def removed_attribute(owner: object, name: str) -> NoReturn:
    """As ``__getattr__`` of a class: say what to use instead of an attribute that existed once."""
    lines = (removed(f"{kind.__name__}.{name}") for kind in type(owner).__mro__)
    usual = f"{type(owner).__name__!r} object has no attribute {name!r}"
    raise AttributeError(next(filter(None, lines), usual), name=name, obj=owner)


def check_extra(package: str, extra: str) -> None:
    """Raise `MissingExtraError`, without importing anything, if a package that an extra installs is missing."""
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

"""Public names of a package that are loaded on first use (PEP 562), so that importing the package is quick."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Mapping
from typing import Any


def lazy_names(package: str, homes: Mapping[str, str]) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return the functions ``__getattr__`` and ``__dir__`` of a package.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    homes : mapping
        The module that defines each public name: within the package, or elsewhere if it begins with ``assoc.``.
        A name without a module is a subpackage.

    Returns
    -------
    __getattr__, __dir__ : callables
        To be assigned in the package.
    """
    content = vars(sys.modules[package])

    def load(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        home = homes[name]
        module = importlib.import_module(home if home.startswith("assoc.") else f"{package}.{home}")
        content[name] = value = module if home == name else getattr(module, name)
        return value

    def names() -> list[str]:
        # names that the package imports for itself are not offered
        return sorted({*homes, *content.get("__all__", ()), *(name for name in content if name.startswith("__"))})

    return load, names

"""Public names of a package that are loaded on first use (PEP 562), so that importing the package stays quick."""

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
        For each public name the module that defines it, within the package or, with ``assoc.`` before it, in another
        one; the name of a subpackage, which has no other home, stands for itself.

    Returns
    -------
    __getattr__, __dir__ : callables
        What the package must call them.
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
        # what the package itself imports is not offered
        return sorted({*homes, *content.get("__all__", ()), *(name for name in content if name.startswith("__"))})

    return load, names

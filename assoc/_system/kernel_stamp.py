"""Digest of all that compiled code depends on: the kernel, the functions it reaches, and its constants.

numba freezes into a kernel the functions and constants that it names, directly or through other functions, in any file.
So the digest follows names through the modules' globals, when a kernel is first loaded or compiled and all names are
defined. Docstrings, comments, annotations and line numbers are left out. Where a name stands for an object of an
unknown kind (seldom), the digest covers the source of the whole package: compiling too often is better than stale code.
"""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Mapping
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

_PACKAGE = Path(__file__).resolve().parents[1]
_PLAIN = (int, float, complex, str, bytes, type(None), type(Ellipsis))


class KernelStamp:
    """The digest of a kernel as text, computed on first use and not on import."""

    def __init__(self, kernel: FunctionType, options: Mapping[str, object]) -> None:
        self._kernel = kernel
        self._options = sorted(options.items())

    def __str__(self) -> str:
        return f"{self._options} {_Reached().digest(self._kernel)}"

    def __eq__(self, other: object) -> bool:
        return str(self) == str(other)

    def __reduce__(self) -> Any:
        return str, (str(self),)


def argument_kinds(kinds: Any) -> tuple[Any, ...]:
    """Return what compiled code depends on in its argument types and what these types do not compare.

    That is the order of a record's fields, and the code of kernels that are passed as arguments.
    """
    found: list[Any] = []
    for kind in kinds:
        record, kernel = getattr(kind, "instance_class", None), getattr(kind, "dispatcher", None)
        if record is not None:
            found.append((record.__module__, record.__qualname__, getattr(record, "_fields", ())))
        if kernel is not None:
            found.append(_Reached().digest(kernel.py_func))
        found.extend(argument_kinds(getattr(kind, "types", ())))
    return tuple(found)


class _Reached:
    """All that a kernel reaches, one line each."""

    def __init__(self) -> None:
        self._lines: list[str] = []
        self._seen: set[Any] = set()

    def digest(self, function: FunctionType) -> str:
        try:
            self._add_function(function)
        except _UnknownError:
            return "whole package " + _package_digest()
        return hashlib.sha256("\n".join(self._lines).encode()).hexdigest()

    def _add_function(self, function: FunctionType) -> None:
        if id(function) in self._seen:
            return
        self._seen.add(id(function))
        if function.__closure__:
            raise _UnknownError
        names: set[str] = set()
        text = _code(function.__code__, function.__doc__, names)
        self._lines.append(f"{function.__module__} {function.__qualname__} {text}")
        self._add("defaults", (function.__defaults__, tuple(sorted((function.__kwdefaults__ or {}).items()))), names)
        # names include attributes: a superfluous name does no harm
        for name in sorted(names & function.__globals__.keys()):
            self._add(name, function.__globals__[name], names)

    def _add(self, name: str, value: Any, names: set[str]) -> None:
        """Describe what a name stands for; of a module only the attributes among ``names``."""
        if isinstance(value, _PLAIN):
            self._lines.append(f"{name} {type(value).__name__} {value!r}")
        elif isinstance(value, (np.ndarray, np.generic)) and value.dtype != object:
            self._lines.append(f"{name} {value.dtype} {value.shape} {value.tobytes().hex()}")
        elif isinstance(value, type):
            self._add_class(name, value, names)
        elif isinstance(value, tuple):
            self._lines.append(f"{name} {type(value).__qualname__} {len(value)}")
            for index, item in enumerate(value):
                self._add(f"{name}.{index}", item, names)
        elif isinstance(value, (BuiltinFunctionType, np.ufunc)) or _is_foreign(value):
            self._lines.append(f"{name} {getattr(value, '__module__', '')} {_called(value)}")
        elif isinstance(getattr(value, "py_func", None), FunctionType):
            self._lines.append(f"{name} is {value.py_func.__module__} {value.py_func.__qualname__}")
            self._add_function(value.py_func)
        elif isinstance(value, FunctionType):
            self._lines.append(f"{name} is {value.__module__} {value.__qualname__}")
            self._add_function(value)
        elif isinstance(value, ModuleType):
            used = frozenset(names & vars(value).keys())
            if (id(value), used) not in self._seen:
                self._seen.add((id(value), used))
                for item in sorted(used):
                    self._add(f"{value.__name__}.{item}", vars(value)[item], names)
        else:
            # numba's declaration of a system function is complete in itself
            symbol, declared = getattr(value, "symbol", None), getattr(value, "sig", None)
            if symbol is None or declared is None:
                raise _UnknownError
            self._lines.append(f"{name} {symbol} {declared}")

    def _add_class(self, name: str, value: type, names: set[str]) -> None:
        fields = getattr(value, "_fields", None)
        if fields is None and not _is_foreign(value):
            raise _UnknownError
        self._lines.append(f"{name} {value.__module__} {value.__qualname__} {fields}")
        self._add(f"{name} defaults", tuple(getattr(value, "_field_defaults", {}).values()), names)


class _UnknownError(Exception):
    """A name stands for an object of a kind that the digest cannot describe."""


def _code(code: CodeType, docstring: str | None, names: set[str]) -> str:
    """Describe code, and add the names that it uses to ``names``."""
    names.update(code.co_names)
    constants = list(code.co_consts)
    if docstring is not None and constants and constants[0] == docstring:
        constants[0] = None
    described = [_constant(constant, names) for constant in constants]
    arguments = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags)
    steps = f"{code.co_code.hex()} {code.co_exceptiontable.hex()}"
    return f"{arguments} {code.co_varnames} {code.co_names} {described} {steps}"


def _constant(value: Any, names: set[str]) -> str:
    if isinstance(value, CodeType):
        return _code(value, None, names)
    if isinstance(value, tuple):
        return "(" + ", ".join(_constant(item, names) for item in value) + ")"
    if isinstance(value, frozenset):
        return f"set {sorted(map(repr, value))}"
    return f"{type(value).__name__} {value!r}"


def _is_foreign(value: Any) -> bool:
    """Whether an object belongs to a library whose changes numba and Python detect themselves."""
    module = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
    return isinstance(module, str) and module.split(".")[0] in ("builtins", "math", "numpy", "cmath", "operator")


def _called(value: Any) -> str:
    return str(getattr(value, "__qualname__", getattr(value, "__name__", "")))


@functools.cache
def _package_digest() -> str:
    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(_PACKAGE)} {len(content)}\n".encode() + content)
    return digest.hexdigest()

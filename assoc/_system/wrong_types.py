"""One-line errors for arguments of a wrong type to public functions: they name the argument and what was expected.

A function decorated with `explains_wrong_types` checks ranges and shapes itself. An object of an unexpected type makes
Python raise somewhere inside; then the decorator finds the argument that does not fit its annotation and names it.
Correct calls cost nothing.
"""

from __future__ import annotations

import builtins
import functools
import inspect
import reprlib
import sys
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from numbers import Integral, Real
from typing import Any, Literal, TypeVar, Union

import numpy as np
from numpy.typing import ArrayLike

from assoc._text.removed import removed
from assoc.errors import AssocError, InvalidInputError

Decorated = TypeVar("Decorated", bound=Callable[..., Any])

_ERRORS = (TypeError, AttributeError, ValueError, IndexError, KeyError, OverflowError)
_LISTS = (list, tuple, Sequence, Iterable)
# elements of a list that are checked
_SOME = 1000


def explains_wrong_types(decorated: Decorated) -> Decorated:
    """Make a public function raise one `InvalidInputError` for arguments of a wrong type.

    Of a class: its constructor and its public methods.
    """
    if not isinstance(decorated, type):
        return typing.cast(Decorated, _explaining(decorated))
    for name, value in [*vars(decorated).items()]:
        if name == "__init__" or not name.startswith("_"):
            if isinstance(value, types.FunctionType):
                setattr(decorated, name, _explaining(value))
            elif isinstance(value, classmethod):
                setattr(decorated, name, classmethod(_explaining(value.__func__)))
    return decorated


def _explaining(function: Callable[..., Any]) -> Callable[..., Any]:
    @functools.wraps(function)
    def explaining(*args: Any, **keywords: Any) -> Any:
        try:
            return function(*args, **keywords)
        except _ERRORS as error:
            wrong = None if isinstance(error, AssocError) else _wrong_argument(function, args, keywords)
            if wrong is None:
                raise
            raise InvalidInputError(wrong) from error

    return explaining


def _wrong_argument(function: Callable[..., Any], args: Sequence[Any], keywords: Mapping[str, Any]) -> str | None:
    """Describe the first argument that does not fit its annotation; None if all do."""
    signature = inspect.signature(function)
    try:
        bound = signature.bind(*args, **keywords).arguments
    except TypeError:
        lines = (removed(f"{function.__qualname__.removesuffix('.__init__')}({name})") for name in keywords)
        return next(filter(None, lines), None)  # too many or too few arguments: Python's message is good
    kinds = annotations_of(function)
    for name, value in bound.items():
        parameter = signature.parameters[name]
        if parameter.kind is parameter.VAR_KEYWORD:
            continue
        for argument in value if parameter.kind is parameter.VAR_POSITIONAL else [value]:
            if not fits(argument, kinds.get(name, Any)):
                return f"{name}: expected {parameter.annotation}, got {' '.join(reprlib.repr(argument).split())}"
    return None


class _Unloaded(type):
    """A class or module imported only for type checkers: known by its name."""

    def __getattr__(cls, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return _Unloaded(name, (), {})

    def __getitem__(cls, item: Any) -> Any:
        return cls


class _Names(dict[str, Any]):
    """The names of a module, including those imported only for type checkers."""

    def __missing__(self, name: str) -> Any:
        if hasattr(builtins, name):
            raise KeyError(name)
        return _Unloaded(name, (), {})


def annotations_of(function: Callable[..., Any]) -> dict[str, Any]:
    names = _Names(vars(sys.modules[function.__module__]))
    found = {}
    # the annotations of a dataclass's constructor are strings, too
    for name, text in inspect.get_annotations(function).items():
        try:
            found[name] = eval(text, {}, names) if isinstance(text, str) else text
        except Exception:  # an annotation that cannot be evaluated is not checked
            found[name] = Any
    return found


def fits(value: Any, kind: Any) -> bool:
    """Whether a value fits the annotation ``kind``; for an array, whatever numpy can convert."""
    if kind == ArrayLike:
        return _makes_array(value)
    origin, inner = typing.get_origin(kind), typing.get_args(kind)
    if kind is Any or kind is object or isinstance(kind, (TypeVar, str)):
        return True
    if kind is None or kind is type(None):
        return value is None
    if origin in (Union, types.UnionType):
        return any(fits(value, item) for item in inner)
    if origin is Literal:
        return any(type(value) is type(item) and value == item for item in inner)
    if origin is np.ndarray or kind is np.ndarray:
        return _makes_array(value)
    if origin is Callable or kind is Callable:
        return callable(value)
    if origin in _LISTS or kind in _LISTS:
        if isinstance(value, (str, bytes, Mapping)) or not isinstance(value, Iterable):
            return False
        element = inner[0] if inner and not (origin is tuple and len(inner) > 1 and inner[1] is not ...) else Any
        return not isinstance(value, Sequence) or all(fits(item, element) for item in value[:_SOME])
    kind = origin or kind
    if kind is float:
        return isinstance(value, Real) and not isinstance(value, bool)
    if kind is int:
        return isinstance(value, Integral) and not isinstance(value, bool)
    if kind is bool:
        return isinstance(value, (bool, np.bool_))
    if isinstance(kind, _Unloaded):
        return kind.__name__ in [item.__name__ for item in type(value).__mro__]
    if getattr(kind, "_is_protocol", False) or not isinstance(kind, type):
        return True
    return isinstance(value, kind)


def _makes_array(value: Any) -> bool:
    try:
        array = np.asarray(value)
        return array.ndim > 0 and (array.dtype.kind in "biufmM" or not array.size)
    except (TypeError, ValueError):
        return False

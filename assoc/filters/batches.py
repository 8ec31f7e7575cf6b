"""Batches of targets selected, joined, and turned into plain arrays and back.

They work for the state of any filter: a dataclass of arrays whose first axis is the target.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any, Self

import numpy as np

from assoc._types import Array
from assoc.filters.state import Gaussian


def arrays_of(state: Any) -> dict[str, Array]:
    """Return the arrays that a state holds, each with the targets along its first axis."""
    found, count = {}, len(state)
    for name in _names(type(state)):
        value = getattr(state, name)
        # values common to all targets may be stored once
        if len(value) != count:
            value = np.broadcast_to(value, (count, *value.shape[1:]))
        found[name] = value
    return found


_known_names: dict[type, tuple[str, ...]] = {}


def _names(kind: type) -> tuple[str, ...]:
    """Names of a state's arrays, kept: a tracker asks for them some hundred times a scan."""
    if kind not in _known_names:
        _known_names[kind] = tuple(field.name for field in fields(kind))
    return _known_names[kind]


def state_from(kind: type, arrays: Mapping[str, Array]) -> Any:
    """Make a state of this class from its arrays, without checking them again."""
    made: Any = object.__new__(kind)
    for name, value in arrays.items():
        made.__dict__[name] = np.ascontiguousarray(value)
    return made


class Batch:
    """Length, selection and text of a state."""

    def __len__(self) -> int:
        return len(getattr(self, _names(type(self))[0]))

    def __getitem__(self, rows: Any) -> Self:
        """Return the targets that an index array, mask or slice selects."""
        made, count = object.__new__(type(self)), len(self)
        for name in _names(type(self)):
            value = getattr(self, name)
            if len(value) != count:
                value = np.broadcast_to(value, (count, *value.shape[1:]))
            made.__dict__[name] = np.ascontiguousarray(value[rows])
        return made

    def __repr__(self) -> str:
        shape = getattr(self, _names(type(self))[0]).shape
        return f"{type(self).__name__}({' x '.join(map(str, shape))})"


def concatenate(states: Sequence[Any]) -> Any:
    """Return one batch with the targets of several of one filter, at least one.

    Histories that some do not have yet are filled with zeros.
    """
    present = [state for state in states if len(state)] or list(states[:1])
    if len(present) == 1:
        return present[0]
    if isinstance(present[0], Gaussian):
        return Gaussian.concatenate(present)
    parts = [arrays_of(state) for state in present]
    joined = {}
    for name in parts[0]:
        values = [part[name] for part in parts]
        if len({value.shape[1:] for value in values}) > 1:
            shape = np.max([value.shape[1:] for value in values], axis=0)
            values = [_padded(value, shape) for value in values]
        joined[name] = np.concatenate(values)
    return state_from(type(present[0]), joined)


def placed(count: int, parts: Iterable[tuple[Array | slice, Any]]) -> Any:
    """One batch of `count` targets, at least one part, of parts with the rows (K,) that they take, later ones last.

    Parts may be made one after the other: none is needed any longer once it stands where it belongs. Histories that
    some do not have yet are filled with zeros.
    """
    joined: dict[str, Array] = {}
    for rows, state in parts:
        kind = type(state)
        for name, value in arrays_of(state).items():
            shape = value.shape[1:]
            if name not in joined:
                joined[name] = np.empty((count, *shape), dtype=value.dtype)
            elif joined[name].shape[1:] != shape:
                most = np.maximum(joined[name].shape[1:], shape)
                joined[name], value = _padded(joined[name], most), _padded(value, most)
            joined[name][rows] = value
    return state_from(kind, joined)


def _padded(value: Array, shape: Array) -> Array:
    return np.pad(value, [(0, 0), *((0, int(width)) for width in shape - value.shape[1:])])

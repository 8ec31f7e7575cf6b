"""Metadata of a scene file: its origin on the earth, notes, and names of targets."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from assoc._files.npz import Field
from assoc._types import Array
from assoc.errors import InvalidInputError

METADATA_FIELDS = {
    "origin": Field("float", 1, required=False),
    "note_texts": Field("str", 1, required=False),
    "note_counts": Field("int", 1, required=False),
    "truth_named_ids": Field("int", 1, required=False),
    "truth_names": Field("str", 1, required=False),
}
"""Readers that do not know them leave them out."""


def metadata_arrays(parts: Mapping[str, Any]) -> dict[str, Array]:
    """Return the fields of a scene's attributes; only those that are not empty."""
    arrays: dict[str, Array] = {}
    if parts["origin"] is not None:
        arrays["origin"] = np.array(parts["origin"])
    if parts["notes"]:
        arrays["note_texts"] = np.array(list(parts["notes"]))
        arrays["note_counts"] = np.array(list(parts["notes"].values()), dtype=np.int64)
    names = parts["truth"]["names"] if parts["truth"] is not None else {}
    if names:
        arrays["truth_named_ids"] = np.array(list(names), dtype=np.int64)
        arrays["truth_names"] = np.array(list(names.values()))
    return arrays


def metadata_parts(arrays: Mapping[str, Array]) -> dict[str, Any]:
    """Return "origin" and "notes" of a scene, and "names" of its truth."""
    origin = tuple(arrays["origin"].tolist()) if "origin" in arrays else None
    return {
        "origin": origin,
        "notes": _pairs(arrays, "note_texts", "note_counts"),
        "names": _pairs(arrays, "truth_named_ids", "truth_names"),
    }


def _pairs(arrays: Mapping[str, Array], keys: str, values: str) -> dict[Any, Any]:
    if (keys in arrays) != (values in arrays):
        raise InvalidInputError(f"the field {values if keys in arrays else keys!r} is missing")
    if keys not in arrays:
        return {}
    if len(arrays[keys]) != len(arrays[values]):
        raise InvalidInputError(
            f"the field {values!r} has {len(arrays[values])} values, expected {len(arrays[keys])} as {keys!r} has"
        )
    return dict(zip(arrays[keys].tolist(), arrays[values].tolist(), strict=True))

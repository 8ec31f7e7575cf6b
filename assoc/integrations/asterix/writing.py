"""Write plots of a recording as ASTERIX, category 048."""

from __future__ import annotations

import math
import os
from typing import Any

import numpy as np

from assoc._files.output import write_atomically
from assoc._system.imports import check_extra
from assoc._system.wrong_types import explains_wrong_types
from assoc.errors import InvalidInputError
from assoc.integrations.asterix.blocks import edition
from assoc.integrations.asterix.items import ANGLE_STEP, LEVEL_STEP, RANGE_STEP, SECOND
from assoc.integrations.asterix.reading import Source
from assoc.recordings.columns import DAY
from assoc.recordings.recording import UNDECODED, Recording

_IN_A_BLOCK = 100


def time_of_day(seconds: float) -> int:
    """Time of day in steps of 1/128 s."""
    return round(seconds / SECOND) % round(DAY / SECOND)


def check_source(source: Source) -> None:
    """Check a system area code and a system identification code."""
    if len(source) != 2 or not all(isinstance(number, int) and 0 <= number <= 255 for number in source):
        raise InvalidInputError(f"source: expected SAC and SIC, whole numbers from 0 to 255, got {source!r}")


def write_blocks(path: str | os.PathLike[str], category: int, contents: list[dict[str, Any]]) -> None:
    """Write records (contents by item) in data blocks of up to 100; the file appears whole or not at all."""
    kind = edition(category)
    made = [kind.cv_record.create(content) for content in contents]
    blocks = [kind.create(made[k : k + _IN_A_BLOCK]) for k in range(0, len(made), _IN_A_BLOCK)]
    content = b"".join(block.unparse().to_bytes() for block in blocks)
    write_atomically(path, lambda file: file.write(content))


@explains_wrong_types
def write_plots(path: str | os.PathLike[str], recording: Recording, source: Source = (0, 1)) -> None:
    """Write a recording as plots of category 048, with its resolutions: 1/128 s, 1/256 nmi, 0.0055 deg, 25 ft.

    Parameters
    ----------
    path : path-like
    recording : Recording
        Ranges below 256 nmi, altitudes within 62 km, identities of 12 bits, addresses of 24.
    source : (int, int)
        System area code and system identification code of the radar.

    Raises
    ------
    InvalidInputError
        A plot is too far for the category or too high, an identity or address too large, or the file cannot be
        written.
    MissingExtraError
        libasterix is not installed.
    """
    check_extra("asterix", "asterix")
    check_source(source)
    rho = np.round(recording.ranges / RANGE_STEP).astype(np.int64)
    if len(rho) and rho.max() > 65535:
        raise InvalidInputError(f"recording: a plot at {recording.ranges.max():g} m, expected less than 256 nmi")
    # one that is too large would be read as another aircraft's
    for name, bits in (("identities", 12), ("addresses", 24)):
        most = int(getattr(recording, name).max(initial=0))
        if most >> bits:
            hint = "; octal digits are read from a column mode3_oct" if name == "identities" else ""
            raise InvalidInputError(f"recording: {name} of category 048 have {bits} bits, got {most}{hint}")
    theta = np.round((math.pi / 2 - recording.azimuths) / ANGLE_STEP).astype(np.int64) % 65536
    levels = np.round(recording.altitudes / LEVEL_STEP)
    wide = ~np.isnan(levels) & ((levels < -8192) | (levels > 8191))
    if wide.any():
        got, expected = recording.altitudes[wide][0], f"at most {8191 * LEVEL_STEP:g} m in size for category 048"
        raise InvalidInputError(f"recording: an altitude of {got:g} m, expected {expected}")
    contents = []
    for k, time in enumerate(recording.times.tolist()):
        content: dict[str, Any] = {
            "010": (("SAC", source[0]), ("SIC", source[1])),
            "140": time_of_day(time),
            "040": (("RHO", int(rho[k])), ("THETA", int(theta[k]))),
        }
        if recording.identities[k] != UNDECODED:
            content["070"] = (0, 0, 0, 0, ("MODE3A", int(recording.identities[k])))
        if not math.isnan(levels[k]):
            content["090"] = (0, int(recording.garbled[k]), ("FL", int(levels[k]) & 0x3FFF))
        if recording.addresses[k]:
            content["220"] = int(recording.addresses[k])
        contents.append(content)
    write_blocks(path, 48, contents)

"""Tracks of edition 0.17 of category 062, as records of a newer one: other places of items, lengths and steps.

The order, lengths and steps are those on which two open decoders agree, Wireshark's (epan/dissectors/packet-asterix.c,
2014) and Croatia Control's (asterix_cat062_0_17.xml, 2008). Editions from 1.7 on have their items where 1.16 has them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

EDITION = "0.17"
_ORDER = "010 015 070 040 105 100 060 130 135 136 180 200 220 240 210 080 290 340 380 500 390 110 120 510".split()
_ORDER += ["", "", "RE", "SP"]
_BYTES = {"010": 2, "015": 1, "070": 3, "040": 2, "105": 6, "100": 4, "060": 2, "130": 2, "135": 2, "136": 2, "180": 4}
_BYTES |= {"200": 1, "220": 2, "240": 1, "210": 2, "110": 1, "120": 2}
# bytes of each part, as long as the last bit of a part says that another follows
_EXTENDED = {"080": 1, "510": 3}
# bytes of each part that the first bits announce; negative: of each of so many as its first byte says
_COMPOUND = {
    "290": (1, 1, 1, 1, 1, 2, 1, 1, 1), "340": (2, 4, 2, 2, 2, 1), "380": (-8, 3, 6, 2, 7),
    "500": (2, 4, 2, 1, 3, 1, 2, 1), "390": (2, 7, 4, 1, 4, 1, 4, 4, 3, 2, 2, -4, 6, 1),
}  # fmt: skip
_NEEDED = ("010", "070", "040")
# in metres, or a second
_MILE_64, _SPEED = 1852.0 / 64.0, 1852.0 / 2**14


def old_tracks(content: bytes, kind: Any) -> list[Any] | None:
    """Records of a data block of edition 0.17, as records of the edition `kind`; None if it is none."""
    try:
        found = [kind.cv_record.create(_translated(items)) for items in _records(content)]
    except (LookupError, ValueError):
        return None
    return found or None


def _records(content: bytes) -> Iterator[dict[str, Any]]:
    """Bytes of each item of each record, of compound ones by part; LookupError or ValueError: they are not there."""
    at = 0

    def take(count: int) -> bytes:
        nonlocal at
        if at + count > len(content):
            raise ValueError("the block ends within an item")
        at += count
        return content[at - count : at]

    def announced() -> list[int]:
        bits: list[int] = []
        more = True
        while more:
            byte = take(1)[0]
            bits += [byte >> shift & 1 for shift in range(7, 0, -1)]
            more = bool(byte & 1)
        return [k for k, bit in enumerate(bits) if bit]

    while at < len(content):
        items: dict[str, Any] = {}
        for k in announced():
            item = _ORDER[k]
            if item in _BYTES:
                items[item] = take(_BYTES[item])
            elif item in _EXTENDED:
                items[item] = take(_EXTENDED[item])
                last = items[item][-1]
                while last & 1:
                    last = take(_EXTENDED[item])[-1]
            elif item in _COMPOUND:
                sizes = _COMPOUND[item]
                items[item] = {p: take(sizes[p] if sizes[p] > 0 else -sizes[p] * take(1)[0]) for p in announced()}
            elif item:
                take(max(take(1)[0] - 1, 0))
            else:
                raise ValueError("an item that is spare")
        if not all(item in items for item in _NEEDED):
            raise LookupError("a track without source, time or number")
        yield items


def _translated(items: dict[str, Any]) -> dict[str, Any]:
    """Items of a newer edition, in its steps."""

    def halves(item: str, scale: float, bits: int, signs: bool = True) -> tuple[int, int]:
        """The two numbers of an item, in steps of `scale` and as raw numbers of so many bits."""
        raw, half = items[item], len(items[item]) // 2
        numbers = (int.from_bytes(part, "big", signed=signs) for part in (raw[:half], raw[half:]))
        first, second = (round(number * scale) & (1 << bits) - 1 for number in numbers)
        return first, second

    number = {item: int.from_bytes(raw, "big") for item, raw in items.items() if item in _BYTES}
    found: dict[str, Any] = {item: number[item] for item in ("015", "070", "040", "130", "136", "220") if item in items}
    found["010"] = tuple(zip(("SAC", "SIC"), items["010"], strict=True))
    if "105" in items:
        found["105"] = tuple(zip(("LAT", "LON"), halves("105", 4.0, 32), strict=True))
    if "100" in items:
        found["100"] = tuple(zip(("X", "Y"), halves("100", _MILE_64 / 0.5, 24), strict=True))
    if "180" in items:
        speed, heading = halves("180", 1.0, 16, signs=False)
        turn = 2.0 * math.pi * heading / 2**16
        along = (round(speed * _SPEED / 0.25 * part) & 0xFFFF for part in (math.sin(turn), math.cos(turn)))
        found["185"] = tuple(zip(("VX", "VY"), along, strict=True))
    if "060" in items:
        found["060"] = (0, 0, 0, 0, ("MODE3A", number["060"] & 0xFFF))
    if "135" in items:
        found["135"] = (("QNH", number["135"] >> 15), ("CTB", number["135"] & 0x7FFF))
    if "080" in items:
        status = items["080"][0]
        found["080"] = ((0, 0, ("MRH", status >> 5 & 1), 0, ("CNF", status >> 1 & 1), None),)
    if 1 in items.get("380", {}):
        found["380"] = {"ADR": int.from_bytes(items["380"][1], "big")}
    return found

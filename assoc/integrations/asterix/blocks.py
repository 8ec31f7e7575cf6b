"""ASTERIX data blocks in a file: in sequence, or in the UDP packets of a pcap."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from functools import lru_cache
from types import ModuleType
from typing import Any, NamedTuple

from assoc._files import reading
from assoc._system.imports import check_extra, load_extra

EDITIONS = {
    1: "Cat_001_1_4", 2: "Cat_002_1_2", 10: "Cat_010_1_1", 20: "Cat_020_1_11", 21: "Cat_021_2_7", 34: "Cat_034_1_29",
    48: "Cat_048_1_32", 62: "Cat_062_1_21",
}  # fmt: skip
"""Editions by category; earlier ones of the same numbering decode alike."""

_PCAP = {b"\xd4\xc3\xb2\xa1": "<", b"\xa1\xb2\xc3\xd4": ">", b"\x4d\x3c\xb2\xa1": "<", b"\xa1\xb2\x3c\x4d": ">"}
_ETHERNET, _COOKED, _RAW_IP = 1, 113, (12, 101)
_UDP = 17


class Block(NamedTuple):
    """A data block: its category, its undecoded records, and its offset in the file."""

    category: int
    content: bytes
    offset: int


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """Read a file, up to the largest size allowed."""
    check_extra("asterix", "asterix")
    return reading.read_bytes(path)


def data_blocks(content: bytes, notes: dict[str, int]) -> Iterator[Block]:
    """Split a file's content into data blocks; other content is skipped and counted in `notes`.

    After an impossible length, the rest of a plain file is skipped, since the beginning of the next block is unknown;
    in a pcap only the rest of that packet.
    """
    order = _PCAP.get(content[:4])
    if order is None:
        yield from _split(content, 0, notes)
        return
    for offset, payload in _packets(content, order, notes):
        yield from _split(payload, offset, notes)


def _split(content: bytes, start: int, notes: dict[str, int]) -> Iterator[Block]:
    at = 0
    while at < len(content):
        length = int.from_bytes(content[at + 1 : at + 3], "big") if at + 3 <= len(content) else 0
        if length < 3 or at + length > len(content):
            _count(notes, "bytes that are no whole data block", len(content) - at)
            return
        yield Block(content[at], content[at + 3 : at + length], start + at)
        at += length


def _packets(content: bytes, order: str, notes: dict[str, int]) -> Iterator[tuple[int, bytes]]:
    """Payloads of the UDP packets of a pcap, with their offsets."""
    if len(content) < 24:
        _count(notes, "bytes that are no whole data block", len(content))
        return
    (link,) = struct.unpack_from(f"{order}I", content, 20)
    at = 24
    while at + 16 <= len(content):
        (length,) = struct.unpack_from(f"{order}I", content, at + 8)
        at += 16
        if at + length > len(content):
            _count(notes, "bytes that are no whole data block", len(content) - at)
            return
        found = _udp_payload(content[at : at + length], link & 0xFFFF)
        if found is None:
            _count(notes, "packets that are not UDP", 1)
        else:
            yield at + found[0], found[1]
        at += length


def _udp_payload(packet: bytes, link: int) -> tuple[int, bytes] | None:
    """Payload of a packet and its offset; None unless it is an unfragmented IPv4 UDP packet."""
    at = {_ETHERNET: 14, _COOKED: 16}.get(link, 0)
    if link == _ETHERNET:
        while packet[at - 2 : at] == b"\x81\x00":
            at += 4
    if at + 20 > len(packet) or packet[at] >> 4 != 4 or packet[at + 9] != _UDP:
        return None
    fragment = int.from_bytes(packet[at + 6 : at + 8], "big") & 0x3FFF
    at += 4 * (packet[at] & 15)
    if fragment or at + 8 > len(packet):
        return None
    end = at + int.from_bytes(packet[at + 4 : at + 6], "big")
    return at + 8, packet[at + 8 : min(end, len(packet))]


def _count(notes: dict[str, int], what: str, many: int) -> None:
    notes[what] = notes.get(what, 0) + many


@lru_cache(maxsize=1)
def library() -> tuple[ModuleType, ModuleType]:
    """The modules ``asterix.base`` and ``asterix.generated``; loading the second takes a second."""
    return load_extra("asterix.base", "asterix"), load_extra("asterix.generated", "asterix")


def edition(category: int) -> Any:
    """Class of the package for a category."""
    return getattr(library()[1], EDITIONS[category])


def records(block: Block, notes: dict[str, int]) -> list[Any]:
    """Decoded records of a data block; if they cannot be decoded, none, and a count in `notes`."""
    kind, base = edition(block.category).cv_uap, library()[0]
    content = base.Bits.from_bytes(block.content)
    found: Any
    try:
        found = _mixed(kind, content) if issubclass(kind, base.UapMultiple) else kind.parse(content)
    except (TypeError, ValueError, AttributeError, LookupError, AssertionError) as error:
        # the package fails so on bits of items that its editions do not define
        found = ValueError(str(error))
    if isinstance(found, ValueError):
        _count(notes, f"data blocks of category {block.category:03d} that cannot be decoded", 1)
        return []
    return list(found)


def _mixed(kind: Any, content: Any) -> list[Any] | ValueError:
    """Records of category 001: item 020, in the same place in both, says which are plots and which tracks."""
    (item, element), names = kind.cv_selector
    found = []
    while len(content):
        for number, name in names.items():
            parsed = kind.cv_uaps[name].parse(library()[0].ParsingMode.StrictParsing, content)
            if not isinstance(parsed, ValueError) and value(parsed[0], item, element) == number:
                break
        else:
            return ValueError("neither plot nor track")
        found.append(parsed[0])
        content = parsed[1]
    return found


def value(record: Any, item: str, *path: str) -> int | None:
    """Raw number of an item or of an element in it; None if absent."""
    found = record.get_item(item)
    try:
        for name in path:
            if found is None:
                return None
            found = found.variation.get_item(name)
    except ValueError:  # the item has no such element in this category
        return None
    return None if found is None else int(found.as_uint())


def signed(raw: int, bits: int) -> int:
    """Signed value of a raw number in two's complement."""
    return raw - (1 << bits) if raw >> (bits - 1) else raw

"""ASTERIX data blocks in a file: one after the other, in frames of recorders, or in the UDP packets of a capture."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator
from typing import NamedTuple

_PCAP = {b"\xd4\xc3\xb2\xa1": "<", b"\xa1\xb2\xc3\xd4": ">", b"\x4d\x3c\xb2\xa1": "<", b"\xa1\xb2\x3c\x4d": ">"}
_PCAPNG = b"\x0a\x0d\x0d\x0a"
# header of each link layer, and where in it the protocol stands
_LINKS = {1: (14, 12), 113: (16, 14), 276: (20, 0), 12: (0, None), 101: (0, None), 228: (0, None), 229: (0, None)}
_VLAN = (b"\x81\x00", b"\x88\xa8")
_UDP, _FRAGMENT = 17, 44
# headers of IPv6 that only say how to go on
_OPTIONS = (0, 43, 60)
# fragments that wait for others
_WAITING = 1000
_FINAL, _ORADIS, _PADDING = 8, 6, b"\xa5" * 4
_REST = "bytes that are no whole data block"


class Block(NamedTuple):
    """A data block: its category, its undecoded records, and its offset in the file."""

    category: int
    content: bytes
    offset: int


def data_blocks(content: bytes, notes: Counter[str]) -> Iterator[Block]:
    """Split a file's content into data blocks; other content is skipped and counted in `notes`.

    After an impossible length, the rest of a plain file is skipped, since the beginning of the next block is unknown;
    in a capture only the rest of that packet.
    """
    if content[:4] in _PCAP or content[:4] == _PCAPNG:
        packets = _pcapng(content, notes) if content[:4] == _PCAPNG else _pcap(content, notes)
        waiting: dict[bytes, dict[int, bytes]] = {}
        for offset, link, packet in packets:
            payload = _payload(packet, link, waiting)
            if payload is None:
                notes["packets that are not UDP"] += 1
            else:
                yield from _framed(payload, offset, notes)
        if waiting:
            notes["packets of which parts are missing"] += len(waiting)
    else:
        yield from _framed(content, 0, notes)


def _framed(content: bytes, start: int, notes: Counter[str]) -> Iterator[Block]:
    """Blocks, plain or in the frames of a recorder: FINAL (8 bytes before, 4 after), or ORADIS (6 bytes before)."""
    at = 0
    while at < len(content):
        length = int.from_bytes(content[at : at + 2], "big")
        end = at + length
        if length >= _FINAL + 7 and content[end - 4 : end] == _PADDING and end <= len(content):
            inner = at + _FINAL, end - 4
        elif not _whole(content, at, None) and end <= len(content) and _whole(content, at + _ORADIS, end):
            inner = at + _ORADIS, end
        else:
            end = len(content)
            inner = at, end
        yield from _split(content, *inner, start, notes)
        at = end


def _whole(content: bytes, at: int, end: int | None) -> bool:
    """Whether blocks begin here; with an ``end``, and fill all up to it."""
    count = 0
    while at < (len(content) if end is None else end):
        length = int.from_bytes(content[at + 1 : at + 3], "big")
        if length < 4 or not content[at] or at + length > (len(content) if end is None else end):
            return False
        at, count = at + length, count + 1
        # of a whole file two tell enough
        if end is None and count == 2:
            return True
    return count > 0


def _split(content: bytes, at: int, end: int, start: int, notes: Counter[str]) -> Iterator[Block]:
    while at < end:
        length = int.from_bytes(content[at + 1 : at + 3], "big") if at + 3 <= end else 0
        if length < 3 or at + length > end:
            notes[_REST] += end - at
            return
        yield Block(content[at], content[at + 3 : at + length], start + at)
        at += length


def _pcap(content: bytes, notes: Counter[str]) -> Iterator[tuple[int, int, bytes]]:
    """Offset, link layer and bytes of the packets of a pcap."""
    order, at = _PCAP[content[:4]], 24
    link = struct.unpack_from(f"{order}I", content, 20)[0] & 0xFFFF if len(content) >= at else 0
    while at + 16 <= len(content):
        (length,) = struct.unpack_from(f"{order}I", content, at + 8)
        if at + 16 + length > len(content):
            break
        yield at + 16, link, content[at + 16 : at + 16 + length]
        at += 16 + length
    if at != len(content):
        notes[_REST] += len(content) - min(at, len(content) - 1)


def _pcapng(content: bytes, notes: Counter[str]) -> Iterator[tuple[int, int, bytes]]:
    """The same of a pcapng: sections with their byte order, interfaces with their link layer, packets of these."""
    at, order = 0, "<"
    links: list[int] = []
    while at + 12 <= len(content):
        if content[at : at + 4] == _PCAPNG:
            order, links = (">" if content[at + 8 : at + 12] == b"\x1a\x2b\x3c\x4d" else "<"), []
        kind, length = struct.unpack_from(f"{order}II", content, at)
        if length < 12 or length % 4 or at + length > len(content):
            break
        body = content[at + 8 : at + length - 4]
        if kind == 1 and len(body) >= 2:
            links.append(struct.unpack_from(f"{order}H", body)[0])
        elif kind == 6 and len(body) >= 20:
            # enhanced packet: interface, time, bytes that were kept
            number, _, _, size = struct.unpack_from(f"{order}IIII", body)
            yield at + 28, links[number] if number < len(links) else -1, body[20 : 20 + size]
        elif kind == 3 and links:
            yield at + 12, links[0], body[4:]
        at += length
    if at < len(content):
        notes[_REST] += len(content) - at


def _payload(packet: bytes, link: int, waiting: dict[bytes, dict[int, bytes]]) -> bytes | None:
    """What a UDP packet holds; nothing of a fragment before its last part; None of any other packet."""
    if link not in _LINKS:
        return None
    at, where = _LINKS[link]
    if where is not None:
        while packet[where : where + 2] in _VLAN:
            at, where = at + 4, where + 4
        if packet[where : where + 2] not in (b"\x08\x00", b"\x86\xdd"):
            return None
    version = packet[at] >> 4 if at < len(packet) else 0
    found = _ipv4(packet[at:]) if version == 4 else _ipv6(packet[at:]) if version == 6 else None
    if found is None:
        return None
    key, begin, more, datagram = found
    if begin or more:
        parts = waiting.setdefault(key, {})
        parts[begin] = datagram
        if not more:
            parts[-1] = begin.to_bytes(4, "big")
        if -1 not in parts:
            _forget(waiting)
            return b""
        whole, last = b"", int.from_bytes(parts[-1], "big")
        while len(whole) in parts and len(whole) < last:
            whole += parts[len(whole)]
        if len(whole) != last:
            _forget(waiting)
            return b""
        datagram = whole + parts[last]
        del waiting[key]
    size = int.from_bytes(datagram[4:6], "big")
    return datagram[8:size] if 8 <= size else None


def _forget(waiting: dict[bytes, dict[int, bytes]]) -> None:
    """Give up the oldest datagram that waits for parts, if there are too many."""
    if len(waiting) > _WAITING:
        del waiting[next(iter(waiting))]


_Datagram = tuple[bytes, int, bool, bytes]
"""What its fragments share, where this one begins, whether more follow, and its bytes."""


def _ipv4(packet: bytes) -> _Datagram | None:
    if len(packet) < 28 or packet[9] != _UDP:
        return None
    flags = int.from_bytes(packet[6:8], "big")
    header, total = 4 * (packet[0] & 15), int.from_bytes(packet[2:4], "big")
    # a total of 0: the network card cut what it sent
    content = packet[header : total or len(packet)]
    return packet[4:6] + packet[12:20], 8 * (flags & 0x1FFF), bool(flags & 0x2000), content


def _ipv6(packet: bytes) -> _Datagram | None:
    if len(packet) < 48:
        return None
    following, at, key, begin, more = packet[6], 40, b"", 0, False
    while following in (*_OPTIONS, _FRAGMENT) and at + 8 <= len(packet):
        if following == _FRAGMENT:
            place = int.from_bytes(packet[at + 2 : at + 4], "big")
            key, begin, more = packet[at + 4 : at + 8] + packet[8:40], place & 0xFFF8, bool(place & 1)
            following, at = packet[at], at + 8
        else:
            following, at = packet[at], at + 8 + 8 * packet[at + 1]
    end = 40 + int.from_bytes(packet[4:6], "big")
    return (key, begin, more, packet[at:end]) if following == _UDP else None

"""Packets of captured traffic, for tests."""

import struct


def udp(payload):
    return struct.pack(">HHHH", 8600, 8600, 8 + len(payload), 0) + payload


def ipv4(datagram, number=0, place=0):
    return (
        struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(datagram), number, place, 1, 17, 0, b"abcd", b"efgh") + datagram
    )


def ipv6(datagram, following=17):
    return struct.pack(">IHBB16s16s", 6 << 28, len(datagram), following, 64, b"a" * 16, b"b" * 16) + datagram


def fragments(datagram, number, sixth):
    """Three parts of a packet, the last one first."""
    edges = [0, 16, 24, len(datagram)]
    parts = [(a, datagram[a:b], b < len(datagram)) for a, b in zip(edges, edges[1:], strict=False)]
    for place, part, more in parts[::-1]:
        if sixth:
            yield ipv6(struct.pack(">BBHI", 17, 0, place | more, number) + part, 44)
        else:
            yield ipv4(part, number, place // 8 | more << 13)


def pcap(packets, link):
    head = struct.pack("<IHHIIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, link)
    return head + b"".join(struct.pack("<IIII", 0, 0, len(one), len(one)) + one for one in packets)


def pcapng(packets, link, order="<"):
    def block(kind, body):
        body += bytes(-len(body) % 4)
        return struct.pack(f"{order}II", kind, 12 + len(body)) + body + struct.pack(f"{order}I", 12 + len(body))

    blocks = [block(0x0A0D0D0A, struct.pack(f"{order}IHHq", 0x1A2B3C4D, 1, 0, -1))]
    blocks += [block(1, struct.pack(f"{order}HHI", link, 0, 0)), block(5, bytes(12))]
    for one in packets:
        blocks.append(block(6, struct.pack(f"{order}IIIII", 0, 0, 0, len(one), len(one)) + one))
    return b"".join(blocks)

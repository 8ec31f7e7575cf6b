"""Plots as lines from stdin, a UDP port on loopback or a scene; tracks as lines whenever they change."""

from __future__ import annotations

import json
import math
import queue
import socket
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from typing import IO, TYPE_CHECKING, Any, NamedTuple

import numpy as np

from assoc._cli.track.line_form import LineForm
from assoc._text.times import decimals
from assoc.errors import InvalidInputError
from assoc.exports.maps import COORDINATES, coordinates
from assoc.recordings.several import NO_HEIGHT, heights_above
from assoc.tracking.records.identity_evidence import ship

if TYPE_CHECKING:
    from assoc._types import Array
    from assoc.scene.geodesy import Origin
    from assoc.scene.scene import Scene
    from assoc.sensors import Sensor
    from assoc.tracking import Picture, Track

LONGEST = 10_000
"""Most characters of a line."""
# bytes that may wait: beyond them stdin is not read on, and datagrams are lost and counted
_WAITING = 64_000_000
# Linux's statistics of sockets, and the column of the datagrams dropped for lack of buffer space
_SO_MEMINFO, _DROPS = 55, 8
_DATAGRAM = 65_535
_POLL = 0.2

COLUMNS = (
    "track_id", "time", "x", "y", "z", "vx", "vy", "vz", "event", "score", "hits", "started", "last_detection",
    "sigma_x", "sigma_y", "sigma_z",
)  # fmt: skip
"""Columns of the tracks; an event is new, update or end. With an origin those of `assoc.exports.maps` follow."""
_TIMES = ("time", "started", "last_detection")


class Plot(NamedTuple):
    """A plot as read from a line."""

    sensor: str
    time: float
    values: list[float]
    identity: tuple[int, int] = (0, 0)
    """Mode 3/A code and ICAO address, 0 where it is missing."""


class IdentityError(InvalidInputError):
    """A plot's identity is none; without it the plot is sound."""

    def __init__(self, message: str, plot: Plot) -> None:
        super().__init__(message)
        self.plot = plot


class OwnPosition(NamedTuple):
    """Where a platform is, as read from a line."""

    sensor: str
    """Any that it carries."""
    time: float
    position: list[float]
    heading: float | None = None


def parse_line(line: str, scene: Scene, form: LineForm | None = None) -> Plot | OwnPosition | None:
    """Read a line of CSV or JSON; None for an empty line, a comment or the header.

    CSV: sensor, time, the components of the measurement, then optionally mode3 and address; or what the header says,
    which the ``form`` of the stream remembers. JSON: an object with sensor, time, and either values (an array) or the
    components by name; optionally mode3 and address. Metres, seconds, radians; but names of recordings, as bearing or
    range_nmi, have the units of recordings. A code is a whole number, an address has hexadecimal digits (in JSON it may
    be a number).

    The own position of a platform: CSV "platform", a sensor that it carries, time, x, y, z, and optionally the heading;
    JSON an object with platform (the sensor), time, position (an array) and optionally heading.

    A line that has neither form is refused, by an `IdentityError` if only the identity is none.
    """
    text = line.strip()
    if not text or text.startswith("#"):
        return None
    if len(text) > LONGEST:
        raise InvalidInputError(f"a line of {len(text)} characters, expected at most {LONGEST}")
    form = form or LineForm(scene)
    cells = form.cells(text)
    if not text.startswith("{") and form.takes_header(cells):
        return None
    try:
        found: Any = json.loads(text) if text.startswith("{") else form.named(cells) or _from_csv(cells, scene)
        if "platform" in found:
            x, y, z = (float(value) for value in found["position"])
            heading = found.get("heading")
            heading = None if heading in (None, "") else float(heading)
            return OwnPosition(str(found["platform"]), float(found["time"]), [x, y, z], heading)
        name, time = str(found["sensor"]), float(found["time"])
        s = _index(name, scene)
        sensor = None if s is None else scene.sensors[s]
        form.in_compass(found, s)
        values = found.get("values")
        if values is None:
            # of an unknown sensor only the name is read: the tracker reports it
            parts = sensor.components[: sensor.dim] if sensor is not None else ()
            values = [found.get(part, "") if part == "height" else found[part] for part in parts]
        if sensor is not None and sensor.components[sensor.dim - 1] == "height":
            name, values = _with_height(name, list(values), scene, sensor)
        if s is not None:
            time, values = form.unbiased(s, time, values)
        plot = Plot(name, time, [float(value) for value in values])
    except (ValueError, TypeError, LookupError, RecursionError, AttributeError, OverflowError) as error:
        raise InvalidInputError(_refusal(text, f"no {error}" if isinstance(error, KeyError) else str(error))) from None
    try:
        return plot._replace(identity=_identity(found.get("mode3"), found.get("address")))
    except ValueError as error:
        raise IdentityError(_refusal(text, str(error)), plot) from None


def _refusal(text: str, what: str) -> str:
    return f"expected sensor, time and values, as CSV or a JSON object, got {text[:60]!r} ({what[:80]})"


def _from_csv(cells: list[str], scene: Scene) -> dict[str, Any]:
    """Sensor, time, values, and identity; or a platform's own position."""
    name, time, *rest = cells
    if name == "platform" and _sensor(name, scene) is None:
        when, *values = rest
        if len(values) not in (3, 4):
            raise ValueError(f"{len(values)} values of a platform's own position, expected x, y, z and a heading")
        return {"platform": time, "time": when, "position": values[:3], "heading": "".join(values[3:])}
    sensor = _sensor(name, scene)
    # the number of values of an unknown sensor is unknown: the tracker reports the sensor
    dim = len(rest) if sensor is None else sensor.dim
    if len(rest) > dim + 2:
        raise ValueError(f"{len(rest)} values, at most {dim}, mode3 and address")
    names = zip(("mode3", "address"), rest[dim:], strict=False)
    return {"sensor": name, "time": time, "values": rest[:dim], **dict(names)}


def _with_height(name: str, values: list[Any], scene: Scene, sensor: Sensor) -> tuple[str, list[Any]]:
    """Sensor and values of a plot that may have a height: above the ellipsoid where the scene has an origin."""
    if len(values) == sensor.dim and values[-1] in ("", None):
        values.pop()
    if len(values) == sensor.dim - 1 and _sensor(name + NO_HEIGHT, scene) is not None:
        return name + NO_HEIGHT, values
    if len(values) == sensor.dim and scene.origin is not None:
        z = np.array([values], dtype=np.float64)
        values[-1] = float(heights_above(z, z[:, -1], sensor.position, scene.origin)[0])
    return name, values


def _sensor(name: str, scene: Scene) -> Sensor | None:
    """The sensor of this name or number; None if unknown."""
    s = _index(name, scene)
    return None if s is None else scene.sensors[s]


def _index(name: str, scene: Scene) -> int | None:
    """Number, from 0, of the sensor of this name or number; None if unknown."""
    return next((s for s, sensor in enumerate(scene.sensors) if name in (sensor.name, str(s + 1))), None)


def _identity(mode3: object = None, address: object = None) -> tuple[int, int]:
    """Mode 3/A code and address, as text or numbers; 0 if empty, ValueError if out of range or no number."""
    found = []
    for what, given, base, most in (("mode3", mode3, 10, 7777), ("address", address, 16, 999_999_999)):
        number = 0
        if isinstance(given, str) and given.strip():
            digits = given.strip()
            plain = digits.isascii() and digits.isalnum()
            if plain and base == 16 and len(digits) == 9 and digits.isdigit():
                found.append(ship(int(digits)))
                continue
            number = int(digits, base) if plain and (base == 10 or len(digits) <= 6) else -1
        elif isinstance(given, int) and not isinstance(given, bool):
            number = given
        elif given is not None and given != "":
            number = -1
        if not 0 <= number <= most:
            kind = "six hexadecimal digits, or the nine digits of a ship"
            if base == 10:
                kind = "four octal digits (a header calls them squawk; its mode3 is the 12 bits as a number)"
            raise ValueError(f"{what}: expected {kind}")
        found.append(number)
    return found[0], found[1]


class _Waiting(queue.Queue[bytes | None]):
    """A queue whose size is counted in bytes."""

    def _init(self, maxsize: int) -> None:
        super()._init(maxsize)
        self._bytes = 0

    def _qsize(self) -> int:
        return self._bytes

    def _put(self, item: bytes | None) -> None:
        super()._put(item)
        self._bytes += sys.getsizeof(item)

    def _get(self) -> bytes | None:
        item: bytes | None = super()._get()
        self._bytes -= sys.getsizeof(item)
        return item


class Lines:
    """Lines of stdin, or of a UDP `port` on 127.0.0.1, where the line "end" ends the stream.

    A thread reads them, so that a signal can end the wait for them; `waiting` bytes may wait, here and in the system.
    """

    def __init__(self, port: int | None, *, waiting: int = _WAITING) -> None:
        self._dropped = 0
        self._waiting = _Waiting(waiting)
        self._socket = None
        if port is not None:
            self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            try:
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, waiting)
                self._socket.bind(("127.0.0.1", port))
            except (OSError, OverflowError) as error:
                self._socket.close()
                raise InvalidInputError(f"--udp: port {port} cannot be used ({error})") from None
        threading.Thread(target=self._read, name="plots", daemon=True).start()

    @property
    def port(self) -> int | None:
        """The UDP port."""
        return None if self._socket is None else int(self._socket.getsockname()[1])

    @property
    def lost(self) -> int:
        """Datagrams that were dropped, here or (counted on Linux only) in the system, because they came too quickly."""
        if self._socket is None or not sys.platform.startswith("linux"):
            return self._dropped
        numbers = self._socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, 4 * (_DROPS + 1))
        return self._dropped + int.from_bytes(numbers[4 * _DROPS :], sys.byteorder)

    def _read(self) -> None:
        try:
            if self._socket is None:
                self._take_lines(sys.stdin.buffer)
            else:
                self._receive(self._socket)
        finally:
            self._waiting.put(None)

    def _take_lines(self, stream: IO[bytes]) -> None:
        """Read lines of a stream; one that is too long is replaced by a line that is refused for its length."""
        while line := stream.readline(LONGEST + 1):
            whole = len(line) <= LONGEST or line.endswith(b"\n")
            self._waiting.put(line if whole else b"x" * (LONGEST + 1))
            while len(line) > LONGEST and not line.endswith(b"\n"):
                line = stream.readline(LONGEST + 1)

    def _receive(self, port: socket.socket) -> None:
        """Receive datagrams; the reader splits them into lines: less work here loses fewer datagrams."""
        while True:
            datagram = port.recv(_DATAGRAM)
            try:
                self._waiting.put_nowait(datagram)
            except queue.Full:
                self._dropped += 1

    def __iter__(self) -> Iterator[str]:
        while True:
            try:
                content = self._waiting.get(timeout=_POLL)
            except queue.Empty:
                continue
            if content is None:
                return
            for line in content.decode("utf-8", "replace").splitlines():
                if self._socket is not None and line.strip() == "end":
                    return
                yield line


def replayed(scene: Scene, speed: float, identities: Sequence[tuple[Array, ...]] = ()) -> Iterator[Plot]:
    """The plots of a scene by their times, ``speed`` times as quickly as they were made; 0: without waiting.

    ``identities`` are codes, 12 bits as a number, and addresses (n, 2) for each scan and sensor, where they are known.
    """
    plots = []
    for k in range(scene.num_scans):
        scan = scene.scan(k)
        for s, (z, times) in enumerate(zip(scan.measurements, scan.own_times(), strict=True)):
            known = identities[k][s].astype(int).tolist() if identities else [(0, 0)] * len(z)
            rows = zip(times.tolist(), z.tolist(), known, strict=True)
            plots += [Plot(str(s + 1), when, values, (int(f"{c:o}"), a)) for when, values, (c, a) in rows]
    plots.sort(key=lambda plot: plot.time)
    begin, first = time.monotonic(), plots[0].time if plots else 0.0
    for plot in plots:
        ahead = begin + (plot.time - first) / speed - time.monotonic() if speed > 0 else 0.0
        if ahead > 0:
            time.sleep(ahead)
        yield plot


def header_of(origin: Origin | None) -> str:
    """First line of the tracks."""
    return ",".join(COLUMNS if origin is None else (*COLUMNS, *COORDINATES))


class TrackWriter:
    """Writes a line of CSV for each track that is new, was detected, or has ended.

    `positions` are the indices of x, y (and z) in the state, `origin` is the scene's, `known` tracks have their line
    already; `begun`: the stream has its header.
    """

    def __init__(
        self,
        stream: IO[str],
        positions: Sequence[int],
        origin: Origin | None = None,
        known: Iterable[Track] = (),
        *,
        begun: bool = False,
    ) -> None:
        self._stream, self._positions, self._origin = stream, list(positions), origin
        self._known = {track.track_id: track for track in known}
        if not begun:
            stream.write(header_of(origin) + "\n")
            stream.flush()

    def write(self, picture: Picture) -> None:
        """Write the changes since the last picture."""
        for track in picture.tracks:
            before = self._known.get(track.track_id)
            if before is None or track.last_detection > before.last_detection:
                self._row("new" if before is None else "update", track, track.time)
                self._known[track.track_id] = track
        for number in picture.ended:
            if number in self._known:
                self._row("end", self._known.pop(number), picture.time)
        self._stream.flush()

    def _row(self, event: str, track: Any, when: float) -> None:
        sigma = [0.0, 0.0, 0.0]
        for axis, k in enumerate(self._positions):
            sigma[axis] = math.sqrt(max(float(track.covariance[k, k]), 0.0))
        state = *track.position.tolist(), *track.velocity.tolist()
        life = track.score, track.hits, track.started, track.last_detection
        row = dict(zip(COLUMNS, (track.track_id, when, *state, event, *life, *sigma), strict=True))
        cells = [
            decimals(value, 6) if name in _TIMES else f"{value:.10g}" if isinstance(value, float) else str(value)
            for name, value in row.items()
        ]
        if self._origin is not None:
            latitude, longitude, altitude = coordinates(track.position, self._origin)[0]
            # a planar track has no height
            known = f"{altitude:.2f}" if len(self._positions) > 2 else ""
            cells += [f"{latitude:.8f}", f"{longitude:.8f}", known]
        self._stream.write(",".join(cells) + "\n")

"""The server of the page, on 127.0.0.1 only; pictures are pushed as server-sent events.

Nothing leaves the machine: requests addressed to another host name are refused (DNS rebinding), and the page may load
nothing from elsewhere.
"""

from __future__ import annotations

import json
import math
import queue
import threading
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from assoc.errors import InvalidInputError
from assoc.exports.maps import coordinates
from assoc.recordings.several import NO_HEIGHT
from assoc.scene.scene import Scene
from assoc.sensors import PositionSensor, Sensor

if TYPE_CHECKING:
    from assoc.tracking import Picture, Track
    from assoc.tracking.live.pictures import SensorState
    from assoc.tracking.quality import TrackQuality

_FOLDER = Path(__file__).parent
_FILES = {
    "/": ("page.html", "text/html"),
    "/live.js": ("live.js", "text/javascript"),
    "/live.css": ("live.css", "text/css"),
}
_POLICY = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:"
# pictures that wait for a slow browser; beyond this it misses some
_WAITING = 50
_BEAT = 10.0
# pause (s) if the system has no more connections
_PAUSE = 0.2
# places of a track that a page gets which is opened later
_TRAIL = 40
# decimals: centimetres
_DIGITS = 2


class LivePage:
    """A page that shows pictures of a live tracker.

    Parameters
    ----------
    scene : Scene
        Sensors and region.
    port : int
        Port on 127.0.0.1; 0: any free port.
    title : str
    heights : bool
        Whether tracks have heights. They are shown above the ellipsoid where the scene has an origin.
    connections : int
        Most connections at once.
    idle : float
        Seconds that one may be silent.

    Raises
    ------
    InvalidInputError
        The port is not available.
    """

    def __init__(
        self,
        scene: Scene,
        port: int = 0,
        title: str = "",
        *,
        heights: bool = True,
        connections: int = 32,
        idle: float = 15.0,
    ) -> None:
        self._origin, self._heights = scene.origin, heights
        first = {
            "title": title,
            "region": scene.region.tolist(),
            "sensors": [
                [sensor.name or str(s), *_site(sensor)]
                for s, sensor in enumerate(scene.sensors, 1)
                if not sensor.name.endswith(NO_HEIGHT)
            ],
        }
        self._first = _event("scene", first)
        self._last: str | None = None
        self._trails: dict[int, deque[list[float]]] = {}
        self._readers: set[queue.Queue[str | None]] = set()
        self._lock = threading.Lock()
        self._closed = False
        page = self

        class Handler(_Handler):
            """Requests of this page."""

            owner = page
            timeout = idle

        try:
            self._server = _Server(connections, ("127.0.0.1", port), Handler)
        except (OSError, OverflowError) as error:
            raise InvalidInputError(f"--page: port {port} cannot be used ({error})") from None
        threading.Thread(target=self._server.serve_forever, name="page", daemon=True).start()

    @property
    def address(self) -> str:
        """URL of the page."""
        return f"http://127.0.0.1:{self._server.server_address[1]}/"

    def show(
        self, picture: Picture, heard: Sequence[SensorState] = (), counts: Mapping[str, int] | None = None
    ) -> None:
        """Push a picture to all connected browsers.

        Parameters
        ----------
        picture : Picture
        heard : sequence of SensorState
            What is known of each sensor, `LiveTracker.heard`.
        counts : mapping of str to int, optional
            Plots that were late, refused or lost, by reason.
        """
        with self._lock:
            self._trails = {
                track.track_id: self._trails.get(track.track_id, deque(maxlen=_TRAIL)) for track in picture.tracks
            }
            for track in picture.tracks:
                self._trails[track.track_id].append(np.round(track.position[:2], _DIGITS).tolist())
        tracks = [self._row(track, picture.agreements.get(track.track_id), heard) for track in picture.tracks]
        plots = np.round(picture.plots[:, :2], _DIGITS).tolist()
        content = {
            "time": picture.time,
            "tracks": tracks,
            "plots": plots,
            "sensors": picture.sensors.tolist(),
            "names": {str(number): name for number, name in picture.names.items()},
            "heard": [[row.name, row.last if math.isfinite(row.last) else None, *row[2:5]] for row in heard],
            "counts": dict(counts or {}),
        }
        self._push(_event("picture", content | {"ended": picture.ended}))

    def _row(self, track: Track, agreement: TrackQuality | None, heard: Sequence[SensorState]) -> list[Any]:
        """Id, x, y, height, vx, vy, hits, start, status, quality; with an origin latitude and longitude, too.

        Quality: NIS (or null), whether it is as expected, and the measurements of each sensor in `heard`; or null.
        """
        x, y, height = track.position.tolist()
        earth = [] if self._origin is None else coordinates(track.position, self._origin)[0].tolist()
        if earth:
            height = earth.pop()
        known = round(height, _DIGITS) if self._heights else None
        plane = np.round([x, y, *track.velocity[:2]], _DIGITS).tolist()
        quality = None
        if agreement is not None:
            nis = round(agreement.nis, _DIGITS) if math.isfinite(agreement.nis) else None
            hits = [sum(agreement.hits[part] for part in row.parts) for row in heard]
            quality = nis, agreement.consistent, hits
        life = track.hits, round(track.started, 3), track.status, quality
        return [track.track_id, *plane[:2], known, *plane[2:], *life, *(round(angle, 6) for angle in earth)]

    def _push(self, event: str) -> None:
        with self._lock:
            self._last = event
            readers = list(self._readers)
        for reader in readers:
            _put(reader, event)

    def close(self) -> None:
        """Tell the browsers that this is the end, and stop; further calls do nothing."""
        if self._closed:
            return
        self._closed = True
        self._push(_event("end", {}))
        with self._lock:
            readers = list(self._readers)
        for reader in readers:
            _put(reader, None)
        self._server.shutdown()
        self._server.server_close()

    def join_reader(self) -> queue.Queue[str | None]:
        """Return a queue of events for a new browser, with those that it missed first."""
        reader: queue.Queue[str | None] = queue.Queue(_WAITING)
        reader.put(self._first)
        with self._lock:
            if self._last is not None:
                reader.put(_event("trails", {str(number): list(trail) for number, trail in self._trails.items()}))
                reader.put(self._last)
            self._readers.add(reader)
        return reader

    def leave_reader(self, reader: queue.Queue[str | None]) -> None:
        """Forget a browser that has disconnected."""
        with self._lock:
            self._readers.discard(reader)


def _site(sensor: Sensor) -> list[float | None]:
    """Where a sensor stands, x and y, and how far it reaches; None where it is nowhere, as AIS, or sees no ranges."""
    if isinstance(sensor, PositionSensor) and sensor.platform is None:
        return [None, None, None]
    ranged = "range" in sensor.components
    return [*sensor.position[:2].tolist(), float(sensor.field_of_view[0, 1]) if ranged else None]


def _put(reader: queue.Queue[str | None], event: str | None) -> None:
    """Queue an event for a browser; for a slow one drop the oldest event instead of waiting."""
    while True:
        with suppress(queue.Full):
            reader.put_nowait(event)
            return
        with suppress(queue.Empty):
            reader.get_nowait()


def _event(name: str, content: Any) -> str:
    return f"event: {name}\ndata: {json.dumps(content)}\n\n"


class _Server(ThreadingHTTPServer):
    """Limits the connections; further ones are refused until one ends or times out."""

    daemon_threads = True

    def __init__(self, most: int, *arguments: Any) -> None:
        super().__init__(*arguments)
        self._free = threading.BoundedSemaphore(most)

    def get_request(self) -> tuple[Any, Any]:
        try:
            return super().get_request()
        except OSError:
            # no more connections available: without a pause this error would repeat at once
            time.sleep(_PAUSE)
            raise

    def verify_request(self, request: Any, client_address: Any) -> bool:
        return self._free.acquire(blocking=False)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """No output: a browser has disconnected, and the terminal belongs to the tracker."""


class _Handler(BaseHTTPRequestHandler):
    owner: ClassVar[LivePage]
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        """Answer with the page, one of its files, or the events."""
        host = (self.headers.get("Host") or "").rsplit(":", 1)[0]
        if host not in ("127.0.0.1", "localhost"):
            self.send_error(403, "this page is for this machine only")
        elif self.path in _FILES:
            name, kind = _FILES[self.path]
            self._answer(kind, (_FOLDER / name).read_bytes())
        elif self.path == "/events":
            self._events()
        else:
            self.send_error(404)

    def _answer(self, kind: str, content: bytes) -> None:
        self.send_response(200)
        self._headers(f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def _headers(self, kind: str) -> None:
        self.send_header("Content-Type", kind)
        self.send_header("Content-Security-Policy", _POLICY)
        self.send_header("X-Content-Type-Options", "nosniff")
        self.send_header("Cache-Control", "no-store")

    def _events(self) -> None:
        self.send_response(200)
        self._headers("text/event-stream")
        self.send_header("Connection", "close")
        self.end_headers()
        reader = self.owner.join_reader()
        try:
            while True:
                try:
                    event = reader.get(timeout=_BEAT)
                except queue.Empty:
                    # detects that the browser has disconnected
                    event = ": still here\n\n"
                if event is None:
                    return
                self.wfile.write(event.encode())
                self.wfile.flush()
        except OSError:
            return
        finally:
            self.owner.leave_reader(reader)
            self.close_connection = True

    def log_message(self, format: str, *arguments: Any) -> None:
        """No output: the terminal belongs to the tracker."""

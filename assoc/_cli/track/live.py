"""``assoc.track --live``: tracks of plots as they come, until they end or a signal ends the program."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import IO, Any

from assoc._cli.options import flag_of
from assoc._cli.signals import Interruption
from assoc._cli.track.options import RADAR, make_tracker
from assoc._cli.track.plot_lines import Lines, TrackWriter, parse_line, replayed
from assoc._cli.values import number, whole_number
from assoc._text.plain import printable
from assoc.errors import InvalidInputError
from assoc.scene.scene import Scene
from assoc.tracking import LiveTracker, Tracker
from assoc.tracking.filter_choice import pace_of


@contextmanager
def _named(output: str, stream: IO[str]) -> Iterator[None]:
    """Say of an output that cannot be written which it is, and close it."""
    try:
        yield
    except BrokenPipeError:
        raise  # the reader of our output has seen enough
    except OSError as error:
        if stream is not sys.stdout:
            with suppress(OSError):
                stream.close()
        raise InvalidInputError(f"{output}: cannot be written ({error.strerror or error})") from None


def track_live(file: str, parsed: dict[str, Any], settings: dict[str, Any], interruption: Interruption) -> None:
    """Track plots as they come, until they end or a signal ends the program."""
    for flag in ("report", "map", "origin", "rates", "window", "rotation", "radar", "registration", "all", *RADAR):
        if parsed[flag] is not None and parsed[flag] is not False:
            raise InvalidInputError(f"{flag_of(flag)}: is not for --live")
    if parsed["smooth"]:
        raise InvalidInputError("--smooth: is for finished tracks, not for --live")
    if parsed["udp"] is not None and parsed["replay"] is not None:
        raise InvalidInputError("--udp and --replay: expected one of them")
    parsed["filter"] = parsed["filter"] or "imm-cv"
    given = [name for name in ("interval", "horizon", "wait") if parsed[name] is not None]
    numbers = {name: number(parsed[name], flag_of(name)) for name in given}
    turns = None if parsed["turns"] is None else [number(one, "--turns") for one in parsed["turns"].split(",")]
    ports = {
        name: None if parsed[name] is None else whole_number(parsed[name], flag_of(name), 0) for name in ("udp", "page")
    }
    if parsed["identity"] is not None and parsed["replay"] is not None:
        raise InvalidInputError("--identity: is for plots; the measurements of a scene have no codes")
    speed = None if parsed["replay"] is None else number(parsed["replay"], "--replay")
    if speed is not None and not 0 <= speed < math.inf:
        raise InvalidInputError(f"--replay: expected a number >= 0, got {parsed['replay']!r}")
    scene = Scene.load(file)
    # what one instant is to a scene is a turn to antennas: so long nothing is heard of a target
    pace = pace_of(scene.times) if turns is None else min(turns)

    def tell(line: str) -> None:
        print(f"assoc.track: {printable(line)}", file=sys.stderr, flush=True)

    def say(line: str) -> None:
        if not parsed["quiet"]:
            tell(line)

    def make() -> Tracker:
        return make_tracker(parsed["tracker"] or "multi-sensor", scene.sensors, parsed, settings, scene.region, pace)

    tracker = LiveTracker(scene, make, turns=turns, tell=tell, **numbers)
    tracker.warm_up()
    page = None
    if ports["page"] is not None:
        from assoc.plotting.live import LivePage

        page = LivePage(scene, ports["page"], scene.name)
        say(f"page: {page.address}")
    lines = None if speed is not None else Lines(ports["udp"])
    if lines is not None and lines.port is not None:
        say(f"plots: udp 127.0.0.1:{lines.port}")
    if parsed["verbose"]:
        say(", ".join(f"{name} {value}" for name, value in settings.items()))
    kept = parsed["output"] not in (None, "-")
    stream = open(parsed["output"], "w", encoding="utf-8", newline="\n") if kept else sys.stdout
    target = parsed["output"] if kept else "stdout"
    with _named(target, stream):
        writer = TrackWriter(stream, tracker.positions)

    lost = 0

    def tell_lost() -> None:
        nonlocal lost
        before, lost = lost, 0 if lines is None else lines.lost
        if lost and not before:
            tell("datagrams are lost: they come quicker than tracks can be made")

    def show(pictures: list[Any]) -> None:
        for picture in pictures:
            with _named(target, stream):
                writer.write(picture)
            if page is not None:
                page.show(picture)
            tell_lost()

    def end() -> None:
        show(tracker.finish())
        if page is not None:
            page.close()
        if kept:
            stream.close()
        if lines is not None and lines.lost:
            tell(f"{lines.lost} datagrams lost: they came quicker than tracks can be made")
        say(tracker.summary())

    ignored = parsed["identity"] == "ignore"
    with interruption.reported(end):
        if lines is None:
            for plot in replayed(scene, speed or 0.0):
                show(tracker.take(*plot))
        else:
            for line in lines:
                try:
                    found = parse_line(line, scene)
                except InvalidInputError as error:
                    tracker.leave_out("lines not understood", f"line left out: {error}")
                    continue
                if found is not None:
                    show(tracker.take(*(found[:3] if ignored else found)))
    end()

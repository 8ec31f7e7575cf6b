"""``python -m assoc.live``: tracks plots as they come, until they end or a signal ends the program.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import gc
import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout, suppress
from typing import IO, TYPE_CHECKING, Any

from assoc._cli.options import Given, Parser
from assoc._cli.program import Program
from assoc._cli.signals import Interruption
from assoc._cli.track.options import LIVE, closing, live_parser, make_tracker, read_options, with_further
from assoc._files.output import STDOUT, is_stream
from assoc._system.compile_time import announcement
from assoc._text.plain import printable
from assoc._text.times import moment
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc._cli.track.line_form import LineForm
    from assoc._cli.track.plot_lines import Lines
    from assoc._types import Array
    from assoc.plotting.live import LivePage
    from assoc.scene.scene import Scene
    from assoc.tracking import LiveTracker, Picture

_INTERRUPTION = Interruption("assoc.live")
# seconds between two savings of the state, ids that are reserved until the next, and most bytes of a line
_EVERY, _IDS, _LONGEST = 5.0, 100, 10_000


def _live(words: list[str]) -> None:
    given, settings = read_options(words, live_parser())
    given.check_outputs([given["file"]])
    if given["udp"] is not None and given["replay"] is not None:
        raise InvalidInputError("--udp and --replay: expected one of them")
    given.check_use(LIVE, input="plots" if given["replay"] is None else "the measurements of a scene")
    from assoc._cli.track.plot_lines import Lines, header_of

    scene, form, identities = _scene(given, settings)
    going_on = given["state"] is not None and os.path.exists(given["state"])
    whole = _check_output(given["output"], header_of(scene.origin), going_on)
    with announcement.silenced() if given["quiet"] else nullcontext():
        tracker = _tracker(scene, given, settings)
    if going_on:
        tracker.restore(given["state"])
        if whole is not None:
            os.truncate(given["output"], whole)
        _say(given, f"goes on from {given['state']}, which ends at {moment(tracker.state.newest)}")
    state = _StateFile(given["state"], tracker)
    page = _page(scene, given, heights=len(tracker.positions) > 2)
    lines = Lines(given["udp"]) if given["replay"] is None else None
    if lines is not None and lines.port is not None:
        _say(given, f"plots: udp 127.0.0.1:{lines.port}")
    if given["verbose"]:
        _say(given, ", ".join(f"{name} {value}" for name, value in settings.items()))
    outputs = _Outputs(given["output"], page, tracker, going_on)
    losing = False

    def show(pictures: Iterable[Picture]) -> None:
        nonlocal losing
        for picture in pictures:
            outputs.show(picture, 0 if lines is None else lines.lost)
            if lines is not None and lines.lost and not losing:
                losing = True
                _print("datagrams are lost: they come quicker than tracks can be made")
        state.keep()

    def end() -> None:
        show(tracker.finish())
        state.keep(last=True)
        outputs.close()
        if lines is not None and lines.lost:
            _print(f"{lines.lost} datagrams lost: they came quicker than tracks can be made")
        _say(given, tracker.summary())

    with _INTERRUPTION.reported(end):
        _take_plots(lines, scene, tracker, given, show, form, identities)
    end()


def _scene(given: Given, settings: dict[str, Any]) -> tuple[Scene, LineForm, Sequence[tuple[Array, ...]]]:
    """The scene of the sensors, how lines are read, and the identities of its own plots."""
    from assoc._cli.biases import print_biases
    from assoc._cli.track.line_form import LineForm
    from assoc._cli.track.radars_file import read_radars
    from assoc.association.source import refuse_text
    from assoc.recordings.on_earth import Bias
    from assoc.registration import register
    from assoc.scene.scene import Scene

    if not given["file"].lower().endswith(".toml"):
        if given["registration"] is not None:
            raise InvalidInputError("--registration: first takes the plots of radars.toml; register a scene before")
        refuse_text(given["file"])
        scene = Scene.load(given["file"])
        return scene, LineForm(scene), ()
    if given["turns"] is not None:
        raise InvalidInputError(f"--turns: {given['file']} says how the antennas turn")
    radars = read_radars(given["file"])
    given["turns"] = radars.sensor_turns
    settings["initiation"] = closing(settings["initiation"], radars.closed)
    scene, biases = radars.scene, radars.biases
    if given["registration"] is not None:
        found = register(
            scene,
            components=("range", "azimuth", "gain"),
            reference=radars.references,
            seed=settings.get("seed", 0),
        )
        with redirect_stdout(sys.stderr):
            print_biases(found)
        if found.significant:
            scene, biases = found.correct(scene), radars.with_further(found)
    numbers = radars.numbers
    others = len(scene.sensors) - len(numbers)
    places = [radars.places[number] for number in numbers] + [(0.0, 0.0, 0.0)] * others
    identities = () if given["identity"] == "ignore" else radars.identities
    return scene, LineForm(scene, places, [biases[number] for number in numbers] + [Bias()] * others), identities


class _StateFile:
    """The file in which a live tracker's state is kept, if there is one; it is there before the first track is."""

    def __init__(self, path: str | None, tracker: LiveTracker) -> None:
        self._path, self._tracker = path, tracker
        self._due, self._ids = -math.inf, 0
        self.keep()

    def keep(self, *, last: bool = False) -> None:
        """Save the state if it is time to, or before new tracks get ids that were not reserved."""
        next_id = self._tracker.state.tracker.next_id
        if self._path is None or not (last or time.monotonic() >= self._due or next_id >= self._ids):
            return
        # after a crash tracks that began since are not known: their ids must not be used again
        reserve = 0 if last else _IDS
        self._tracker.save(self._path, reserve=reserve)
        self._due, self._ids = time.monotonic() + _EVERY, next_id + reserve


def _check_output(path: str | None, header: str, going_on: bool) -> int | None:
    """Refuse an output other than tracks to go on with; its bytes without a line that a crash left unfinished."""
    if path in (None, STDOUT) or is_stream(path) or not os.path.exists(path) or not os.path.getsize(path):
        return None
    if not going_on:
        raise InvalidInputError(f"{path}: is there already; expected a new name, or --state to go on with its tracks")
    with open(path, "rb") as file:
        if file.readline().decode("utf-8", "replace").strip() != header:
            raise InvalidInputError(f"{path}: holds other columns than those of these tracks; expected a new name")
        end = file.seek(0, os.SEEK_END)
        file.seek(max(0, end - _LONGEST))
        tail = file.read()
    return end - len(tail) + tail.rfind(b"\n") + 1


def _tracker(scene: Scene, given: Given, settings: dict[str, Any]) -> LiveTracker:
    from assoc.tracking import LiveTracker, Tracker
    from assoc.tracking.filter_choice import height_note, pace_of

    given["filter"] = given["filter"] or "imm-cv"
    name, turns = given["tracker"] or "multi-sensor", given["turns"]
    if turns is not None and given["interval"] is None:
        given["interval"] = min(1.0, 0.25 * min(turns))
    # a turn of an antenna corresponds to an instant of a scene: meanwhile a target is not detected again
    pace = pace_of(scene.times) if turns is None else min(turns)

    def make() -> Tracker:
        return make_tracker(name, scene.sensors, given, settings, scene.region, pace)

    tracker = LiveTracker(
        scene,
        make,
        turns=turns,
        tell=_print,
        quality=given["page"] is not None,
        **given.some(("interval", "horizon", "wait")),
    )
    tracker.warm_up()
    # what is loaded by now stays: looking through it for garbage would hold up a step
    gc.freeze()
    note = height_note(scene.sensors, len(tracker.positions))
    if note is not None:
        _say(given, note)
    return tracker


def _page(scene: Scene, given: Given, heights: bool) -> LivePage | None:
    if given["page"] is None:
        return None
    from assoc.plotting.live import LivePage

    page = LivePage(scene, given["page"], scene.name, heights=heights)
    _say(given, f"page: {page.address}")
    return page


def _take_plots(
    lines: Lines | None,
    scene: Scene,
    tracker: LiveTracker,
    given: Given,
    show: Callable[[list[Picture]], None],
    form: LineForm,
    identities: Sequence[tuple[Array, ...]],
) -> None:
    """Pass the plots of the lines (of the scene if there are none) to the tracker, and show its pictures."""
    from assoc._cli.track.plot_lines import IdentityError, OwnPosition, parse_line, replayed

    if lines is None:
        for plot in replayed(scene, given["replay"], identities):
            show(tracker.take(*plot))
        return
    for line in lines:
        try:
            found = parse_line(line, scene, form)
        except IdentityError as error:
            tracker.leave_out("identities not understood", f"identity left out: {error}")
            found = error.plot
        except InvalidInputError as error:
            tracker.leave_out("lines not understood", f"line left out: {error}")
            continue
        if isinstance(found, OwnPosition):
            tracker.take_own_position(*found)
        elif found is not None:
            show(tracker.take(*(found[:3] if given["identity"] == "ignore" else found)))


class _Outputs:
    """Outputs of pictures: lines to a file or stdout, and the page if there is one."""

    def __init__(self, path: str | None, page: LivePage | None, tracker: LiveTracker, going_on: bool) -> None:
        from assoc._cli.track.plot_lines import TrackWriter

        self._page, self._tracker = page, tracker
        self._name = "stdout" if path in (None, STDOUT) else path
        self._stream: IO[str] = sys.stdout
        if path not in (None, STDOUT):
            self._stream = open(path, "a", encoding="utf-8", newline="\n")
        known = [track for track in tracker.state.tracker.tracks if track.track_id in tracker.confirmed]
        origin, begun = tracker.settings.scene.origin, self._stream is not sys.stdout and self._stream.tell() > 0
        with self._writing():
            self._writer = TrackWriter(self._stream, tracker.positions, origin, known, begun=begun)

    def show(self, picture: Picture, lost: int) -> None:
        """Write the changes; `lost` datagrams were lost so far."""
        with self._writing():
            self._writer.write(picture)
        if self._page is not None:
            odd = {kind: count for kind, count in self._tracker.counts.items() if kind != "plots"}
            self._page.show(picture, self._tracker.heard, odd | ({"lost": lost} if lost else {}))

    def close(self) -> None:
        """Close the outputs."""
        if self._page is not None:
            self._page.close()
        if self._stream is not sys.stdout:
            self._stream.close()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Name the output if it cannot be written, and close it."""
        try:
            yield
        except BrokenPipeError:
            raise  # the reader of stdout closed it
        except OSError as error:
            with suppress(OSError):
                if self._stream is not sys.stdout:
                    self._stream.close()
            raise InvalidInputError(f"{self._name}: cannot be written ({error.strerror or error})") from None


def _print(line: str) -> None:
    print(f"assoc.live: {printable(line)}", file=sys.stderr, flush=True)


def _say(given: Given, line: str) -> None:
    if not given["quiet"]:
        _print(line)


def parser() -> Parser:
    """Return the parser with all options."""
    return with_further(live_parser())


PROGRAM = Program("assoc.live", _live, _INTERRUPTION.interrupt_on_signals, _INTERRUPTION)
start, main = PROGRAM.start, PROGRAM.main

if __name__ == "__main__":
    raise SystemExit(start())

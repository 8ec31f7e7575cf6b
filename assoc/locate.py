"""``python -m assoc.locate``: finds what stations heard, where and when it was emitted, from tables of arrival times.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from assoc._cli.lines import print_lines
from assoc._cli.messages import messages
from assoc._cli.options import Given, Option, Parser, verbosity
from assoc._cli.program import Program, command, write_all
from assoc._cli.signals import EarlyEnd
from assoc._cli.values import Output, listed, not_negative, number, positive, probability
from assoc._files.output import write_text
from assoc._text.plain import printable, spreadsheet_text
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc._types import Array
    from assoc.recordings.arrivals import Arrivals, ArrivalScene, Stations


def _speeds(value: str, label: str) -> dict[str, float]:
    """Speeds by phase, of ``P=6000,S=3464``, or the one of all."""
    parts = [part.rpartition("=") for part in value.split(",")]
    found = {phase.strip(): positive(speed, label) for phase, _, speed in parts}
    if len(found) < len(parts) or ("" in found and len(found) > 1):
        raise InvalidInputError(f"{label}: expected metres a second, of phases as P=6000,S=3464, got {value!r}")
    return found


_OPTIONS = (
    Option("file", "ARRIVALS", "CSV or Parquet: time, station, and a phase if there are several", positional=True),
    Option("stations", "FILE", "CSV or Parquet: station, latitude, longitude (or x, y in metres), height in metres"),
    Option("wave_speed", "M/S", "of the wave: 299792458 for radio, 343 for sound; of phases P=6000,S=3464", _speeds),
    Option("noise", "S", "standard deviation of an arrival time, seconds", positive),
    Option("heights", "LOW,HIGH", "metres between which waves are emitted; twice the same: in that plane",
           listed(number)),
    Option("beyond", "KM", "how far beyond the stations (default: as far as they reach)", not_negative),
    Option("detection_probability", "P", "of each station (default: estimated)", probability),
    Option("false_alarms", "N", "of each station in an hour (default: estimated)", positive),
    Option("output", "FILE", "file for the emissions: time, place, standard deviations (.csv)",
           Output(".csv", strict=True), short="-o"),
    Option("picks", "FILE", "file for the arrivals, each with its emission and residual (.csv)",
           Output(".csv", strict=True)),
    *verbosity("the same"),
)  # fmt: skip
_NEEDED = ("stations", "wave_speed", "noise", "heights", "output")


class _Emissions(NamedTuple):
    """Emissions in the order of time: seconds since the start, places, covariances; arrivals' rows, residuals (s)."""

    times: list[float]
    positions: list[Array]
    covariances: list[Array]
    rows: list[Array]
    residuals: list[Array]


def _locate(words: list[str]) -> None:
    given = parser().read(words)
    for name in _NEEDED:
        if given[name] is None:
            raise InvalidInputError(f"{given.label(name)}: is needed (see --help)")
    if len(given["heights"]) != 2 or not given["heights"][0] <= given["heights"][1]:
        raise InvalidInputError(f"--heights: expected the lowest and the highest, metres, got {given['heights']}")
    given.check_outputs([given["file"], given["stations"]])
    with messages(given):
        from assoc.recordings.arrivals import read_arrivals, read_stations

        stations = read_stations(given["stations"])
        arrivals = read_arrivals(given["file"], stations)
        found, used, said = _found(arrivals, stations, given)
        write_all(
            (given["output"], lambda: write_text(given["output"], _table(_lines(used, stations, found)))),
            (given["picks"], lambda: write_text(given["picks"], _table(_pick_lines(used, found)))),
            (given, lambda: print_lines(f"{printable(given['output'])}: {said}")),
        )


def _found(arrivals: Arrivals, stations: Stations, given: Given) -> tuple[_Emissions, Arrivals, str]:
    """Emissions, arrivals that could be of one, and what is said; once more with the rates that were found."""
    from assoc.recordings.arrivals import scene_of_arrivals

    low, high = given["heights"]
    options: dict[str, Any] = given.some(["detection_probability"])
    if given["false_alarms"] is not None:
        options["false_alarms"] = given["false_alarms"] / 3600.0
    beyond = None if given["beyond"] is None else 1e3 * given["beyond"]
    events = None
    for _ in range(2):
        made = scene_of_arrivals(
            arrivals, stations, given["wave_speed"], given["noise"], (low, high), beyond=beyond, **options
        )
        # what is left out is told once
        arrivals, sensors = made.arrivals, made.scene.sensors
        if events is None:
            events = 0.5 * len(arrivals.times) / len(sensors)
        found = _emissions(made, events)
        heard, events = sum(map(len, found.rows)), len(found.times)
        if given["detection_probability"] is None and events:
            options["detection_probability"] = min(heard / (events * len(sensors)), 0.99)
        if given["false_alarms"] is None:
            options["false_alarms"] = (len(arrivals.times) - heard + 0.5) / (len(sensors) * made.duration)
    said = (
        f"{events} emissions of {heard} arrivals at {len(sensors)} stations, {len(arrivals.times) - heard} false; "
        f"P_d {sensors[0].detection_probability:.2f}, "
        f"{3600.0 * options.get('false_alarms', 0.0):.3g} false an hour and station"
    )
    return found, arrivals, said


def _emissions(made: ArrivalScene, events: float) -> _Emissions:
    """The optimal association of each scan; ``events`` are expected in all."""
    from assoc.association import associate
    from assoc.costs import emission_times

    scene, region = made.scene, made.scene.region
    flat = bool(region[2, 0] == region[2, 1])
    volume = float(np.prod(np.ptp(region, axis=1)[: 2 if flat else 3]))
    listened = float(np.ptp(scene.sensors[0].field_of_view))
    density = max(events, 0.5) / made.duration * listened / volume
    parts: list[tuple[float, Array, Array, Array, Array]] = []
    for scan in associate(scene, gating={"target_density": density}).scans:
        assert scan.positions is not None and scan.covariances is not None
        times = scene.times[scan.scan] + emission_times(scene, scan.scan, scan.targets)
        for row, place, spread, at in zip(scan.targets, scan.positions, scan.covariances, times, strict=True):
            heard = np.flatnonzero(row).tolist()
            rows = np.array([made.rows[scan.scan][k][row[k] - 1] for k in heard])
            away = [scene.sensors[k].measure(place[None])[0, 0] for k in heard]
            parts.append((float(at), place, spread, rows, made.arrivals.times[rows] - at - away))
    parts.sort(key=lambda part: part[0])
    columns: Any = ([part[k] for part in parts] for k in range(5))
    return _Emissions(*columns)


def _lines(arrivals: Arrivals, stations: Stations, found: _Emissions) -> Iterable[Sequence[object]]:
    """Rows of the table of emissions, the first its header."""
    from assoc.scene.geodesy import geodetic

    earth = stations.origin is not None
    yield ["event", "time", *(("latitude", "longitude", "altitude") if earth else ("x", "y", "z")),
           "sd_east" if earth else "sd_x", "sd_north" if earth else "sd_y", "sd_up" if earth else "sd_z",
           "arrivals", "rms_residual"]  # fmt: skip
    for k, (at, position) in enumerate(zip(found.times, found.positions, strict=True)):
        place = position
        if stations.origin is not None:
            place = geodetic(position[None], stations.origin)[0] * [*np.degrees([1.0, 1.0]), 1.0]
        digits = (7, 7, 1) if earth else (3, 3, 3)
        spread = np.sqrt(np.diag(found.covariances[k]))
        rms = float(np.sqrt(np.mean(found.residuals[k] ** 2)))
        yield [k + 1, _moment(arrivals, at), *(f"{v:.{n}f}" for v, n in zip(place, digits, strict=True)),
               *(f"{value:.4g}" for value in spread), len(found.rows[k]), f"{rms:.3g}"]  # fmt: skip


def _pick_lines(arrivals: Arrivals, found: _Emissions) -> Iterable[Sequence[object]]:
    """Rows of the table of arrivals in the order of their file, the first its header."""
    of = {int(row): (k + 1, f"{residual:.3g}") for k, (rows, residuals) in enumerate(zip(*found[3:], strict=True))
          for row, residual in zip(rows, residuals, strict=True)}  # fmt: skip
    yield ["row", "time", "station", "phase", "event", "residual"]
    for k in np.argsort(arrivals.rows).tolist():
        named = (spreadsheet_text(arrivals.stations[k]), spreadsheet_text(arrivals.phases[k]))
        yield [arrivals.rows[k], _moment(arrivals, arrivals.times[k]), *named, *of.get(k, (0, ""))]


def _moment(arrivals: Arrivals, seconds: float) -> str:
    """A time as those of the file, to the nanosecond."""
    import datetime

    whole, rest = divmod(round(seconds * 1e9), 10**9)
    whole += arrivals.start
    if not arrivals.dated:
        return f"{whole}.{rest:09d}" if whole >= 0 else f"{whole + rest / 1e9:.9f}"
    return f"{datetime.datetime.fromtimestamp(whole, datetime.UTC):%Y-%m-%dT%H:%M:%S}.{rest:09d}Z"


def _table(rows: Iterable[Sequence[object]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def parser() -> Parser:
    """Return the parser of the program."""
    made = Parser(
        prog="assoc.locate",
        usage=f"{command('locate')} ARRIVALS.csv --stations FILE --wave-speed M/S --noise S --heights LOW,HIGH -o FILE",
        description="Find which arrival times at stations are of one emission, and where and when it was:\n"
        "multilateration, earthquakes, shots.",
    )
    made.declare(*_OPTIONS)
    return made


PROGRAM = Program("assoc.locate", _locate, EarlyEnd("assoc.locate").on_signals)
start, main = PROGRAM.start, PROGRAM.main

if __name__ == "__main__":
    raise SystemExit(start())

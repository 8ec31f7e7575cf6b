"""``python -m assoc.inspect``: says what it understands of a description of radars, and what looks wrong.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from assoc._cli.lines import print_lines
from assoc._cli.messages import messages
from assoc._cli.options import Option, Parser, verbosity
from assoc._cli.program import Program, command
from assoc._cli.signals import EarlyEnd
from assoc._cli.track.radars_file import read_radars
from assoc._cli.values import Output
from assoc._text.plain import printable
from assoc._text.times import moment
from assoc.errors import InvalidInputError

if TYPE_CHECKING:
    from assoc._cli.track.radars_file import Radars
    from assoc._types import Array
    from assoc.recordings import Recording
    from assoc.registration.agreement import Agreement

_MANY = 30
"""Plots or places below which nothing is said of noise, or of radars that see nothing in common."""
_KEPT = ("Mode A", "an address", "a height")
_OPTIONS = (
    Option("file", "radars.toml", "description of radars (docs/from_files.md)", positional=True),
    Option("picture", "FILE", "draw the radars and all plots (.png, .svg or .pdf; needs assoc[plot])",
           Output(".png", ".svg", ".pdf", strict=True, streams=False, extras={"": ("matplotlib", "plot")})),
    *verbosity("nothing else at present"),
)  # fmt: skip


def _inspect(words: list[str]) -> None:
    given = parser().read(words)
    given.check_outputs([given["file"]])
    with messages(given):
        if not given["file"].lower().endswith(".toml"):
            raise InvalidInputError(
                f"{given['file']}: expected a description of radars (radars.toml); plots and scenes are tracked by "
                "'assoc track', which says what their file holds"
            )
        found = read_radars(given["file"])
        for line in _lines(found):
            print_lines(line)
        compared, differing, unknown = compared_lines(found)
        wrong = suspicious(found) + differing
        for line in compared:
            print_lines(printable(line))
        for title, lines in (("looks wrong:", wrong), ("not compared with anything:", unknown)):
            if lines:
                print_lines("\n  ".join([title, *map(printable, lines)]))
        if not wrong:
            print_lines("nothing looks wrong" + (" in what was compared" if unknown else ""))
        if given["picture"]:
            _draw(given["picture"], found)


def _draw(path: str, found: Radars) -> None:
    from matplotlib.figure import Figure

    from assoc._files.output import write_atomically
    from assoc.plotting import plot_scene

    figure = Figure(figsize=(7.0, 7.0), layout="constrained")
    plot_scene(found.scene, ax=figure.add_subplot())
    kind = path.rsplit(".", 1)[1].lower()
    write_atomically(path, lambda file: figure.savefig(file, format=kind, dpi=150))


def parser() -> Parser:
    """Return the parser of the program."""
    made = Parser(
        prog="assoc.inspect",
        usage=f"{command('inspect')} radars.toml [--picture FILE.png]",
        description="Say what is understood of several radars' files, and what looks wrong, before tracking them.",
    )
    made.declare(*_OPTIONS)
    return made


def _lines(found: Radars) -> list[str]:
    """What was understood, a line for each radar and for what was corrected when its file was read."""
    lines = []
    for recording, radar, turn in zip(found.recordings, found.radars, found.turns, strict=True):
        sigma = radar.covariance.diagonal() ** 0.5
        kept = (recording.decoded, recording.addresses > 0, recording.trusted_altitudes == recording.trusted_altitudes)
        shares = [f"{100 * part.mean():.0f} % with {what}" for part, what in zip(kept, _KEPT, strict=True)]
        parts = [
            f"{len(recording)} plots, {moment(recording.times[0])} to {moment(recording.times[-1])}",
            f"a turn {turn:.4g} s",
            f"noise {sigma[0]:.4g} m, {math.degrees(sigma[1]):.3g} deg",
            f"reach {radar.field_of_view[0, 1] / 1000:.4g} km",
            f"P_d {radar.detection_probability:g}, {radar.false_alarm_rate:g} false plots a turn",
            ", ".join(shares),
            *(f"{what}: {number}" for what, number in recording.notes.items() if number),
        ]
        lines.append(printable(f"{radar.name}: {'; '.join(parts)}"))
    for one, sensor in found.reports:
        targets = len({*one.identities[:, 1].tolist()} - {0})
        parts = [
            f"{len(one)} reports of {targets} targets, {moment(one.times[0])} to {moment(one.times[-1])}",
            f"noise {sensor.covariance[0, 0] ** 0.5:.4g} m",
            "with altitudes" if sensor.dim == 3 else "without altitudes",
            *(f"{what}: {number}" for what, number in one.notes.items()),
        ]
        lines.append(printable(f"{sensor.name}: {'; '.join(parts)}"))
    return lines


def suspicious(found: Radars) -> list[str]:
    """What looks wrong, a line each; units are warned of when the files are read."""
    import numpy as np

    from assoc.recordings import estimate_rotation

    lines = []
    spans = [(part.times[0], part.times[-1]) for part in found.recordings]
    if len(spans) > 1 and max(first for first, _ in spans) >= min(last for _, last in spans):
        lines.append("the recordings do not overlap in time: another day, or other clocks (time zones)?")
    places = np.array([radar.position for radar in found.radars])
    reach = np.array([radar.field_of_view[0, 1] for radar in found.radars])
    for s, (recording, radar, turn) in enumerate(zip(found.recordings, found.radars, found.turns, strict=True)):
        apart = np.hypot(*(places - places[s])[:, :2].T)
        others = np.arange(len(places)) != s
        if others.any() and (apart > reach + reach[s])[others].all():
            lines.append(f"{radar.name}: sees nothing that another radar sees: are the places right?")
        if np.bincount(np.unique(apart, return_inverse=True)[1])[0] > 1:
            lines.append(f"{radar.name}: stands where another radar stands: are the places right?")
        try:
            seen = estimate_rotation(recording)
        except InvalidInputError:
            lines.append(f"{radar.name}: its plots fit no turn of {turn:.4g} s: are bearings and times right?")
            continue
        if abs(seen / turn - 1.0) > 0.02:
            lines.append(f"{radar.name}: its plots turn once in {seen:.4g} s, not in {turn:.4g} s")
        rate = len(recording) / max((recording.times[-1] - recording.times[0]) / turn, 1.0)
        if rate < 0.5:
            lines.append(f"{radar.name}: {rate:.2g} plots a turn: is a part of the file missing?")
    return lines


def compared_lines(found: Radars) -> tuple[list[str], list[str], list[str]]:
    """What agrees with what, what does not, and what was compared with nothing: nothing else may be called right."""
    import numpy as np

    from assoc.registration.agreement import compare, noise_of, reported, standing_still

    agreed, wrong, unknown = [], [], []
    assert found.scene.origin is not None
    reports = [
        reported(
            one.times,
            one.in_scene(found.scene.origin)[:, :2],
            one.identities[:, 1],
            float(np.sqrt(sensor.covariance[0, 0])),
        )
        for one, sensor in found.reports
    ]
    recordings = []
    for recording, radar, turn in zip(found.recordings, found.radars, found.turns, strict=True):
        still = standing_still(recording, turn)
        recordings.append(recording.take(np.flatnonzero(~still)))
        if still.any():
            agreed.append(f"{radar.name}: {still.sum()} plots are of what stands still (turbines, masts): not compared")
    compared, high = (
        compare(recordings, found.radars, found.turns, found.scene.origin, reports),
        _without_heights(found, recordings),
    )
    for s, one in enumerate(compared):
        radar = found.radars[s]
        declared = radar.covariance.diagonal() ** 0.5
        if one.change is None:
            # what the others see may be too little to be found again
            others = math.inf if reports else sum(other.places for other in compared) - one.places
            if min(one.places, others) >= _MANY:
                wrong.append(
                    f"{radar.name}: {one.places} places where another sensor looks, and no turn of north, unit of "
                    "ranges or clock with which they see the same targets: is the place right?"
                )
            else:
                unknown.append(f"{radar.name}: bearings, ranges and times: too few targets that another sensor sees")
        else:
            agreed.append(f"{radar.name}: another sensor sees the same target at {one.common} of {one.places} places")
            wrong += [f"{radar.name}: {text}" for text in _differences(one, declared, flat=not high)]
        noise = noise_of(recordings[s], found.turns[s])
        if noise.plots < _MANY:
            unknown.append(f"{radar.name}: noise: {noise.plots} plots are between two others of the same target")
            continue
        seen = f"{noise.range:.3g} m and {math.degrees(noise.azimuth):.2g} deg"
        agreed.append(f"{radar.name}: plots are {seen} from straight lines through those before and after")
        ratios = (noise.range / declared[0], noise.azimuth / declared[1])
        if not all(1 / 3 < ratio < 3 for ratio in ratios):
            said = f"{declared[0]:.3g} m and {math.degrees(declared[1]):.2g} deg"
            wrong.append(f"{radar.name}: noise: {said} are declared, {seen} are seen")
    if high and agreed:
        unknown.append(
            f"{', '.join(high)}: small errors of ranges and bearings: most plots have no height ('heights = [lowest, "
            "highest]', metres, says how high targets are)"
        )
    if found.reports and not found.radars:
        unknown.append("positions that are reported: no radar sees the targets")
    return agreed, wrong, unknown


def _without_heights(found: Radars, recordings: list[Recording]) -> list[str]:
    """Radars whose slant ranges are longer than ground ranges by an unknown part that is more than half their noise."""
    import numpy as np

    region, names = found.scene.region, []
    top = abs(region[2, 1]) if len(region) > 2 else 20_000.0
    for recording, radar in zip(recordings, found.radars, strict=True):
        few = len(recording) > 0 and np.isfinite(recording.trusted_altitudes).mean() < 0.5
        if few and top**2 > float(np.median(recording.ranges)) * radar.covariance[0, 0] ** 0.5:
            names.append(radar.name)
    return names


def _differences(one: Agreement, declared: Array, *, flat: bool) -> list[str]:
    """What is different between a radar and the others; small differences only where heights are known."""
    from assoc.registration.agreement import UNITS

    change = one.change
    assert change is not None
    lines = []
    if change.mirrored:
        lines.append("its bearings fit the others if they are counted counter-clockwise")
    units = [f"{was}, read as {read}" for (was, read), factor in UNITS.items() if factor == change.scale]
    if units:
        lines.append(f"its ranges fit the others times {change.scale:.4g}: are they {units[0]}?")
    if change.shift:
        early = "early" if change.shift > 0 else "late"
        bias = f"bias = {{ time = {-change.shift:g} }}"
        lines.append(
            f"its times are about {abs(change.shift):g} s too {early} beside the others ({bias} takes that off)"
        )
    turn, length = math.degrees(change.turn + one.turn[0]), one.length[0]
    way = "clockwise" if turn > 0 else "counter-clockwise"
    if change.turn:
        bias = f"bias = {{ bearing = {turn:.2f} }}"
        lines.append(f"its bearings are {abs(turn):.4g} deg too far {way} beside the others ({bias} takes that off)")
    small = [
        f"bearings {abs(turn):.2g} deg too far {way}",
        f"ranges {abs(length):.3g} m too {'short' if length > 0 else 'long'}",
    ]
    apart = [
        abs(one.turn[0]) > max(4.0 * one.turn[1], 0.5 * declared[1]) and not change.turn,
        abs(length) > max(4.0 * one.length[1], 0.5 * declared[0]),
    ]
    if flat and any(apart):
        said = " and ".join(text for text, is_so in zip(small, apart, strict=True) if is_so)
        lines.append(f"beside the others {said}: assoc register radars.toml --write finds whose error it is")
    return lines


PROGRAM = Program("assoc.inspect", _inspect, EarlyEnd("assoc.inspect").on_signals)
start, main = PROGRAM.start, PROGRAM.main

if __name__ == "__main__":
    raise SystemExit(start())

"""The thesis's tables 2.1, 4.1 to 4.24 read again, and its five aircraft tracked by us.

FOLDER holds the tables as CSV files (--help says which). Checked are the groups of tables 4.1 to
4.8, the conversion and headings (equations 3.1 to 3.8), and which of an aircraft's plots (tables 4.9 to 4.17) its
tracks hold without and with the window (tables 4.10 to 4.23). The recording is not public and the tables have no
times: for our tracks of the same plots the times are chosen by us, a turn of 9.5 s for each plot, more where an
aircraft has gone further than 220 m/s take it in that time. (Section 4.2.2.4: 183 groups without window and
119 windows; if these are of 9.5 s, groups are of 6.2 s on average.) A line of table 4.21 is not legible in our copy:
the track of 903 may hold one plot more.
"""

import argparse
import csv
import math
from pathlib import Path

import numpy as np

from assoc._types import Array
from assoc.errors import InvalidInputError
from assoc.recordings import Recording, clustering_time_window, estimate_rotation, radar_of, read_plots
from assoc.recordings.columns import NAUTICAL_MILE
from assoc.simulation.scenarios.rotating_radar import BEARING_STEP
from experiments.common.claims import Claim
from experiments.common.command import add_files, report
from experiments.papers.clustering_time_window import pairs
from experiments.papers.clustering_time_window.hypotheses import HypothesisTracker
from experiments.papers.clustering_time_window.judging import run
from experiments.papers.clustering_time_window.traffic import ROTATION, decided_by_reid

NAME = "papers.clustering_time_window.tables"
AIRCRAFT = {902: (9, 10, 19), 2467: (11, 12, 20), 903: (13, 14, 21), 958: (15, 16, 22), 2428: (17, 18, 23)}
"""Mode 3 -> tables of the ground truth, of the track without and with the window."""
SPEED = 220.0
"""Metres per second at which aircraft are taken to cross what lies between two rows of a table; chosen by us."""
MISSES = (3, 5, 8)
"""Of Reid's MHT at a constant step."""
FILES = (
    "FOLDER: each table is a CSV file, typed off, with a line of column names; of table N.M it is tN_M_ANYTHING.csv, as"
    " t4_9_902.csv. Table 2.1: time (0:13:06), range_nmi, bearing_deg, mode3_dec, altitude_fl. Tables 4.1 to 4.8:"
    " range_nmi, mode3_dec. 4.9 to 4.23: x_px, y_px (Lon(X), Lat(Y) in print), and for 4.9, 4.11, 4.13, 4.15 and 4.17"
    " heading_deg, altitude_fl. 4.24: mode3_dec, x_px, y_px. Rows in the order of print, mode3_dec 0 where no code was"
    " decoded, altitudes in flight levels; further columns are not read."
)
PIXEL = 5.0 / 7.0
"""Screen pixels for a nautical mile: what stands in the tables in place of equations 3.1 and 3.2."""


def columns_of(number: int) -> tuple[str, ...]:
    """Columns of table 4.number that are read."""
    if number <= 8:
        return "range_nmi", "mode3_dec"
    place = "x_px", "y_px"
    if number == 24:
        return "mode3_dec", *place
    return (*place, "heading_deg", "altitude_fl") if number in {one[0] for one in AIRCRAFT.values()} else place


def table_file(folder: Path, name: str) -> Path:
    """The file of a table.

    Raises SystemExit: The folder has no such file.
    """
    chapter, number = name.split(".")
    found = sorted([*folder.glob(f"t{chapter}_{number}_*.csv"), *folder.glob(f"t{chapter}_{int(number):02}_*.csv")])
    if not found:
        raise SystemExit(f"{folder}: expected a file t{chapter}_{number}_*.csv, the thesis's table {name}; see --help")
    return found[0]


def read(folder: Path, number: int) -> list[dict[str, float]]:
    """Rows of table 4.number.

    Raises SystemExit: The folder has no such file, or it lacks a column or a number.
    """
    path, columns = table_file(folder, f"4.{number}"), columns_of(number)
    with open(path, encoding="utf-8", newline="") as file:
        lines = csv.DictReader(file)
        try:
            return [{name: float(row[name]) for name in columns} for row in lines]
        except (KeyError, TypeError, ValueError):
            wanted = ", ".join(columns)
            raise SystemExit(f"{path}, line {lines.line_num}: expected numbers in the columns {wanted}") from None


def plane(rows: list[dict[str, float]]) -> Array:
    """Screen positions (n, 2)."""
    return np.array([(row["x_px"], row["y_px"]) for row in rows]).reshape(-1, 2)


def polar(places: Array) -> Array:
    """Range (nmi) and bearing (deg from north, clockwise) of screen positions, (n, 2)."""
    bearing = np.degrees(np.arctan2(places[:, 0], -places[:, 1])) % 360.0
    return np.stack([np.hypot(*places.T) / PIXEL, bearing], axis=1)


def headings(places: Array) -> Array:
    """Equations 3.3, 3.4, 3.7 and 3.8 from plot to plot with north up, degrees, (n - 1,)."""
    dx, dy = np.diff(places[:, 0]), -np.diff(places[:, 1])
    alpha = np.degrees(np.arctan2(dy, dx)) - 90.0
    return np.where(alpha < 0, -alpha, 360.0 - alpha) % 360.0


def held(truth: Array, track: Array) -> tuple[int, int]:
    """How many plots of the truth a track holds, each counted once, and how many of its own are others' or repeats."""
    left = [tuple(np.round(place, 2)) for place in track.tolist()]
    count = 0
    for place in truth.tolist():
        near = [point for point in left if math.dist(point, place) < 0.02]
        if near:
            left.remove(near[0])
            count += 1
    return count, len(left)


def as_recording(tables: dict[int, list[dict[str, float]]]) -> Recording:
    """The five aircraft's plots in time; see above for the times."""
    columns: list[tuple[float, float, float, int, float]] = []
    for identity, rows in tables.items():
        seen = polar(plane(rows))
        steps = np.linalg.norm(np.diff(plane(rows), axis=0), axis=1) / PIXEL * NAUTICAL_MILE
        turns = np.concatenate([[0], np.cumsum(np.maximum(1, np.round(steps / (SPEED * ROTATION))))])
        for turn, (distance, bearing), row in zip(turns, seen, rows, strict=True):
            time = (float(turn) + bearing / 360.0) * ROTATION
            columns.append((time, distance, bearing, identity, row["altitude_fl"]))
    columns.sort()
    times, ranges, bearings, names, levels = (np.array(column) for column in zip(*columns, strict=True))
    return Recording(
        times, NAUTICAL_MILE * ranges, math.pi / 2 - np.radians(bearings), identities=names.astype(int),
        altitudes=30.48 * levels, sources=names.astype(int),
    )  # fmt: skip


def groups(folder: Path) -> list[Claim]:
    """Tables 2.1 and 4.1 to 4.8."""
    source = "tables 2.1 and 4.1 to 4.3"
    path = table_file(folder, "2.1")
    try:
        recording = read_plots(path)
    except InvalidInputError as error:
        raise SystemExit(str(error)) from None
    windows = clustering_time_window(recording, ROTATION, by="time")
    claims = [
        Claim("table 2.1: plots", "", None, len(recording), source="table 2.1"),
        Claim("table 2.1: rotation time estimated", "s", None, estimate_rotation(recording), None, (9.0, 10.0),
              source="section 2.2.2 says about 10 s; 9 to 10 s chosen by us"),
    ]  # fmt: skip
    for number in (1, 2, 3):
        ours = {(r / NAUTICAL_MILE, i) for r, i in _plots(recording, windows[number - 1].rows)}
        ours = {(round(r), i) for r, i in ours}
        printed = {(round(row["range_nmi"]), round(row["mode3_dec"])) for row in read(folder, number)}
        known = {(round(r / NAUTICAL_MILE), i) for r, i in _plots(recording, np.arange(len(recording)))}
        part = len(ours & printed) == len(printed & known) == len(ours)
        what = f"table 4.{number}: plots of our window {number} in it"
        claims.append(Claim(what, "", None, len(ours & printed), holds=part, source=source))
    for turn in (ROTATION, 10.0):
        twice = 0
        for window in clustering_time_window(recording, turn, by="time"):
            names = recording.identities[window.rows]
            names = names[names > 0]
            twice += len(names) - len(np.unique(names))
        claims.append(Claim(f"table 2.1: aircraft twice in one of our windows of {turn:g} s", "", None, twice, None,
                            (0, 0), source="section 2.2.2: none, at about 10 s"))  # fmt: skip
    for number in range(1, 9):
        printed_names = [row["mode3_dec"] for row in read(folder, number) if row["mode3_dec"] > 0]
        twice = len(printed_names) - len(set(printed_names))
        claims.append(
            Claim(f"table 4.{number}: aircraft that are in the group twice", "", None, twice, None,
                  (0, 0) if number <= 4 or number == 6 else (1, None),
                  source="section 4.2.1: none with the window, without it all groups but the second")
        )  # fmt: skip
    return claims


def _plots(recording: Recording, rows: Array) -> list[tuple[float, int]]:
    return list(zip(recording.ranges[rows].tolist(), recording.identities[rows].tolist(), strict=True))


def judge(folder: Path) -> list[Claim]:
    """All checks."""
    claims = groups(folder)
    tables = {identity: read(folder, numbers[0]) for identity, numbers in AIRCRAFT.items()}
    on_grid, total, right, turned = 0, 0, 0, 0
    better, sums = 0, {"without": 0, "with": 0}
    for identity, numbers in AIRCRAFT.items():
        truth = plane(tables[identity])
        parts = {"truth": truth, "without": plane(read(folder, numbers[1])), "with": plane(read(folder, numbers[2]))}
        if identity == 2428:
            places = len(np.unique(np.round(parts["without"], 2), axis=0))
        for part in parts.values():
            distance, bearing = polar(part).T
            steps = bearing / BEARING_STEP
            on_grid += int(
                ((np.abs(distance - np.round(distance)) < 0.01) & (np.abs(steps - np.round(steps)) < 0.02)).sum()
            )
            total += len(part)
        printed = np.array([row["heading_deg"] for row in tables[identity]])[1:]
        off = np.abs((headings(truth) - printed + 180.0) % 360.0 - 180.0)
        right, turned = right + int((off[printed > 0] < 1.0).sum()), turned + int((printed > 0).sum())
        counts = {}
        for name, number in (("without", numbers[1]), ("with", numbers[2])):
            counts[name], other = held(truth, parts[name])
            sums[name] += counts[name]
            words = f"aircraft {identity}: plots of its {len(truth)} in the track {name} the window"
            claims.append(Claim(words, "", None, counts[name], source=f"tables 4.{numbers[0]} and 4.{number}"))
            words = f"aircraft {identity}: other plots or repeats in the track {name} the window"
            claims.append(Claim(words, "", None, other, source=f"tables 4.{numbers[0]} and 4.{number}"))
        better += counts["with"] > counts["without"]
    claims += [
        Claim("aircraft 2428: places in its track without the window", "", 3, places, None, (3, 3),
              source="section 4.2.2.1 against table 4.18"),
        Claim("aircraft of the five whose plots the window's track holds more of", "", 4, better, None, (4, 4),
              source="conclusion 2 against tables 4.9 to 4.23"),
        Claim(f"positions of tables 4.9 to 4.23 on the radar's grid, 5/7 pixels a mile, of {total}", "%", None,
              100.0 * on_grid / total, None, (99.0, None), source="tables 4.9 to 4.23; equations 3.1 and 3.2 do not"),
        Claim(f"headings of the ground truth within 1 deg of equations 3.7 and 3.8, of {turned} that are not 0", "%",
              None, 100.0 * right / turned, None, (95.0, None), source="tables 4.9 to 4.17; 95 % chosen by us"),
    ]  # fmt: skip
    noise = read(folder, 24)
    zero, first = (next(row for row in noise if row["mode3_dec"] == name) for name in (0, 958))
    apart = math.dist((zero["x_px"], zero["y_px"]), (first["x_px"], first["y_px"]))
    claims.append(Claim("table 4.24: pixels between the plot without identity and the first of 958", "", None, apart,
                        None, (0.0, 0.01), source="section 4.2.2.3"))  # fmt: skip
    plots = sum(len(rows) for rows in tables.values())
    words = {"without": "the tracks without the window", "with": "the tracks with the window"}
    claims += [Claim(f"five aircraft: plots in {words[name]}", "", None, sums[name], source="tables 4.9 to 4.23")
               for name in sums]  # fmt: skip
    claims.append(Claim("five aircraft: plots", "", None, plots, source="tables 4.9 to 4.17"))
    return claims + of_trackers(as_recording(tables))


def of_trackers(recording: Recording) -> list[Claim]:
    """Track the five aircraft together in windows: their plots in one track, swaps, and starts anew, by tracker."""
    windows = clustering_time_window(recording, ROTATION, by="time")
    track_oriented = HypothesisTracker(radar_of(recording))
    run(track_oriented, windows)
    by_name = {"track-oriented MHT, time stamps": track_oriented.decided()}
    for misses in MISSES:
        by_name[f"Reid's MHT, constant step, {misses} misses"] = decided_by_reid(recording, windows, ROTATION, misses)
    by_name["Reid's MHT, time stamps"] = decided_by_reid(recording, windows)
    claims = []
    for name, taken in by_name.items():
        held = {}
        for identity in AIRCRAFT:
            own = recording.identities[taken.rows] == identity
            held[identity] = int(np.bincount(taken.tracks[own & (taken.tracks >= 0)], minlength=1).max())
            what = f"aircraft {identity}: plots of its {own.sum()} in our track, times chosen by us, {name}"
            claims.append(Claim(what, "", None, held[identity],
                                source=f"table 4.{AIRCRAFT[identity][0]}; chosen by us"))  # fmt: skip
        swapped = pairs.swaps(recording, taken)
        for what, count in (
            ("plots in our tracks", sum(held.values())),
            ("swaps of our tracks", swapped),
            ("times that our track ends and another begins", pairs.switches(recording, taken) - swapped),
        ):
            claims.append(Claim(f"five aircraft: {what}, times chosen by us, {name}", "", None, count,
                                source="chosen by us"))  # fmt: skip
    return claims


def program(arguments: list[str] | None = None) -> int:
    """Run the checks; returns the exit code."""
    parser = argparse.ArgumentParser(
        prog=f"python -m experiments.{NAME}",
        description="Read the thesis's tables again and track its five aircraft.",
        epilog=FILES,
    )
    parser.add_argument("folder", type=Path, metavar="FOLDER", help="the thesis's tables as CSV files")
    add_files(parser, NAME)
    chosen = parser.parse_args(arguments)
    if not chosen.folder.is_dir():
        parser.error(f"{chosen.folder}: expected a folder with the thesis's tables")
    report(chosen, judge(chosen.folder), NAME, __doc__)
    return 0


if __name__ == "__main__":
    raise SystemExit(program())

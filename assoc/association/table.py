"""The table of an association: one row a scan, for people and as CSV."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterator, Sequence

from assoc._text.plain import printable, spreadsheet_text
from assoc.association.scan import ScanAssociation

_HEADERS = ("scan", "measurements", "targets", "false alarms", "cost", "lower bound", "gap", "status", "ms")
LEFT_ALIGNED = ("file", "status")


def rows(
    scans: Sequence[ScanAssociation],
    files: Sequence[str],
    *,
    brief: bool = False,
) -> tuple[list[str], list[list[str]]]:
    """Headers and cells for people; ``brief``, for a terminal, leaves out folders and bounds, and gaps that are closed.

    ``files`` are those of all scans, of which the first are here; they are shown if there are several.
    """
    if brief:
        # the last parts of paths, if these differ
        short = {file: os.path.basename(file) for file in files}
        files = [short[file] for file in files] if len({*short.values()}) == len(short) else files
    several = len(set(files)) > 1
    ranked = any(scan.ranked for scan in scans)
    truth = any(scan.true_tuples is not None for scan in scans)
    headers = [*(["file"] if several else []), *_HEADERS]
    probable = any(scan.probabilities is not None for scan in scans)
    headers += [*(["least sure"] if probable else [])]
    headers += ["correct"] if truth else []
    if ranked:
        headers.insert(headers.index("scan") + 1, "rank")
    cells = []
    for scan, file, rank in _lines(scans, files[: len(scans)]):
        solution = scan.solution
        row = [printable(file)] if several else []
        row += [
            str(scan.scan),
            *([str(rank)] if ranked else []),
            " ".join(map(str, scan.sizes)),
            str(len(scan.targets)),
            str(scan.false_alarms),
            f"{solution.cost:.4f}",
            f"{solution.lower_bound:.4f}",
            f"{solution.gap:.2g}",
            solution.status,
            f"{1e3 * solution.runtime:.2f}",
        ]
        if probable:
            row.append("" if scan.least_probable is None else f"{scan.least_probable:.3f}")
        if truth:
            row.append("" if scan.true_tuples is None else f"{scan.correct_tuples}/{scan.true_tuples}")
        cells.append(row)
    if brief:
        gap, status = headers.index("gap"), headers.index("status")
        for row in cells:
            row[status] = row[status] if row[status] == "optimal" else f"gap {row[gap]}"
        kept = [column for column, header in enumerate(headers) if header not in ("lower bound", "gap")]
        headers, cells = [headers[i] for i in kept], [[row[i] for i in kept] for row in cells]
    return headers, cells


def _lines(scans: Sequence[ScanAssociation], files: Sequence[str]) -> Iterator[tuple[ScanAssociation, str, int]]:
    """One line for each scan, or for each of its ranked associations: association, file, rank."""
    for scan, file in zip(scans, files, strict=True):
        for rank, ranked in enumerate(scan.ranked or (scan,), start=1):
            yield ranked, file, rank


def to_csv(scans: Sequence[ScanAssociation], files: Sequence[str]) -> str:
    """Return the table as CSV with full precision; sizes are joined by blanks, unknown values are empty."""
    ranked = any(scan.ranked for scan in scans)
    probable = any(scan.probabilities is not None for scan in scans)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(
        ["file", "scan", *(["rank"] if ranked else []), "time", "sizes", "targets", "false_alarms", "cost"]
        + ["lower_bound", "gap", "status", "runtime", "stopped_by", "iterations", "true_tuples", "correct_tuples"]
        + ["compile_time", *(["least_probable"] if probable else [])]
    )
    for scan, file, rank in _lines(scans, files):
        solution = scan.solution
        sizes = " ".join(map(str, scan.sizes))
        writer.writerow(
            [spreadsheet_text(file), scan.scan, *([rank] if ranked else []), scan.time, sizes]
            + [len(scan.targets), scan.false_alarms, solution.cost, solution.lower_bound, solution.gap]
            + [solution.status, solution.runtime, solution.stopped_by, solution.iterations]
            + [scan.true_tuples, scan.correct_tuples, scan.compile_time]
            + ([scan.least_probable] if probable else [])
        )
    return text.getvalue()

"""The report of an association: targets, cost and gap of each scan."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence

import numpy as np

from assoc._system.wrong_types import explains_wrong_types
from assoc._text.html import escape, warning_list
from assoc._text.times import moment
from assoc._types import Array
from assoc.association.association import Association
from assoc.association.scan import ScanAssociation
from assoc.association.source import Source, warnings_of
from assoc.costs import tuple_costs
from assoc.errors import InvalidInputError
from assoc.plotting.report.figures import (
    Dicts,
    evenly,
    layout,
    line,
    plain_numbers,
    scatter,
    sliding,
    within_budget,
)
from assoc.plotting.report.page import Part, cards, check_report, definitions, note, settings_part, table, write_page
from assoc.plotting.report.scene import scene_figure
from assoc.problem import AssignmentProblem
from assoc.scene.scene import Scene

_MOST_SOURCES = 12
_LINES_OF_TRACE = 200
_CSV = "; --csv writes all"


@explains_wrong_types
def write_association_report(
    path: str | os.PathLike[str],
    association: Association,
    sources: Source | Sequence[Source],
    names: Sequence[str] | None = None,
    *,
    words: Sequence[str] | None = None,
) -> None:
    """Write an association as one HTML file that works without a network.

    Parameters
    ----------
    path : path-like
        The file to write; it appears whole or not at all.
    association : Association
    sources : Scene, AssignmentProblem, or a sequence of them
        What was associated: one source for all scans, or one for each scan.
    names : sequence of str, optional
        Name of each scan's file.
    words : sequence of str, optional
        The command line of ``python -m assoc.solve`` that made it, to be shown.

    Raises
    ------
    MissingExtraError
        plotly is not installed; an ImportError that names the command.
    InvalidInputError
        The file cannot be written, or the numbers of sources and scans differ.
    """
    check_report()
    each = [sources] * len(association.scans) if isinstance(sources, Source) else list(sources)
    files = [""] * len(each) if names is None else list(names)
    if not len(each) == len(files) == len(association.scans):
        raise InvalidInputError(
            f"sources, names: expected one for each of the {len(association.scans)} scans, "
            f"got {len(each)} and {len(files)}"
        )
    title, parts = _content(association, each, files, words)
    lead = f"Association of {len(association.scans)} scans with {association.solver}, seed {association.seed}"
    write_page(path, title, lead, parts)


def _content(
    association: Association, each: list[Source], files: list[str], words: Sequence[str] | None
) -> tuple[str, list[Part]]:
    scans = association.scans
    costs = [_costs(source, scan) for source, scan in zip(each, scans, strict=True)]
    owned: dict[tuple[int, str], list[int]] = {}
    for i, (source, file) in enumerate(zip(each, files, strict=True)):
        owned.setdefault((id(source), file), []).append(i)
    titles = {key: (getattr(each[rows[0]], "name", "") or key[1]) for key, rows in owned.items()}
    warnings = [line for rows in owned.values() for line in warnings_of(each[rows[0]])]
    parts = [Part("Summary", warning_list(warnings) + _summary(association))]
    drawn = [key for key, rows in owned.items() if isinstance(each[rows[0]], Scene)]
    for key in drawn[:_MOST_SOURCES]:
        scene, rows = each[owned[key][0]], owned[key]
        assert isinstance(scene, Scene)
        share = min(len(drawn), _MOST_SOURCES)
        figure, kept = scene_figure(scene, [scans[i] for i in rows], [costs[i] for i in rows], share)
        said = (
            "" if kept == len(rows) else note(f"{kept} of {len(rows)} scans are drawn: all would make this too large.")
        )
        parts.append(Part("Scene" if len(drawn) == 1 else f"Scene {titles[key]}", said, [figure]))
    if len(drawn) > _MOST_SOURCES:
        parts.append(Part("Further scenes", note(f"{_MOST_SOURCES} of {len(drawn)} scenes are drawn.")))
    if scans:
        parts += [
            Part("Scans", _scans(scans, files)),
            Part("Targets", _targets(scans, costs)),
            Part("Convergence", "", [_convergence(scans)]),
        ]
    # scenes and problems show themselves in notebooks in the same way
    shown = [
        (f"<h3>{escape(file)}</h3>" if file else "") + f'<div class="scroll">{each[rows[0]]._repr_html_()}</div>'
        for (_, file), rows in owned.items()
    ]
    used = {"solver": association.solver, "seed": association.seed, **association.parameters}
    settings = settings_part(f"<h3>Parameters</h3>{definitions(used)}", "assoc.solve", words)
    return ", ".join(dict.fromkeys(filter(None, titles.values()))) or "Association", [
        *parts, Part("Sensors", "".join(shown[:_MOST_SOURCES])), settings,
    ]  # fmt: skip


def _name(scan: ScanAssociation) -> str:
    return f"scan {scan.scan}" + ("" if scan.time is None else f", t = {moment(scan.time)}")


def _costs(source: Source, scan: ScanAssociation) -> Array:
    """Cost of each target of a scan."""
    if scan.costs is not None:
        return scan.costs
    if not isinstance(source, AssignmentProblem):
        return tuple_costs(source, scan.scan, scan.targets)
    rows = map(tuple, scan.solution.tuples.tolist())
    known = dict(zip(rows, source.costs[scan.solution.indices].tolist(), strict=True))
    return np.array([known[tuple(row)] for row in scan.targets.tolist()])


def _closed_gap(scan: ScanAssociation) -> float | None:
    """Return the gap, 0 if it is only rounding; None without a bound."""
    gap = scan.solution.gap
    if gap <= 1e-9 * max(1.0, abs(scan.solution.cost)):
        return 0.0
    return float(gap) if math.isfinite(gap) else None


def _summary(association: Association) -> str:
    total = association.totals()
    count = total["scans"]
    bound = total["lower_bound"]
    gaps = [_closed_gap(scan) for scan in association.scans]
    gap = None if any(gap is None for gap in gaps) else sum(gap or 0.0 for gap in gaps)
    content = {
        "Targets": (f"{total['targets']:,}", f"in {count:,} scans"),
        "False alarms": (f"{total['false_alarms']:,}", f"of {total['measurements']:,} measurements"),
        "Cost": (_figure(total["cost"]), "sum over the scans; negative log likelihood ratio"),
        "Lower bound": (_figure(bound), "no association can cost less"),
        "Gap": ("unknown" if gap is None else f"{gap:.2g}", "how much more than the optimum at most"),
        "Certified optimal": (f"{total['optimal']:,} of {count:,}", "scans with a closed gap"),
        "Solver": (f"{total['runtime']:.3g} s", f"{1e3 * total['runtime'] / max(count, 1):.3g} ms a scan"),
    }
    if total["compile_time"] > 0.0:
        content["Compiling"] = (f"{total['compile_time']:.3g} s", "not in the solver's time; once after installation")
    if total["share_correct"] is not None:
        content["Correct"] = (
            f"{100 * total['share_correct']:.1f} %",
            f"{total['correct_tuples']:,} of {total['true_tuples']:,} true tuples",
        )
    return cards(content)


def _figure(value: float | None) -> str:
    return "unknown" if value is None else f"{value:,.6g}".replace("-", "\u2212")


def _scans(scans: Sequence[ScanAssociation], files: Sequence[str]) -> str:
    columns: dict[str, list[str]] = {"scan": [str(scan.scan) for scan in scans]}
    if len({*files}) > 1:
        columns["file"] = list(files)
    if any(scan.time is not None for scan in scans):
        columns["time"] = ["" if scan.time is None else moment(scan.time) for scan in scans]
    gaps = [_closed_gap(scan) for scan in scans]
    columns |= {
        "measurements": [" + ".join(map(str, scan.sizes)) for scan in scans],
        "targets": [str(len(scan.targets)) for scan in scans],
        "false alarms": [str(scan.false_alarms) for scan in scans],
        "cost": [f"{scan.solution.cost:.4f}" for scan in scans],
        "lower bound": [f"{scan.solution.lower_bound:.4f}" for scan in scans],
        "gap": ["unknown" if gap is None else f"{gap:.2g}" for gap in gaps],
        "status": [scan.solution.status for scan in scans],
        "ms": [f"{1e3 * scan.solution.runtime:.2f}" for scan in scans],
    }
    if any(scan.true_tuples is not None for scan in scans):
        columns["correct"] = [
            "" if scan.true_tuples is None else f"{scan.correct_tuples}/{scan.true_tuples}" for scan in scans
        ]
    if any(len(scan.ranked) > 1 for scan in scans):
        costs = [[one.solution.cost for one in scan.ranked[:2]] for scan in scans]
        columns["to the second best"] = [f"{pair[1] - pair[0]:.4f}" if len(pair) > 1 else "" for pair in costs]
    return table([*columns], [list(row) for row in zip(*columns.values(), strict=True)], rest=_CSV)


def _targets(scans: Sequence[ScanAssociation], costs: Sequence[Array]) -> str:
    """The chosen tuples; where probabilities are known, those most in doubt come first."""
    rows = []
    for scan, values in zip(scans, costs, strict=True):
        sure = scan.probabilities
        for t, (row, cost) in enumerate(zip(scan.targets.tolist(), values.tolist(), strict=True)):
            doubt, cells = 0.0, [str(scan.scan), str(t + 1), f"({', '.join(map(str, row))})", f"{cost:.4f}"]
            if sure is not None:
                low, doubt, high = sure[t].tolist()
                cells += [f"{100 * doubt:.3g} %", f"{100 * low:.3g} to {100 * high:.3g} %"]
            rows.append((doubt, cells))
    known = any(scan.probabilities is not None for scan in scans)
    headers = ["scan", "target", "tuple", "cost", *(["probability", "proved"] if known else [])]
    if known:
        rows.sort(key=lambda row: row[0])
    return table(headers, [cells + [""] * (len(headers) - len(cells)) for _, cells in rows], most=300, rest=_CSV)


def _convergence(scans: Sequence[ScanAssociation]) -> Dicts:
    """Cost and lower bound of a scan over the iterations, with a slider over the scans."""
    steps = [(_name(scans[i]), _trace(scans[i])) for i in evenly(len(scans))]
    marker = {"symbol": "x-thin", "size": 11, "line": {"width": 2, "color": line(5)["color"]}}
    data = [
        scatter("cost of the best known", "lines+markers", line={**line(0), "shape": "hv"}, marker={"size": 9}),
        scatter("lower bound", "lines+markers", line={**line(5), "shape": "hv"}, marker=marker),
    ]
    for trace in data:
        trace["hovertemplate"] = "iteration %{x}, %{customdata:.3g} ms<br>%{y:.6g}"
    return sliding({"data": data, "layout": layout("iteration", "cost (nats)")}, within_budget(steps))


def _trace(scan: ScanAssociation) -> list[Dicts]:
    trace = scan.solution.trace
    step = max(1, math.ceil(len(trace) / _LINES_OF_TRACE))
    # the last line is the final answer and is always kept
    kept = [*trace[:-1:step], *trace[-1:]]
    rows = np.array([[1e3 * one.seconds, one.cost, one.lower_bound] for one in kept], dtype=float).reshape(-1, 3)
    at = {"x": [one.iteration for one in kept], "customdata": plain_numbers(rows[:, 0], 3)}
    return [{**at, "y": plain_numbers(rows[:, column], 6)} for column in (1, 2)]

"""The report of an association: targets, cost and gap of each scan."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from assoc._system.door import door
from assoc._text.html import escape, warning_list
from assoc._text.times import moment
from assoc.association.association import Association
from assoc.association.scan import ScanAssociation
from assoc.association.source import Source, warnings_of
from assoc.errors import InvalidInputError
from assoc.plotting.report.page import Page, cards, controls, definitions, settings_section, sortable_table
from assoc.plotting.report.pheromone import add_pheromone
from assoc.plotting.report.plotly_script import check_report
from assoc.plotting.report.views import closed_gap, scan_view, scene_view, source_view, thin
from assoc.scene.scene import Scene

_SCENE = (
    controls("scan")
    + """<div class="controls"><div class="buttons" id="dimensions" hidden>
<button type="button" id="plan" aria-pressed="true">Plan</button>
<button type="button" id="space" aria-pressed="false">3-D</button></div>
<div class="buttons" id="zooms"><button type="button" id="nearer" disabled>Zoom to target</button>
<button type="button" id="whole">Whole scene</button>
<button type="button" id="legend" aria-pressed="true">Legend</button></div>
<a href="#scans" id="to-row">row of this scan in the table</a></div>
<div class="split"><div id="scene-plot" class="plot large"></div>
<div><div id="detail" class="detail" aria-live="polite"></div>
<h3>Targets of this scan</h3><div class="scroll" id="targets" tabindex="0" role="region" aria-label="targets"></div>
</div></div>"""
)

_PHEROMONE = (
    """<p class="note">How the ants came to agree in this scan: what they lay on a tuple, how they see it, and
the chance that they draw it. What was chosen comes first, then what has the most pheromone in the end.</p>"""
    + controls("cycle", "cycle-")
    + """<div class="controls"><label>show <select id="ants-measure"></select></label></div>
<div id="ants-plot" class="plot large"></div>"""
)

_HISTORY = """<div class="halves"><div><h3>This scan: cost and lower bound</h3>
<div class="controls"><label>over <select id="trace-axis"><option value="0">iterations</option>
<option value="1">time</option></select></label></div><div id="trace-plot" class="plot small"></div></div>
<div><h3>Over all scans</h3><div class="controls"><label>show <select id="measure"></select></label></div>
<div id="scans-plot" class="plot small"></div></div></div>"""


@door
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
    _page(association, each, files, words).write(path)


def _page(association: Association, each: list[Source], files: list[str], words: Sequence[str] | None) -> Page:
    numbers: dict[tuple[int, str], int] = {}
    views: list[dict[str, Any]] = []
    for source, file in zip(each, files, strict=True):
        if (id(source), file) not in numbers:
            numbers[id(source), file] = len(views)
            views.append(source_view(source, file))
    owners = [numbers[id(source), file] for source, file in zip(each, files, strict=True)]
    scans = [scan_view(s, n, scan) for s, n, scan in zip(each, owners, association.scans, strict=True)]
    drawn = [i for i, source in enumerate(each) if isinstance(source, Scene)]
    kept = thin(
        (scene_view(each[i], association.scans[i], views[owners[i]]["decimals"]) for i in drawn),  # type: ignore[arg-type]
        [scans[i] for i in drawn],
    )
    warnings = [line for source in {id(source): source for source in each}.values() for line in warnings_of(source)]
    sections = [("summary", "Summary", warning_list(warnings) + _summary(association))]
    if association.scans:
        note = ""
        if kept < len(drawn):
            note = f'<p class="note">{kept} of {len(drawn)} scans are drawn: all would make this file too large.</p>'
        sections += [
            ("scene", "Scene" if drawn else "Chosen tuples", note + _SCENE),
            ("scans", "Scans", _scans_table(association.scans, files, [views[n]["title"] for n in owners])),
            ("convergence", "Convergence", _HISTORY),
        ]
    if any(scan.pheromone is not None for scan in association.scans):
        add_pheromone(scans, association.scans)
        sections.append(("pheromone", "Pheromone", _PHEROMONE))
    sections += [("sensors", "Sensors", _sensors(each, files)), ("settings", "Settings", _settings(association, words))]
    title = ", ".join(dict.fromkeys(view["title"] for view in views if view["title"])) or "Association"
    lead = f"Association of {len(association.scans)} scans with {association.solver}, seed {association.seed}"
    scripts = ["scene.js", "pheromone.js", "association.js"]
    return Page(title, lead, sections, {"sources": views, "scans": scans}, scripts)


def _summary(association: Association) -> str:
    total = association.totals()
    count = total["scans"]
    bound = total["lower_bound"]
    gaps = [closed_gap(scan) for scan in association.scans]
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


def _scans_table(scans: Sequence[ScanAssociation], files: Sequence[str], titles: Sequence[str]) -> str:
    several = len({*files}) > 1
    timed = any(scan.time is not None for scan in scans)
    known = any(scan.true_tuples is not None for scan in scans)
    ranked = max((len(scan.ranked) for scan in scans), default=0) > 1
    headers = ["scan", *(["file"] if several else []), *(["time"] if timed else []), "measurements", "targets"]
    headers += ["false alarms", "cost", "lower bound", "gap", "status", "ms", *(["correct"] if known else [])]
    headers += ["to the second best"] if ranked else []
    rows = []
    for scan, file in zip(scans, files, strict=True):
        solution, gap = scan.solution, closed_gap(scan)
        row: list[tuple[str, Any]] = [(str(scan.scan), scan.scan)]
        row += [(file, file)] if several else []
        row += [("" if scan.time is None else moment(scan.time), scan.time)] if timed else []
        row += [
            (" + ".join(map(str, scan.sizes)), sum(scan.sizes)),
            (str(len(scan.targets)), len(scan.targets)),
            (str(scan.false_alarms), scan.false_alarms),
            (f"{solution.cost:.4f}", solution.cost),
            (f"{solution.lower_bound:.4f}", solution.lower_bound),
            ("unknown" if gap is None else f"{gap:.2g}", gap),
            (solution.status, solution.status),
            (f"{1e3 * solution.runtime:.2f}", 1e3 * solution.runtime),
        ]
        if known:
            true = scan.true_tuples
            share = None if not true else (scan.correct_tuples or 0) / true
            row.append(("" if true is None else f"{scan.correct_tuples}/{true}", share))
        if ranked:
            other = scan.ranked[1].solution.cost - scan.ranked[0].solution.cost if len(scan.ranked) > 1 else None
            row.append(("" if other is None else f"{other:.4f}", other))
        rows.append(row)
    return sortable_table("scan-table", headers, rows, link="scan")


def _sensors(sources: Sequence[Source], files: Sequence[str]) -> str:
    parts = []
    for source, file in {id(s): (s, f) for s, f in zip(sources, files, strict=True)}.values():
        # scenes and problems show themselves in notebooks in the same way
        title = f"<h3>{escape(file)}</h3>" if file else ""
        parts.append(f'{title}<div class="scroll">{source._repr_html_()}</div>')
    return "".join(parts)


def _settings(association: Association, words: Sequence[str] | None) -> str:
    used = {"solver": association.solver, "seed": association.seed, **association.parameters}
    return settings_section(f"<h3>Parameters</h3>{definitions(used)}", "assoc.solve", words)

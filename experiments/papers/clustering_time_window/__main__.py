"""Multiple hypothesis tracking with a clustering time window (Cahyono 2014): tables 4.25 to 4.27, pairs, false starts.

    python -m experiments.papers.clustering_time_window [--quick] [--seed N] [--json FILE] [--figure FILE]

The paper's recording is not public. Scenario S1 (`rotating-radar`) follows what the paper tells about it: 14
aircraft, 1,130 s, a rotation of 9.5 s, P_d 0.78, ranges in whole nautical miles. Its CT, MT and IT are described in
words; docs/metrics.md says what they mean here. Its grouping without window is irregular: here of gamma-distributed
lengths with the paper's mean of 6.2 s. "Time stamps" are each plot's own; without them a fixed time passes from group
to group and tracks are deleted after three groups without a plot, as in the paper. The strong baseline has time stamps
and deletes by time, but has no window. The thesis's tracker is Reid's with Murty's m best (m is not given; 50 chosen by
us); the track-oriented MHT (depth 4, branch_drop 25) stands beside it. Full size: 12 recordings (6 for Reid's MHT), 100
pairs of each kind (600 s, 5 nmi apart when parallel), 100 false starts; the IDs are judged by the majority of 6 plots.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from experiments.common.claims import Claim
from experiments.common.command import main
from experiments.papers.clustering_time_window import false_start, pairs, traffic
from experiments.papers.clustering_time_window.published import RATES, WITH_WINDOW, WITHOUT_WINDOW


def experiment(quick: bool, rng: np.random.Generator) -> tuple[list[Claim], Any]:
    """Judge windows, stamps and hypotheses on S1, then pairs and false starts; --quick has fewer and shorter runs."""
    results = traffic.judge(2 if quick else 12, 2 if quick else 6, rng, 300.0 if quick else traffic.DURATION)
    about_pairs, examples = pairs.judge(3 if quick else 100, rng)
    about_starts = false_start.judge(6 if quick else 100, rng)
    return [*traffic.claims(results), *about_pairs, *about_starts], (results, examples)


def draw(figure: Any, shown: Any) -> None:
    """Draw the rates over time beside the paper's, and one example of each pair."""
    results, examples = shown
    upper, lower, space = figure.subfigures(3, 1, height_ratios=(1.0, 1.25, 1.25))
    _draw_rates(upper, results)
    panels = lower.subplots(1, len(examples), squeeze=False)[0]
    for panel, (name, example) in zip(panels, examples.items(), strict=True):
        _draw_pair(panel, example)
        panel.set_title(f"{name}: colours are tracks")
    panels[0].set_ylabel("north (km)")
    deep = space.subplots(1, len(examples), squeeze=False, subplot_kw={"projection": "3d"})[0]
    for panel, (name, example) in zip(deep, examples.items(), strict=True):
        _draw_pair_in_space(panel, example)
        panel.set_title(f"{name} in space, as figure {pairs.IN_SPACE[name]}")


def _draw_rates(figure: Any, results: Any) -> None:
    panels = figure.subplots(1, 3, sharex=True)
    lines = (
        ("paper, without window", WITHOUT_WINDOW, "C1", "--"),
        (
            "Reid + Murty, without window",
            traffic.tens(results["Reid's MHT, irregular groups"], 18).mean(axis=0),
            "C1",
            "-",
        ),
        ("paper, CTW", WITH_WINDOW, "C0", "--"),
        ("Reid + Murty, CTW", traffic.tens(results["Reid's MHT, CTW"], 12).mean(axis=0), "C0", "-"),
        ("track-oriented, CTW and time stamps", traffic.tens(results[traffic.BEST], 12).mean(axis=0), "C2", "-"),
    )
    for axis, (panel, rate) in enumerate(zip(panels, RATES, strict=True)):
        for label, values, colour, style in lines:
            share = (np.arange(len(values)) + 0.5) / len(values)
            panel.plot(100 * share, values[:, axis], style, color=colour, label=label, linewidth=1.4)
        panel.set(xlabel="share of the recording (%)", title=f"{rate} (%), MHT", ylim=(0, 102))
    figure.legend(*panels[0].get_legend_handles_labels(), fontsize=9, ncols=5, loc="outside lower center")


def _draw_pair(panel: Any, example: pairs.Example) -> None:
    recording, taken = example.recording, example.taken
    places = recording.positions[taken.rows] / 1000.0
    real = recording.sources[taken.rows] >= 0
    panel.plot(*places[~real].T, ".", color="0.8", markersize=3, label="false plots", zorder=1)
    names, counts = np.unique(taken.tracks[taken.tracks >= 0], return_counts=True)
    long = [name for name, count in zip(names, counts, strict=True) if count >= 5]
    for number, name in enumerate(long):
        own = taken.tracks == name
        panel.plot(*places[own].T, ".-", color=f"C{number}", linewidth=0.7, markersize=4, zorder=2)
    near = places[real]
    middle, half = (near.min(axis=0) + near.max(axis=0)) / 2, 0.55 * np.ptp(near, axis=0).max()
    panel.set(xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half), xlabel="east (km)")
    panel.set_aspect("equal")


def _draw_pair_in_space(panel: Any, example: pairs.Example) -> None:
    recording, taken = example.recording, example.taken
    heights = recording.trusted_altitudes[taken.rows]
    places = recording.positions[taken.rows] / 1000.0
    names, counts = np.unique(taken.tracks[taken.tracks >= 0], return_counts=True)
    long = [name for name, count in zip(names, counts, strict=True) if count >= 5]
    for number, name in enumerate(long):
        own = (taken.tracks == name) & np.isfinite(heights)
        panel.plot(*places[own].T, heights[own], ".-", color=f"C{number}", linewidth=0.7, markersize=4)
    panel.set(xlabel="east (km)", ylabel="north (km)", zlabel="altitude (m)")


program = partial(main, "papers.clustering_time_window", experiment, __doc__, figure=(draw, (13, 13)))


if __name__ == "__main__":
    raise SystemExit(program())

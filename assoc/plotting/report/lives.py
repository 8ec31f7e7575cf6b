"""The life of each track in a report: when it began and ended, its hits, speed, and the target that it followed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from assoc._text.times import moment
from assoc.metrics import Gospa
from assoc.plotting.report.page import note, table

if TYPE_CHECKING:
    import pandas as pd


def by_track(frame: pd.DataFrame) -> list[tuple[int, pd.DataFrame]]:
    """Rows of each track."""
    return [(int(str(name)), rows) for name, rows in frame.groupby("track_id")]


def _lives(frame: pd.DataFrame, values: Sequence[Gospa]) -> list[dict[str, Any]]:
    """Summary of each track, with the target that it followed most if the truth is known."""
    pairs: dict[int, Counter[int]] = {}
    for gospa in values:
        for target, track in gospa.pairs.tolist():
            pairs.setdefault(int(track), Counter())[int(target)] += 1
    lives = []
    for number_of, track in by_track(frame):
        where, times = track[["x", "y", "z"]].to_numpy(dtype=float), track["time"].to_numpy(dtype=float)
        length = float(np.linalg.norm(np.diff(where, axis=0), axis=1).sum())
        began, ended = float(times[0]), float(times[-1])
        life: dict[str, Any] = {"track": number_of, "first": began, "last": ended, "rows": len(track)}
        life["started"] = float(track["started"].iloc[0]) if "started" in track else began
        life["detected"] = float(track["last_detection"].iloc[-1]) if "last_detection" in track else None
        life["hits"] = int(track["hits"].iloc[-1]) if "hits" in track else None
        score = float(track["score"].iloc[-1]) if "score" in track else np.nan
        life["score"] = score if np.isfinite(score) else None
        life["speed"] = length / (ended - began) if ended > began else None
        life["heading"] = float(track["heading"].iloc[-1]) if "heading" in track else None
        known = track["altitude"].dropna().to_numpy(dtype=float) if "altitude" in track else np.zeros(0)
        life["altitude"] = float(known[-1]) if len(known) else None
        if "nis" in track:
            value = float(track["nis"].iloc[-1])
            life["nis"] = value if np.isfinite(value) else None
            life["consistent"] = "yes" if track["consistent"].all() else "no"
            life["by_sensor"] = " + ".join(str(int(track[name].iloc[-1])) for name in track.filter(like="hits_"))
        life["name"] = (str(track["target"].iloc[0]) or None) if "target" in track else None
        target, share = None, None
        if number_of in pairs:
            target, times_paired = pairs[number_of].most_common(1)[0]
            share = times_paired / len(np.unique(times))
        lives.append({**life, "target": target, "share": share})
    return lives


def life_table(frame: pd.DataFrame, values: Sequence[Gospa], known: bool) -> str:
    """Table of the lives of tracks; the values of a metric tell which targets they followed, if those are `known`."""
    lives = _lives(frame, values)
    if not lives:
        return note("No track was made.")
    columns = [("track", "track", "d"), ("name", "name", "s"), ("started", "started", "t"), ("first", "first row", "t")]
    columns += [("detected", "last detection", "t"), ("last", "last row", "t"), ("rows", "rows", "d")]
    columns += [("hits", "hits", "d"), ("score", "score, nats", ".4g"), ("speed", "mean speed, m/s", ".4g")]
    columns += [("heading", "last heading, deg", ".0f"), ("altitude", "last altitude, m", ".0f")]
    columns += [("by_sensor", "hits by sensor", ""), ("nis", "NIS", ".2f"), ("consistent", "consistent", "")]
    columns += [("target", "target followed", "d"), ("share", "share of its rows", ".0%")] if known else []
    used = [
        column for column in columns if any(life.get(column[0]) is not None for life in lives) or column[0] == "track"
    ]
    rows = [["" if life.get(key) is None else _shown(life[key], style) for key, _, style in used] for life in lives]
    return table([header for _, header, _ in used], rows, rest="; tracks.csv has all")


def _shown(value: Any, style: str) -> str:
    return moment(value) if style == "t" else format(value, style)

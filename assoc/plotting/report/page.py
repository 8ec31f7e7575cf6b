"""A self-contained HTML page: style, tables, and figures with plotly's own controls, in one file."""

from __future__ import annotations

import base64
import hashlib
import os
import platform
import re
import shlex
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from typing import Any

from assoc._files.output import write_text
from assoc._system.imports import check_extra, load_extra
from assoc._text import html
from assoc._text.html import escape
from assoc._version import __version__

_VERSIONS = ("numpy", "scipy", "numba", "ortools", "plotly")
# the data stay here: no button shares or uploads them
_BUTTONS = [["toImage"], ["zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]]
_CONFIG = {"responsive": True, "displaylogo": False, "plotlyServerURL": "", "modeBarButtons": _BUTTONS}
# plotly gives figures the width of the window, and does not hear of paper
_PAPER = """for (const [when, width] of [['beforeprint', 690], ['afterprint', null]]) {
  window.addEventListener(when, () => document.querySelectorAll('.js-plotly-plot').forEach(
    (plot) => Plotly.relayout(plot, { width, height: width && Math.min(plot.clientHeight, 540), autosize: !width })));
}
document.documentElement.dataset.ready = 'yes';"""


@dataclass(frozen=True)
class Part:
    """A part of a page: its title, its HTML in which text is escaped, and the figures below it."""

    title: str
    text: str = ""
    figures: Sequence[Mapping[str, Any]] = ()
    """Of plotly: data, layout and frames."""


def write_page(path: str | os.PathLike[str], title: str, lead: str, parts: Sequence[Part]) -> None:
    """Write a page with a heading and one sentence under it, plain texts; it appears whole or not at all."""
    body: list[str] = []
    links, scripts = [], [plotly_script()] if any(part.figures for part in parts) else []
    for part in parts:
        name = re.sub(r"\W+", "-", part.title.lower())
        links.append(f'<a href="#{name}">{escape(part.title)}</a>')
        body.append(f'<section id="{name}"><h2>{escape(part.title)}</h2>\n{part.text}')
        for number, figure in enumerate(part.figures):
            made = load_extra("plotly.io", "report").to_html(
                figure, _CONFIG, auto_play=False, include_plotlyjs=False, full_html=False, validate=False,
                div_id=f"{name}-{number}",
            )  # fmt: skip
            # scripts come last, so that the tables are there first
            element, script = re.split(r"<script[^>]*>", made, maxsplit=1)
            scripts.append(script.rpartition("</script>")[0])
            height = figure["layout"].get("meta", "low")
            body.append(f'<div class="plot {height}">{element}</div></div>')
        body.append("</section>")
    code = "\n;".join([*scripts, _PAPER])
    style = files("assoc.plotting.report").joinpath("static", "page.css").read_text(encoding="utf-8")
    page = [
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f'<meta http-equiv="Content-Security-Policy" content="{_policy(code)}">',
        f"<title>{escape(title)}</title>\n<style>\n{style}</style></head>",
        f"<body><header><h1>{escape(title)}</h1><p>{escape(lead)}</p><nav>{''.join(links)}</nav></header>",
        "<noscript><p>The tables can be read; the figures need JavaScript.</p></noscript>\n<main>",
        *body,
        f"</main>\n<script>{code}</script>\n</body></html>\n",
    ]
    write_text(path, "\n".join(page))


def _policy(script: str) -> str:
    """Content security policy: nothing is loaded, and only our script runs, even if text were parsed as a tag."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    nothing = "default-src 'none'; connect-src 'none'; form-action 'none'; base-uri 'none'"
    return f"{nothing}; img-src data: blob:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"


def settings_part(settings: str, program: str, words: Sequence[str] | None) -> Part:
    """Settings, HTML, with what is needed to make the report again."""
    command = "" if words is None else f"<pre>{escape(shlex.join(['python', '-m', program, *words]))}</pre>"
    made = {"assoc": __version__, "Python": platform.python_version()}
    for name in _VERSIONS:
        try:
            made[name] = version(name)
        except PackageNotFoundError:
            continue
    made["machine"] = f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores"
    made["made"] = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())
    return Part("Settings", f"{command}{settings}<h3>Made with</h3>{definitions(made)}")


def definitions(content: Mapping[str, Any]) -> str:
    """Return a list of names and values."""
    items = "".join(
        f"<div><dt>{escape(name)}</dt><dd>{escape('none' if value is None else value)}</dd></div>"
        for name, value in content.items()
    )
    return f'<dl class="facts">{items}</dl>'


def cards(content: Mapping[str, tuple[str, str]]) -> str:
    """Return the figures of a summary: name -> (value, what it means)."""
    items = "".join(
        f"<div><dt>{escape(name)}</dt><dd>{escape(value)}</dd><p>{escape(note)}</p></div>"
        for name, (value, note) in content.items()
    )
    return f'<dl class="cards">{items}</dl>'


def note(text: str) -> str:
    """Return a sentence, plain text, as a paragraph."""
    return f'<p class="note">{escape(text)}</p>'


def table(headers: Sequence[str], rows: Sequence[Sequence[str]], *, most: int = 500, rest: str = "") -> str:
    """Return a table of the first `most` rows in a box that scrolls; `rest` says where the others are."""
    left = note(f"The first {most:,} of {len(rows):,} rows{rest}.") if len(rows) > most else ""
    shown = rows[:most]
    numbers = [i for i in range(len(headers)) if any(re.match(r"[-\u2212]?\d", row[i]) for row in shown)]
    return f'{left}<div class="scroll" tabindex="0">{html.table(headers, shown, numbers=numbers)}</div>'


# licences are not changed; XML namespaces only look like addresses
_ADDRESS = re.compile(r"(/\*!.{0,3000}?\*/)|\b(?:https?|wss?)://(?!www\.w3\.org/)(?=[\w{])[^\s\"'`<>\\)/]*", re.DOTALL)


def check_report() -> None:
    """Raise MissingExtraError before any work for a report is done."""
    check_extra("plotly", "report")


@cache
def plotly_script() -> str:
    """Return plotly.js from the plotly package, without addresses of servers.

    plotly can send charts to a cloud service, and load maps. The data of a report must stay in the file, so addresses
    are removed from the code; core.js restricts the buttons of a chart, and blocks new windows.
    """
    check_report()
    text: str = load_extra("plotly.offline", "report").get_plotlyjs()
    text = _ADDRESS.sub(lambda found: found.group(1) or "", text)
    # in a script element these change the parser's state, so that the closing tag would be ignored
    return text.replace("</script", "<\\/script").replace("<!--", "<\\!--")

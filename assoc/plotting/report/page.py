"""A self-contained HTML page: style, data, plotly and our scripts in one file."""

from __future__ import annotations

import base64
import gzip
import hashlib
import os
import platform
import shlex
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from typing import Any

from assoc._files.output import write_text
from assoc._text.html import escape, script_json
from assoc._version import __version__
from assoc.plotting.report.plotly_script import plotly_script

_VERSIONS = ("numpy", "scipy", "numba", "ortools", "plotly")


def controls(label: str, prefix: str = "") -> str:
    """Return a slider with its buttons, for ``makeSlider`` in core.js, which finds it by the prefix of its ids."""
    return f"""<div class="controls">
<div class="buttons"><button type="button" id="{prefix}before" aria-label="before">&#9664;</button>
<button type="button" id="{prefix}play" aria-pressed="false">Play</button>
<button type="button" id="{prefix}after" aria-label="next">&#9654;</button></div>
<input type="range" id="{prefix}slider" min="0" max="0" value="0" step="1" aria-label="{label}">
<output id="{prefix}slider-label" for="{prefix}slider"></output>
</div>"""


@dataclass(frozen=True)
class Page:
    """Content of a report: heading, and one sentence under it (`lead`), both plain text."""

    title: str
    lead: str
    sections: Sequence[tuple[str, str, str]]
    """Id, title and HTML of each, in order; text in the HTML must be escaped."""
    data: Mapping[str, Any]
    """Data for the scripts, written as JSON."""
    scripts: Sequence[str] = field(default_factory=tuple)
    """Names of files in ``static`` beside ``core.js``, which is always there."""

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the page; it appears whole or not at all."""
        write_text(path, self.html())

    def html(self) -> str:
        """Return the whole page."""
        code = "\n".join(["'use strict';", *(_static(name) for name in ("core.js", *self.scripts))])
        script = f"{plotly_script()}\n;(() => {{\n{code}\n}})();"
        unpack = _static("unpack.js")
        body = [
            f'<section id="{escape(name)}"><h2>{escape(title)}</h2>\n{content}\n</section>'
            for name, title, content in self.sections
        ]
        links = "".join(f'<a href="#{escape(name)}">{escape(title)}</a>' for name, title, _ in self.sections)
        return "\n".join(
            [
                "<!doctype html>",
                '<html lang="en"><head><meta charset="utf-8">',
                '<meta name="viewport" content="width=device-width, initial-scale=1">',
                f'<meta http-equiv="Content-Security-Policy" content="{_policy([unpack, script])}">',
                f"<title>{escape(self.title)}</title>",
                f"<style>\n{_static('page.css')}</style></head>",
                f"<body><header><h1>{escape(self.title)}</h1><p>{escape(self.lead)}</p><nav>{links}</nav></header>",
                "<noscript><p>The tables can be read; the pictures need JavaScript.</p></noscript>",
                '<p id="failure" role="alert" hidden></p>',
                "<main>",
                *body,
                "</main>",
                f'<script type="application/json" id="data">{script_json(self.data)}</script>',
                # plotly is large: packed it loads in a third of the time, and the tables appear before it
                f'<script type="application/gzip" id="packed">{_packed(script)}</script>',
                f"<script>{unpack}</script>",
                "</body></html>\n",
            ]
        )


def _static(name: str) -> str:
    return files("assoc.plotting.report").joinpath("static", name).read_text(encoding="utf-8")


def _packed(text: str) -> str:
    """Return text as gzip in base64, reproducibly."""
    return base64.b64encode(gzip.compress(text.encode(), compresslevel=9, mtime=0)).decode()


def _policy(scripts: Sequence[str]) -> str:
    """Content security policy: nothing is loaded, and only our scripts run, even if text were parsed as a tag."""
    hashes = (base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts)
    allowed = " ".join(f"'sha256-{digest}'" for digest in hashes)
    nothing = "default-src 'none'; connect-src 'none'; form-action 'none'; base-uri 'none'"
    return f"{nothing}; img-src data: blob:; style-src 'unsafe-inline'; script-src {allowed}"


def settings_section(settings: str, program: str, words: Sequence[str] | None) -> str:
    """Return the HTML of settings with what is needed to make the report again before and below them."""
    made = made_with(program, words)
    command = f"<pre>{escape(made.pop('command'))}</pre>" if "command" in made else ""
    return f"{command}{settings}<h3>Made with</h3>{definitions(made)}"


def made_with(program: str, words: Sequence[str] | None) -> dict[str, str]:
    """Return what is needed to make the report again: command, versions, machine, date."""
    content = {}
    if words is not None:
        content["command"] = shlex.join(["python", "-m", program, *words])
    content["assoc"] = __version__
    content["Python"] = platform.python_version()
    for name in _VERSIONS:
        try:
            content[name] = version(name)
        except PackageNotFoundError:
            continue
    content["machine"] = f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores"
    content["made"] = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())
    return content


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


def sortable_table(
    name: str, headers: Sequence[str], rows: Sequence[Sequence[tuple[str, Any]]], *, link: str | None = None
) -> str:
    """Return a table, with the id `name`, that the page's script can sort.

    Cells are (text, sort key); those with numeric keys are right-aligned. With `link`, row i selects ``link``-i on the
    page, and its first cell is a link.
    """
    head = "".join(f'<th scope="col"><button type="button">{escape(header)}</button></th>' for header in headers)
    lines = []
    for number, row in enumerate(rows):
        cells = []
        for column, (text, key) in enumerate(row):
            numeric = isinstance(key, (int, float)) and not isinstance(key, bool)
            inner = escape(text)
            if link is not None and column == 0:
                inner = f'<a href="#{link}-{number}">{inner}</a>'
            cells.append(f'<td data-key="{escape(key)}"{" class=number" if numeric else ""}>{inner}</td>')
        lines.append(f'<tr data-row="{number}">{"".join(cells)}</tr>')
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(name)}"><table id="{escape(name)}" '
        f'class="sortable"><thead><tr>{head}</tr></thead><tbody>{"".join(lines)}</tbody></table></div>'
    )

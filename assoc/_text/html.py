"""HTML from untrusted text, such as file names and command lines."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence


def escape(text: object) -> str:
    """Return text escaped for elements and quoted attributes."""
    return html.escape(str(text), quote=True)


def table(headers: Sequence[object], rows: Iterable[Sequence[object]], *, numbers: Sequence[int] = ()) -> str:
    """Return a plain table; the columns ``numbers`` are aligned right."""
    right = {*numbers}

    def line(cells: Sequence[object], tag: str) -> str:
        style = [' style="text-align:right"' if column in right else "" for column in range(len(cells))]
        inner = (f"<{tag}{s}>{escape(cell)}</{tag}>" for s, cell in zip(style, cells, strict=True))
        return f"<tr>{''.join(inner)}</tr>"

    body = "".join(line(row, "td") for row in rows)
    return f"<table><thead>{line(headers, 'th')}</thead><tbody>{body}</tbody></table>"


def facts(content: Mapping[str, object]) -> str:
    """Return a table of two columns, names and values."""
    rows = (
        f'<tr><th scope="row" style="text-align:left">{escape(name)}</th>'
        f'<td style="text-align:left">{escape(value)}</td></tr>'
        for name, value in content.items()
    )
    return f"<table><tbody>{''.join(rows)}</tbody></table>"


def warning_list(lines: Iterable[str]) -> str:
    """Return the distinct warnings as a list with their number as heading; empty without warnings."""
    different = list(dict.fromkeys(lines))
    if not different:
        return ""
    items = "".join(f"<li>{escape(line)}</li>" for line in different)
    plural = "s" if len(different) > 1 else ""
    return f'<div class="warned"><b>{len(different)} warning{plural}</b><ul>{items}</ul></div>'

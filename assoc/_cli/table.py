"""Text tables, fitted to at most 80 columns on a terminal and 120 in a pipe without cutting any cell."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Sequence

from assoc._text.plain import printable

_BETWEEN = "  "
_TERMINAL, _PIPE = 80, 120
# headers longer than this are broken between words if a table is too wide
_SHORT = 5


class _Layout:
    """Columns as wide as their cells; callers select columns by index."""

    def __init__(
        self,
        headers: Sequence[str],
        rows: Sequence[Sequence[str]],
        left: Sequence[str],
        *,
        broken: bool = False,
    ) -> None:
        self.headers = [header.split(" ") if broken and len(header) > _SHORT else [header] for header in headers]
        self.rows = [[printable(cell) for cell in row] for row in rows]
        self.left = [header in left for header in headers]
        self.widths = [
            max(*map(len, header), *(len(row[i]) for row in self.rows)) for i, header in enumerate(self.headers)
        ]
        self.every = [*range(len(headers))]

    def width(self, columns: Sequence[int]) -> int:
        return sum(self.widths[i] for i in columns) + len(_BETWEEN) * (len(columns) - 1)

    def line(self, cells: Sequence[str], columns: Sequence[int]) -> str:
        texts = [cells[i].ljust(self.widths[i]) if self.left[i] else cells[i].rjust(self.widths[i]) for i in columns]
        return _BETWEEN.join(texts).rstrip()

    def lines(self, columns: Sequence[int], *, ruled: bool = True) -> Iterator[str]:
        high = max(len(self.headers[i]) for i in columns)
        for cells in zip(*([""] * (high - len(header)) + header for header in self.headers), strict=False):
            yield self.line(cells, columns)
        if ruled:
            # rich's substitute for stdout, while a progress bar is shown, has no encoding
            stream = getattr(sys.stdout, "rich_proxied_file", sys.stdout)
            yield ("─" if (stream.encoding or "").lower().startswith("utf") else "-") * self.width(columns)
        for row in self.rows:
            yield self.line(row, columns)


def print_table(
    headers: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    keys: int = 1,
    left: Sequence[str] = (),
    joined: Sequence[str] = (),
) -> None:
    """Print a table to stdout.

    It is at most 80 columns wide on a terminal, 120 in a pipe. Headers of a table that is too wide are broken into
    several lines. If that is not enough the table is split into several, one below the other, each beginning with the
    first `keys` columns; or each row is printed as a list. Columns named in `left` are left-aligned, those in `joined`
    stay beside the column before them.
    """
    plain, terminal = _Layout(headers, rows, left), sys.stdout.isatty()
    most = min(shutil.get_terminal_size().columns, _TERMINAL) if terminal else _PIPE
    if terminal or plain.width(plain.every) > most:
        lines = fitted_lines(headers, rows, most, keys=keys, left=left, joined=joined)
    else:
        lines = plain.lines(plain.every, ruled=False)
    for line in lines:
        print(line)


def fitted_lines(
    headers: Sequence[str],
    rows: Sequence[Sequence[str]],
    width: int,
    *,
    keys: int = 1,
    left: Sequence[str] = (),
    joined: Sequence[str] = (),
) -> Iterator[str]:
    """Yield the lines of a table at most ``width`` wide, if its cells allow that; see `print_table`."""
    table = _Layout(headers, rows, left)
    if table.width(table.every) <= width:
        yield from table.lines(table.every)
        return
    table = _Layout(headers, rows, left, broken=True)
    first = table.every[:keys]
    blocks: list[list[int]] = []
    for i in table.every[keys:]:
        if headers[i] in joined:
            continue
        # a column and those that stay beside it
        end = next((k for k in table.every[i + 1 :] if headers[k] not in joined), len(headers))
        unit = [*range(i, end)]
        if not blocks or table.width([*blocks[-1], *unit]) > width:
            blocks.append([*first])
        blocks[-1] += unit
    if any(table.width(block) > width for block in blocks):
        yield from _listed(headers, table.rows)
        return
    for number, block in enumerate(blocks):
        yield from ([""] if number else [])
        yield from table.lines(block)


def _listed(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Each row as a list of headers and cells."""
    wide = max(map(len, headers))
    for number, row in enumerate(rows):
        yield from ([""] if number else [])
        for header, cell in zip(headers, row, strict=True):
            yield f"{header.ljust(wide)}{_BETWEEN}{cell}"

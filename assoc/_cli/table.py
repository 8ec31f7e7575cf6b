"""Text tables: plain columns into a pipe; on a terminal fitted to its width without cutting any cell."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence

from assoc._text.plain import printable

_BETWEEN = "  "
# headers longer than this are broken between words if a table is too wide
_SHORT = 5


class _Layout:
    """Columns as wide as their cells, and at least as wide as requested; callers select columns by index."""

    def __init__(
        self,
        headers: Sequence[str],
        rows: Sequence[Sequence[str]],
        left: Sequence[str],
        *,
        broken: bool = False,
        least: Mapping[str, int] | None = None,
    ) -> None:
        self.headers = [header.split(" ") if broken and len(header) > _SHORT else [header] for header in headers]
        self.rows = [[printable(cell) for cell in row] for row in rows]
        self.left = [header in left for header in headers]
        self.widths = [
            max(*map(len, header), *(len(row[i]) for row in self.rows), (least or {}).get(headers[i], 0))
            for i, header in enumerate(self.headers)
        ]
        self.every = [*range(len(headers))]

    def width(self, columns: Sequence[int]) -> int:
        return sum(self.widths[i] for i in columns) + len(_BETWEEN) * (len(columns) - 1)

    def line(self, cells: Sequence[str], columns: Sequence[int]) -> str:
        texts = [cells[i].ljust(self.widths[i]) if self.left[i] else cells[i].rjust(self.widths[i]) for i in columns]
        return _BETWEEN.join(texts).rstrip()

    def heading(self, columns: Sequence[int], *, ruled: bool = True) -> Iterator[str]:
        high = max(len(self.headers[i]) for i in columns)
        for cells in zip(*([""] * (high - len(header)) + header for header in self.headers), strict=False):
            yield self.line(cells, columns)
        if ruled:
            # rich's substitute for stdout, while a progress bar is shown, has no encoding
            stream = getattr(sys.stdout, "rich_proxied_file", sys.stdout)
            yield ("─" if (stream.encoding or "").lower().startswith("utf") else "-") * self.width(columns)

    def lines(self, columns: Sequence[int], *, ruled: bool = True) -> Iterator[str]:
        yield from self.heading(columns, ruled=ruled)
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

    Headers of a table that is too wide for the terminal are broken into several lines. If that is not enough the table
    is split into several, one below the other, each beginning with the first `keys` columns; or each row is printed as
    a list. Columns named in `left` are left-aligned, those in `joined` stay beside the column before them.
    """
    if sys.stdout.isatty():
        lines = fitted_lines(headers, rows, shutil.get_terminal_size().columns, keys=keys, left=left, joined=joined)
    else:
        plain = _Layout(headers, rows, left)
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


class GrowingTable:
    """A table on a terminal whose rows are printed as they come, `most` times; the first row sets the widths.

    `widths` are what later cells may need, by header; columns named in `left` are left-aligned.
    """

    def __init__(self, headers: Sequence[str], widths: Mapping[str, int], left: Sequence[str], most: int) -> None:
        self._headers, self._widths, self._left, self._most = headers, widths, left, most
        self._layout: _Layout | None = None
        self.fits = True
        """Whether the terminal is wide enough; otherwise nothing is printed. Known after the first row."""

    def add(self, rows: Sequence[Sequence[str]]) -> None:
        """Print rows; a cell that is too wide shifts the rest of its row."""
        layout = self._layout or self._begin(rows)
        if self.fits and self._most > 0:
            self._most -= 1
            for row in rows:
                print(layout.line([*map(printable, row)], layout.every), flush=True)

    def _begin(self, rows: Sequence[Sequence[str]]) -> _Layout:
        for broken in (False, True):
            layout = self._layout = _Layout(self._headers, rows, self._left, broken=broken, least=self._widths)
            self.fits = layout.width(layout.every) <= shutil.get_terminal_size().columns
            if self.fits:
                print(*layout.heading(layout.every), sep="\n")
                break
        return layout

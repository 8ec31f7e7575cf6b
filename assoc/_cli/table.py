"""Tables of text: plain columns into a pipe; on a terminal as wide as that is, and no cell is ever cut."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence

BETWEEN = "  "


def print_table(
    headers: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    keys: int = 1,
    left: Sequence[str] = (),
    joined: Sequence[str] = (),
) -> None:
    """Print a table to stdout.

    A table that is too wide for a terminal gets headers of several lines. If that is not enough its columns are
    put below one another in several tables, or each row is printed as a list.

    Parameters
    ----------
    headers : sequence of str
    rows : sequence of sequences of str
    keys : int, default 1
        Number of first columns that say which row it is; every one of several tables begins with them.
    left : sequence of str
        Headers of the columns that are aligned to the left.
    joined : sequence of str
        Headers of the columns that stay with the column before them.
    """
    if sys.stdout.isatty():
        lines = fitted_lines(headers, rows, shutil.get_terminal_size().columns, keys=keys, left=left, joined=joined)
    else:
        lines = _plain(headers, rows, left)
    for line in lines:
        print(line)


def _plain(headers: Sequence[str], rows: Sequence[Sequence[str]], left: Sequence[str]) -> Iterator[str]:
    words = [[header] for header in headers]
    widths = _widths(words, rows)
    yield from _headings(words, widths, headers, left)
    for row in rows:
        yield aligned(row, widths, headers, left)


def fitted_lines(
    headers: Sequence[str],
    rows: Sequence[Sequence[str]],
    width: int,
    *,
    keys: int = 1,
    left: Sequence[str] = (),
    joined: Sequence[str] = (),
) -> Iterator[str]:
    """Yield the lines of a table that is at most ``width`` wide, if its cells are; see `print_table`."""
    every = range(len(headers))
    words = [header.split(" ") for header in headers]
    # short headers stay on one line
    words = [[header] if len(header) < 6 else split for header, split in zip(headers, words, strict=True)]
    high = [_width(every[i : i + 1], words, rows) for i in every]
    if _width(every, [[header] for header in headers], rows) <= width:
        yield from _drawn(every, [[header] for header in headers], headers, rows, left)
        return
    units: list[list[int]] = []
    for i in every[keys:]:
        if headers[i] in joined and units:
            units[-1].append(i)
        else:
            units.append([i])
    fixed = sum(high[:keys]) + len(BETWEEN) * keys
    needed = [sum(high[i] for i in unit) + len(BETWEEN) * (len(unit) - 1) for unit in units]
    if units and fixed + max(needed) > width:
        yield from _listed(headers, rows)
        return
    blocks: list[list[int]] = []
    used = width
    for unit, wide in zip(units, needed, strict=True):
        if not blocks or used + len(BETWEEN) + wide > width:
            blocks.append([*every[:keys]])
            used = fixed - len(BETWEEN)
        blocks[-1] += unit
        used += len(BETWEEN) + wide
    for number, block in enumerate(blocks or [[*every]]):
        if number:
            yield ""
        yield from _drawn(block, words, headers, rows, left)


def _width(columns: Iterable[int], words: Sequence[Sequence[str]], rows: Sequence[Sequence[str]]) -> int:
    widths = [max(map(len, [*words[i], *(row[i] for row in rows)])) for i in columns]
    return sum(widths) + len(BETWEEN) * (len(widths) - 1)


def _drawn(
    columns: Sequence[int],
    words: Sequence[Sequence[str]],
    headers: Sequence[str],
    rows: Sequence[Sequence[str]],
    left: Sequence[str],
) -> Iterator[str]:
    """Some columns of a table, with a line below their headers."""
    chosen = [words[i] for i in columns]
    cells = [[row[i] for i in columns] for row in rows]
    names = [headers[i] for i in columns]
    widths = _widths(chosen, cells)
    yield from heading(chosen, widths, names, left)
    for row in cells:
        yield aligned(row, widths, names, left)


def _widths(words: Sequence[Sequence[str]], rows: Sequence[Sequence[str]]) -> list[int]:
    return [max(map(len, [*split, *(row[i] for row in rows)])) for i, split in enumerate(words)]


def heading(
    words: Sequence[Sequence[str]], widths: Sequence[int], headers: Sequence[str], left: Sequence[str]
) -> Iterator[str]:
    """Lines of headers, each of one or several words below one another, and a line below them."""
    yield from _headings(words, widths, headers, left)
    # rich's stand-in for stdout, while a progress bar is shown, knows no encoding
    stream = getattr(sys.stdout, "rich_proxied_file", sys.stdout)
    utf = (stream.encoding or "").lower().startswith("utf")
    yield ("─" if utf else "-") * (sum(widths) + len(BETWEEN) * (len(widths) - 1))


def _headings(
    words: Sequence[Sequence[str]], widths: Sequence[int], headers: Sequence[str], left: Sequence[str]
) -> Iterator[str]:
    high = max(map(len, words))
    over = [[*[""] * (high - len(split)), *split] for split in words]
    for line in zip(*over, strict=True):
        yield aligned(line, widths, headers, left)


def aligned(row: Sequence[str], widths: Sequence[int], headers: Sequence[str], left: Sequence[str]) -> str:
    """Return a line of cells, each as wide as its column."""
    texts = [
        text.ljust(width) if header in left else text.rjust(width)
        for header, text, width in zip(headers, row, widths, strict=True)
    ]
    return BETWEEN.join(texts).rstrip()


def _listed(headers: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Each row as a list of headers and cells."""
    wide = max(map(len, headers))
    for number, row in enumerate(rows):
        if number:
            yield ""
        for header, cell in zip(headers, row, strict=True):
            yield f"{header.ljust(wide)}{BETWEEN}{cell}"

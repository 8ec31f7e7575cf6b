"""Text tables: plain columns in a pipe; on a terminal within its width, with no word cut."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Sequence

from assoc._text.plain import printable

_BETWEEN = 2


def print_table(headers: Sequence[str], rows: Sequence[Sequence[str]], *, left: Sequence[str] = ()) -> None:
    """Print a table to stdout, columns named in `left` left-aligned, the others right.

    Where a terminal is too narrow cells are broken between words; where it is narrower than the longest words, each row
    is printed as a list.
    """
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    print("\n".join(table_lines(headers, rows, left, width)))


def table_lines(
    headers: Sequence[str], rows: Sequence[Sequence[str]], left: Sequence[str], width: int | None
) -> list[str]:
    """Lines of a table, of at most ``width`` if its words allow that; None: as wide as it is, and without a rule."""
    from rich.box import SIMPLE_HEAD
    from rich.console import Console
    from rich.table import Table

    cells = [[printable(cell) for cell in row] for row in rows]
    columns = [*zip(headers, *cells, strict=True)]
    least = [max(len(word) for cell in column for word in cell.split(" ")) for column in columns]
    between = _BETWEEN * (len(headers) - 1)
    if width is not None and sum(least) + between > width:
        wide = max(map(len, headers))
        listed = [[f"{header:<{wide}}  {cell}" for header, cell in zip(headers, row, strict=True)] for row in cells]
        return [line for one in listed for line in ("", *one)][1:]
    box, gap = (None, _BETWEEN) if width is None else (SIMPLE_HEAD, _BETWEEN - 1)
    table = Table(box=box, show_edge=False, pad_edge=False, padding=(0, 0, 0, gap))
    for header, fewest in zip(headers, least, strict=True):
        table.add_column(header, justify="left" if header in left else "right", min_width=fewest, header_style="")
    for row in cells:
        table.add_row(*row)
    most = sum(max(map(len, column)) for column in columns) + between
    console = Console(width=most if width is None else width, markup=False, highlight=False, emoji=False)
    with console.capture() as shown:
        console.print(table)
    return [line.rstrip() for line in shown.get().splitlines()]

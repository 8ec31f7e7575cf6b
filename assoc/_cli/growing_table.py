"""A table on a terminal that grows: each row is printed as soon as it is known."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence

from assoc._cli.table import BETWEEN, aligned, heading


class GrowingTable:
    """Rows for a terminal, printed one by one in columns whose widths the first row decides.

    Parameters
    ----------
    headers : sequence of str
    widths : mapping
        By header: what later cells may need, where that is more than the first row shows.
    left : sequence of str
        Headers of the columns that are aligned to the left.
    most : int
        Times that rows are printed; later ones are not.

    Attributes
    ----------
    fits : bool
        Whether the terminal is wide enough; otherwise nothing is printed. Known after the first row.
    """

    def __init__(self, headers: Sequence[str], widths: Mapping[str, int], left: Sequence[str], most: int) -> None:
        self._headers = headers
        self._wanted = widths
        self._left = left
        self._most = most
        self._widths: list[int] = []
        self.fits = True

    def add(self, rows: Sequence[Sequence[str]]) -> None:
        """Print rows; a cell that is wider than its column moves the rest of its row."""
        if not self._widths:
            self._begin(rows)
        if not self.fits or self._most <= 0:
            return
        self._most -= 1
        for row in rows:
            print(aligned(row, self._widths, self._headers, self._left), flush=True)

    def _begin(self, rows: Sequence[Sequence[str]]) -> None:
        width = shutil.get_terminal_size().columns
        for split in (False, True):
            words = [header.split(" ") if split and len(header) > 5 else [header] for header in self._headers]
            self._widths = [
                max(*map(len, header), *(len(row[i]) for row in rows), self._wanted.get(self._headers[i], 0))
                for i, header in enumerate(words)
            ]
            total = sum(self._widths) + len(BETWEEN) * (len(words) - 1)
            if total <= width:
                for line in heading(words, self._widths, self._headers, self._left):
                    print(line)
                return
        self.fits = False

"""The table of an association: one row a scan, for people (text, rich) and for other programs (CSV)."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from assoc.association.scan import ScanAssociation
from assoc.association.table import LEFT_ALIGNED, rows


def print_table(scans: Sequence[ScanAssociation], files: Sequence[str]) -> None:
    """Print the table to stdout: drawn on a terminal, plain columns elsewhere."""
    headers, cells = rows(scans, files)
    if sys.stdout.isatty():
        from rich import box
        from rich.console import Console
        from rich.table import Table

        table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
        for header in headers:
            table.add_column(header, justify="left" if header in LEFT_ALIGNED else "right", no_wrap=header != "file")
        for row in cells:
            table.add_row(*row)
        Console().print(table)
        return
    widths = [max(len(row[i]) for row in [headers, *cells]) for i in range(len(headers))]
    for row in [headers, *cells]:
        texts = [
            text.ljust(width) if header in LEFT_ALIGNED else text.rjust(width)
            for header, text, width in zip(headers, row, widths, strict=True)
        ]
        print("  ".join(texts).rstrip())

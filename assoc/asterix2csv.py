"""``python -m assoc.asterix2csv``: writes the records of an ASTERIX file as CSV.

This is a program: the package must not import it. Imports inside functions keep --help quick.
"""

from __future__ import annotations

import csv
import io
from collections import Counter

from assoc._cli.lines import print_lines
from assoc._cli.messages import messages
from assoc._cli.options import Option, Parser, verbosity
from assoc._cli.program import Program, command
from assoc._cli.signals import EarlyEnd
from assoc._cli.values import Output, editions_of
from assoc._files.output import STDOUT, write_text
from assoc._text.plain import printable
from assoc.errors import warn

_OPTIONS = (
    Option("file", "FILE", "ASTERIX data blocks: plain, in frames of FINAL or ORADIS, or captured (pcap, pcapng)",
           positional=True),
    Option("edition", "CAT=EDITION", "editions of categories, as 021=0.26,048=1.27 (default: those that fit)",
           editions_of),
    Option("output", "FILE.csv", "file for the table (default: stdout)", Output(".csv"), short="-o"),
    *verbosity("how many records of each category and source"),
)  # fmt: skip


def _convert(words: list[str]) -> None:
    given = parser().read(words)
    output = given["output"] = given["output"] or STDOUT
    given.check_outputs([given["file"]])
    with messages(given):
        from assoc.integrations.asterix.table import COLUMNS, read_records

        notes: dict[str, int] = {}
        rows = read_records(given["file"], notes, editions=given["edition"])
        text = io.StringIO()
        writer = csv.DictWriter(text, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        write_text(output, text.getvalue())
        print_lines(f"{printable(output)}: {len(rows)} records")
        counts = Counter((row["category"], row["sac"], row["sic"]) for row in rows) if given["verbose"] else {}
        for (category, sac, sic), count in counts.items():
            print_lines(f"category {category:03d} of {sac}/{sic}: {count}")
        for what, count in notes.items():
            warn(f"{given['file']}: {what}: {count}")


def parser() -> Parser:
    """Return the parser of the program."""
    made = Parser(
        prog="assoc.asterix2csv",
        usage=f"{command('asterix2csv')} FILE [-o FILE.csv]",
        description="Write the records of an ASTERIX file as CSV (categories 001, 002, 010, 020, 021, 034, 048, 062).",
    )
    made.declare(*_OPTIONS)
    return made


PROGRAM = Program("assoc.asterix2csv", _convert, EarlyEnd("assoc.asterix2csv").on_signals)
start, main = PROGRAM.start, PROGRAM.main

if __name__ == "__main__":
    raise SystemExit(start())

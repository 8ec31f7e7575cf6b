"""Tables written row by row: CSV, or Parquet by the ending of the name."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from assoc._files.output import FilePath, written_gradually
from assoc._text.plain import spreadsheet_text
from assoc._types import Array

if TYPE_CHECKING:
    import pandas as pd

_QUOTED = re.compile(r'[,"\r\n]')

# rows that are written at once: few row groups make Parquet small, and texts take memory
_ROWS, _TEXTS = 50_000, 10_000


def csv_text(frame: pd.DataFrame, *, header: bool = True) -> str:
    """What `pandas.DataFrame.to_csv` makes of numbers and texts without an index; faster with pyarrow."""
    try:
        import pyarrow as pa
        import pyarrow.compute as pc
    except ImportError:
        return str(frame.to_csv(index=False, header=header, lineterminator="\n"))
    columns = []
    for name in frame:
        values = frame[name]
        kind = values.dtype.kind
        if kind == "f":
            texts = _floats(values.to_numpy(dtype=np.float64))
        elif kind == "b":
            texts = pc.if_else(pa.array(values.to_numpy()), "True", "False")
        elif kind in "iu":
            texts = pa.array(values.to_numpy()).cast("string")
        else:
            # half characters, as from names of files that are not UTF-8, are none for pyarrow
            quoted = {
                text: _cell(text).encode("utf-8", "backslashreplace").decode() for text in values.unique().tolist()
            }
            texts = pa.array([quoted[text] for text in values.tolist()], "string")
        columns.append(texts)
    first = [",".join(map(_cell, map(str, frame.columns)))] if header else []
    return "\n".join([*first, *pc.binary_join_element_wise(*columns, ",").to_pylist(), ""])


def _floats(values: Array) -> Any:
    """The shortest texts that are read as these numbers; empty for NaN."""
    import pyarrow as pa
    import pyarrow.compute as pc

    size = np.abs(values)
    # pyarrow's whole numbers and exponents look otherwise
    odd = (size <= 1e-3) | (size >= 1e9) | (values == np.rint(values)) | np.isnan(values)
    texts = ["" if number != number else repr(number) for number in values[odd].tolist()]
    return pc.replace_with_mask(pa.array(values).cast("string"), odd, pa.array(texts, "string"))


def _cell(text: str) -> str:
    return '"' + text.replace('"', '""') + '"' if _QUOTED.search(text) else text


def escaped(texts: pd.Series) -> pd.Series:
    """Texts as a CSV file may have them; see `spreadsheet_text`."""
    return texts.map({text: spreadsheet_text(text) for text in texts.unique()})


class TableWriter:
    """Takes parts of a table; see `table_writer`."""

    def __init__(self, file: IO[bytes], parquet: bool) -> None:
        self._file, self.parquet = file, parquet
        self._parts: list[pd.DataFrame] = []
        self._waiting = 0
        self._writer: Any = None
        self._begun = False

    def add(self, part: pd.DataFrame) -> None:
        """Write some rows; all parts have the same columns."""
        self._parts.append(part)
        self._waiting += len(part)
        if self._waiting >= (_ROWS if self.parquet else _TEXTS):
            self._write()

    def _write(self) -> None:
        import pandas as pd

        # parts without rows may have columns of other types
        full = [part for part in self._parts if len(part)] or self._parts[:1]
        frame = pd.concat(full, ignore_index=True)
        self._parts, self._waiting = [], 0
        if not self.parquet:
            self._file.write(csv_text(frame, header=not self._begun).encode("utf-8", "backslashreplace"))
        else:
            import pyarrow as pa
            from pyarrow import parquet

            table = pa.Table.from_pandas(frame, preserve_index=False)
            if self._writer is None:
                self._writer = parquet.ParquetWriter(self._file, table.schema)
            self._writer.write_table(table)
        self._begun = True

    def end(self) -> None:
        """Write the rest."""
        if self._parts and (self._waiting or not self._begun):
            self._write()
        if self._writer is not None:
            self._writer.close()


@contextmanager
def table_writer(path: FilePath) -> Iterator[TableWriter]:
    """A table that takes its name at the end: Parquet if it ends in .parquet (needs pyarrow), else CSV.

    At least one part, which may be empty, must be added.
    """
    with written_gradually(path) as file:
        writer = TableWriter(file, os.fspath(path).lower().endswith(".parquet"))
        yield writer
        writer.end()

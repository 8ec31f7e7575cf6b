"""How notebooks show results: one line, and the first rows of a table."""

from __future__ import annotations

from typing import Any

from assoc._text.html import escape, facts, table

_SHOWN = 10


class Shown:
    """A result that notebooks show by its ``repr`` and, where it has them, its ``to_frame`` or its ``to_dict``."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Return HTML for notebooks."""
        line = f"<p>{escape(repr(self))}</p>"
        if hasattr(self, "to_frame"):
            frame = self.to_frame()
            rows = [[_text(value) for value in row] for row in frame.head(_SHOWN).itertuples(index=False)]
            rest = len(frame) - _SHOWN
            more = f"<p>... and {rest} more rows</p>" if rest > 0 else ""
            return f"{line}{table(list(frame.columns), rows)}{more}"
        if hasattr(self, "to_dict"):
            return line + facts({name: _text(value) for name, value in self.to_dict().items()})
        return line


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)

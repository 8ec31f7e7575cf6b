"""Records of ASTERIX data blocks, by the edition of each category that explains them."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from types import ModuleType
from typing import Any

from assoc._files import reading
from assoc._system.imports import check_extra, load_extra
from assoc.errors import InvalidInputError
from assoc.integrations.asterix.frames import Block, data_blocks
from assoc.integrations.asterix.items import plausible
from assoc.integrations.asterix.old_tracks import EDITION, old_tracks

CATEGORIES = (1, 2, 10, 20, 21, 34, 48, 62)
"""Categories that are read."""
# of each source so many blocks tell its edition
_SAMPLE = 10
# so many bytes of a file are decoded to find editions, in all; and so many records of a block are judged
_TRIED, _JUDGED = 500_000, 50


@lru_cache(maxsize=1)
def library() -> tuple[ModuleType, ModuleType]:
    """The modules ``asterix.base`` and ``asterix.generated``; loading the second takes a second."""
    return load_extra("asterix.base", "asterix"), load_extra("asterix.generated", "asterix")


@lru_cache(maxsize=64)
def editions(category: int) -> dict[str, Any]:
    """Classes of the package for a category by its editions, the newest first; None for that of `old_tracks`."""
    module, start = library()[1], f"Cat_{category:03d}_"
    found = {name.removeprefix(start).replace("_", "."): getattr(module, name) for name in dir(module)
             if re.fullmatch(rf"{start}\d+_\d+", name)}  # fmt: skip
    known = dict(sorted(found.items(), key=lambda entry: [-int(part) for part in entry[0].split(".")]))
    return known | ({EDITION: None} if category == 62 else {})


def edition(category: int) -> Any:
    """Class of the package for the newest edition of a category, in which is written."""
    return next(iter(editions(category).values()))


class Records:
    """The records of a file, each with its category and its edition; what cannot be read is counted in `notes`.

    Of each source the edition is chosen, newest first, in which most of its first blocks decode to plausible values;
    a block that it does not explain is tried in the others. ``given`` are editions by category that are not chosen.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        notes: Counter[str],
        given: Mapping[int, str] | None = None,
        *,
        categories: Sequence[int] = CATEGORIES,
    ) -> None:
        check_extra("asterix", "asterix")
        self._notes, self._categories, self._left = notes, categories, _TRIED
        self._given = dict(given or {})
        for category, name in self._given.items():
            if category not in CATEGORIES:
                known = ", ".join(f"{one:03d}" for one in CATEGORIES)
                raise InvalidInputError(f"editions: expected a category of {known}, got {category!r}")
            if name not in editions(category):
                known = ", ".join(editions(category))
                raise InvalidInputError(f"editions: category {category:03d}: expected one of {known}, got {name!r}")
        self._content = reading.read_bytes(path)

    def __iter__(self) -> Iterator[list[tuple[int, str, Any]]]:
        """Yield the records of each block."""
        sample: dict[tuple[int, bytes], list[Block]] = {}
        for block in data_blocks(self._content, Counter()):
            if block.category in self._categories:
                first = sample.setdefault((block.category, _source(block.content)), [])
                if len(first) < _SAMPLE:
                    first.append(block)
        # a source's own, chosen when it comes
        chosen: dict[tuple[int, bytes], str] = {}
        for block in data_blocks(self._content, self._notes):
            category = block.category
            if category not in self._categories:
                self._notes[f"data blocks of category {category:03d}"] += 1
                continue
            key = category, _source(block.content)
            if key not in chosen:
                chosen[key] = self._given.get(category) or self._explaining(sample.pop(key))
            found, name = self._decoded(block, chosen[key])
            if found is None:
                self._notes[f"data blocks of category {category:03d} that cannot be decoded"] += 1
                continue
            if name != next(iter(editions(category))):
                self._notes[f"data blocks of category {category:03d} read as of edition {name}"] += 1
            yield [(category, name, record) for record in found]

    def _decoded(self, block: Block, name: str) -> tuple[list[Any] | None, str]:
        """Records of a block and their edition, the chosen one if it explains them; None if no edition does."""
        found = decoded(block, name) if name else None
        if found is None and name and block.category not in self._given:
            for other in editions(block.category):
                if other != name and self._share([block], other) == 1.0:
                    return decoded(block, other), other
        return found, name

    def _explaining(self, blocks: list[Block]) -> str:
        """The edition that explains most of the blocks, at least half; empty if none does."""
        best, most = "", 0.5
        for name in editions(blocks[0].category):
            share = self._share(blocks, name)
            if share == 1.0:
                return name
            if share > most or (share == most and not best):
                best, most = name, share
        return best

    def _share(self, blocks: list[Block], name: str) -> float:
        """Which share of blocks decodes to plausible values; of a file of garbage not all is tried."""
        good = 0.0
        for block in blocks:
            newest = name == next(iter(editions(block.category)))
            if not newest:
                self._left -= len(block.content)
            found = (decoded(block, name) or [])[:_JUDGED] if newest or self._left > 0 else []
            good += sum(plausible(record, block.category, name) for record in found) / max(len(found), 1)
        return good / len(blocks)


def _source(content: bytes) -> bytes:
    """The two bytes of item 010, the first in all categories; empty if there is none."""
    at = next((k for k, byte in enumerate(content[:16]) if not byte & 1), 16) + 1
    return content[at : at + 2] if content[:1] >= b"\x80" else b""


def decoded(block: Block, name: str) -> list[Any] | None:
    """Records of a data block in an edition; None if they cannot be decoded."""
    if editions(block.category)[name] is None:
        return old_tracks(block.content, edition(block.category))
    kind, base = editions(block.category)[name].cv_uap, library()[0]
    content = base.Bits.from_bytes(block.content)
    found: Any
    try:
        found = _mixed(kind, block.content) if issubclass(kind, base.UapMultiple) else kind.parse(content)
    except (TypeError, ValueError, AttributeError, LookupError, AssertionError):
        # the package fails so on bits of items that its editions do not define
        return None
    return None if isinstance(found, ValueError) else list(found)


def _mixed(kind: Any, content: bytes) -> list[Any] | ValueError:
    """Records of category 001: item 020, in the same place in both, says which are plots and which tracks."""
    base, names = library()[0], kind.cv_selector[1]
    found = []
    while content:
        at = next((k for k, byte in enumerate(content) if not byte & 1), len(content)) + 1
        # after the source comes item 020, whose first bit tells: no record is decoded twice
        at += 2 * (content[0] >> 7)
        if not content[0] & 0x40 or at >= len(content):
            return ValueError("neither plot nor track")
        parsed = kind.cv_uaps[names[content[at] >> 7]].parse(
            base.ParsingMode.StrictParsing, base.Bits.from_bytes(content)
        )
        if isinstance(parsed, ValueError):
            return parsed
        found.append(parsed[0])
        content = content[len(content) - len(parsed[1]) // 8 :]
    return found

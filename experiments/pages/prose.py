"""Pages whose figures are filled in from the published results: each names the claim that it is of."""

import re
import textwrap
from collections.abc import Callable
from functools import cache
from pathlib import Path

from experiments.common.claims import Claim
from experiments.common.results import Results, number, result_file

FOLDER = Path(__file__).with_name("prose")
"""The pages as they are written by hand, with {{FILE: QUANTITY}} where a figure stands.

FILE is a result file ("papers." may be left out), QUANTITY the claim's, or what it begins with if no other does. After
a "|" may follow what is meant (ours, paper, low, high: the interval's ends) and the significant digits."""
SLOT = re.compile(r"\{\{\s*([\w.]+):\s*([^{}|]+?)\s*(?:\|\s*(ours|paper|low|high)?\s*(\d)?\s*)?\}\}")
ITEM = re.compile(r"^- .*(?:\n  .*)*|^(?![-|#`> ]).+(?:\n(?![-|#`>]).+)*", re.MULTILINE)
"""An item of a list or a paragraph."""
_results = cache(Results)


def find(file: str, quantity: str) -> Claim:
    """Return the one claim that a slot names.

    Raises KeyError: No claim, or several, begin with these words.
    """
    results = _results(file if result_file(file).exists() else f"papers.{file}")
    if quantity in results:
        return results[quantity]
    found = results.starting(quantity)
    if len(found) > 1:
        raise KeyError(f"{quantity!r} begins {len(found)} claims of {results.path}")
    return found[0]


def figure(match: re.Match[str]) -> str:
    """Return the figure of a slot."""
    file, quantity, part, digits = match.groups()
    claim = find(file, " ".join(quantity.split()))
    low, high = claim.interval or (None, None)
    value = {"ours": claim.ours, "paper": claim.paper, "low": low, "high": high}[part or "ours"]
    if value is None:
        raise KeyError(f"{quantity!r} of papers.{file} has no {part}")
    # counts are whole numbers without a unit
    return f"{value:,.0f}" if not claim.unit and value == int(value) and not digits else number(value, int(digits or 3))


def page(name: str) -> str:
    """Return a page with its figures.

    Raises ValueError: A slot is misspelt, or outside of paragraphs and items of lists.
    """
    text = ITEM.sub(_filled, (FOLDER / f"{name}.md").read_text(encoding="utf-8")).rstrip("\n")
    if "{{" in text:
        raise ValueError(f"{name}.md: not filled: {text[text.index('{{') :][:80]!r}")
    title, rest = text.split("\n", 1)
    return f"{title}\n\n<!-- written by python -m experiments.pages from experiments/pages/prose/{name}.md -->\n{rest}"


def _filled(item: re.Match[str]) -> str:
    if not SLOT.search(item[0]):
        return item[0]
    words = " ".join(SLOT.sub(figure, item[0]).split())
    indent = "  " if words.startswith("- ") else ""
    return textwrap.fill(words, 120, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False)


def _of(name: str) -> Callable[[], str]:
    return lambda: page(name)


PAGES: dict[str, Callable[[], str]] = {path.stem: _of(path.stem) for path in sorted(FOLDER.glob("*.md"))}
"""Name of the page -> what makes it."""

"""The licences of what pyproject.toml requires, from the packages' own metadata.

    python -m tests.release.licences           compare docs/dependencies.md with what is installed
    python -m tests.release.licences --write   write the table anew

Packages word their licences in many ways, and in other words from one version to the next, so that the table
names the family ("BSD"), which is what a user has to know.
"""

import argparse
import re
import sys
from importlib import metadata

from tests.release.requirements import ROOT, Requirement, read

PAGE = ROOT / "docs" / "dependencies.md"
MARK = "<!-- written by python -m tests.release.licences --write -->"

_FAMILIES = {
    "GPL": r"\bA?GPL|GNU (Affero )?General Public",
    "LGPL": r"\bLGPL|Lesser General Public",
    "MPL-2.0": r"\bMPL|Mozilla",
    "Apache-2.0": r"Apache",
    "BSD": r"\bBSD\b|0BSD|BSD-|Redistribution and use in source and binary forms",
    "MIT": r"\bMIT\b|Permission is hereby granted, free of charge",
    "PSF": r"\bPSF|Python Software Foundation",
    "ISC": r"\bISC\b",
    "Zlib": r"(?i)\bzlib\b",
    "CC0": r"\bCC0",
    "public domain": r"(?i)public[- ]domain",
}
_PURPOSES = {
    "base": "always",
    "dask": "`assoc[dask]`",
    "tune": "`assoc[tune]`",
    "plot": "`assoc[plot]`",
    "stonesoup": "`assoc[stonesoup]`",
    "report": "`assoc[report]`",
    "parquet": "`assoc[parquet]`",
    "asterix": "`assoc[asterix]`",
    "motile": "`assoc[motile]`",
    "bench": "`assoc[bench]`, comparisons",
    "peers": "`assoc[peers]`, comparisons",
    "docs": "pages",
    "test": "tests",
    "lint": "checks",
    "release": "checks before a release",
    "build": "building",
}


def families(distribution: metadata.Distribution) -> list[str]:
    """Families of licences that a package's metadata name; its licence files where they name none."""
    about = distribution.metadata
    classifiers = [one for one in about.get_all("Classifier") or [] if one.startswith("License ::")]
    # the first lines: what follows may be the licences of libraries that are shipped along
    texts = [about.get("License-Expression") or " ".join(classifiers) or (about.get("License") or "")[:2000]]
    if not _named(texts[0]):
        for file in distribution.files or []:
            if re.search(r"licen[cs]e|copying", file.name, re.IGNORECASE):
                texts.append(file.read_text()[:2000])
    return _named("\n".join(texts))


def _named(text: str) -> list[str]:
    return [family for family, form in _FAMILIES.items() if re.search(form, text)]


def direct(requirements: list[Requirement]) -> dict[str, tuple[str, list[str]]]:
    """Oldest version and groups of each package that is required."""
    found: dict[str, tuple[str, list[str]]] = {}
    for one in requirements:
        _, groups = found.setdefault(one.name, (one.oldest, []))
        groups.append(one.group)
    return found


def _installed(name: str) -> metadata.Distribution | None:
    try:
        return metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return None


def direct_table() -> str:
    """The table as it stands in the page."""
    lines = ["| package | at least | for | licence |", "|---|---|---|---|"]
    for name, (oldest, groups) in direct(read()).items():
        lines.append(f"| {name} | {oldest} | {', '.join(_PURPOSES[group] for group in groups)} | {_licence(name)} |")
    return "\n".join(lines)


def _licence(name: str) -> str:
    found = _installed(name)
    return "?" if found is None else " and ".join(families(found)) or "?"


def listed(page: str) -> dict[str, tuple[str, str]]:
    """Oldest version and licence of each package in the table of the page's text."""
    text = page.split(MARK)[1]
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return {name: (oldest, licence) for name, oldest, _, licence in rows[1:]}


def complaints(text: str) -> list[str]:
    """What the page says that is not so, or does not say; packages that are not installed are not compared."""
    page, found = listed(text), []
    needed = direct(read())
    for name, (oldest, _) in needed.items():
        if name not in page:
            found.append(f"{name}: is not listed")
            continue
        if page[name][0] != oldest:
            found.append(f"{name}: at least {oldest}, the page says {page[name][0]}")
        package = _installed(name)
        said = {*page[name][1].split(" and ")}
        if package is not None and not said & {*families(package)}:
            found.append(f"{name}: {' and '.join(families(package)) or 'no licence'}, the page says {page[name][1]}")
    return found + [f"{name}: is listed, and not required" for name in page if name not in needed]


def main(arguments: list[str] | None = None) -> int:
    """Run the program; exit code 1 if the page is wrong."""
    parser = argparse.ArgumentParser(description="The licences of what is required.")
    parser.add_argument("--write", action="store_true")
    chosen = parser.parse_args(arguments)
    if chosen.write:
        before = PAGE.read_text().split(MARK)[0]
        PAGE.write_text(f"{before}{MARK}\n\n{direct_table()}\n")
    found = complaints(PAGE.read_text())
    print("\n".join(found) or f"{PAGE.name}: as required and installed")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())

"""The tables of docs/benchmark_set.md, from what is known and what was compared."""

from collections import defaultdict
from typing import Any

from experiments.sdlib import store
from experiments.sdlib.comparison import comparison_tables


def tables() -> str:
    """Return the tables as text."""
    rows = store.table()
    families: dict[str, list[str]] = defaultdict(list)
    for name, row in rows.items():
        families[row["family"]].append(name)
    optimal = sum(row["status"] == "optimal" for row in rows.values())
    share = 100 * optimal / max(len(rows), 1)
    first = f"{len(rows)} instances, {optimal} proved optimal ({share:.0f} %), each with a proof in the repository."
    lines = [first, ""]
    lines += ["| family | instances | tuples | proved |", "|---|---|---|---|"]
    for family, names in sorted(families.items()):
        counts = [rows[name]["tuples"] for name in names]
        proved = sum(rows[name]["status"] == "optimal" for name in names)
        lines.append(f"| {family} | {len(names)} | {min(counts):,} to {max(counts):,} | {proved} |")
    lines += [
        "",
        "| instance | sizes | tuples | components | root bound | value | best bound | status | found by | seconds |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [_line(name, rows[name]) for names in families.values() for name in names]
    return "\n".join(lines)


def _line(name: str, row: dict[str, Any]) -> str:
    sizes = " ".join(map(str, row["sizes"]))
    bound = row["value"] if row["status"] == "optimal" else f"{row['bound']:.6f}"
    return (
        f"| {name} | {sizes} | {row['tuples']:,} | {row['components']:,} | {row['root bound']:.6f} | {row['value']} "
        f"| {bound} | {row['status']} | {row['who']}, {row['when']} | {row['seconds']:.2f} |"
    )


TABLES = {"benchmark-set": tables, "benchmark-set-comparison": comparison_tables}

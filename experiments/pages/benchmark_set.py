"""The tables of docs/benchmark_set.md, from what is known and what was compared."""

from collections import defaultdict
from typing import Any

from experiments.common.results import plain_table
from experiments.sdlib import store
from experiments.sdlib.comparison import comparison_tables


def tables() -> str:
    """Return the tables as text."""
    rows = store.table()
    families: dict[str, list[str]] = defaultdict(list)
    for name, row in rows.items():
        families[row["family"]].append(name)
    proved = {name: row["status"] == "optimal" for name, row in rows.items()}
    share = 100 * sum(proved.values()) / max(len(rows), 1)
    few = []
    for family, names in sorted(families.items()):
        counts = [rows[name]["tuples"] for name in names]
        few.append([family, str(len(names)), f"{min(counts):,} to {max(counts):,}", str(sum(map(proved.get, names)))])
    head = ["instance", "sizes", "tuples", "components", "root bound", "value", "best bound", "status", "found by"]
    return "\n\n".join((
        f"{len(rows)} instances, {sum(proved.values())} proved optimal ({share:.0f} %), each with a proof in the "
        "repository.",
        plain_table(["family", "instances", "tuples", "proved"], few),
        plain_table([*head, "seconds"], [_line(name, rows[name]) for names in families.values() for name in names]),
    ))  # fmt: skip


def _line(name: str, row: dict[str, Any]) -> list[str]:
    bound = row["value"] if row["status"] == "optimal" else f"{row['bound']:.6f}"
    return [
        name, " ".join(map(str, row["sizes"])), f"{row['tuples']:,}", f"{row['components']:,}",
        f"{row['root bound']:.6f}", row["value"], bound, row["status"], f"{row['who']}, {row['when']}",
        f"{row['seconds']:.2f}",
    ]  # fmt: skip


TABLES = {"benchmark-set": tables, "benchmark-set-comparison": comparison_tables}

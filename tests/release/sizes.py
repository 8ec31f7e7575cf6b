"""What ``pip install assoc`` downloads and puts on the disk, package by package.

    python -m tests.release.sizes      (needs a network, or an index that pip knows)

downloads the newest packages that fit this Python and this system into a temporary folder, and prints a table. What an
installation takes, Python's bytecode included, stands in docs/dependencies.md.
"""

import subprocess
import sys
import tempfile
import time
import zipfile
from pathlib import Path

from tests.release.licences import behind
from tests.release.requirements import canonical, read


def table(folder: Path) -> list[str]:
    """Lines of a table of the wheels in a folder, the largest first."""
    base = [one.name for one in read() if one.group == "base"]
    through = {name: ", ".join(sorted(roots)) for name, roots in behind(base).items()}
    rows = []
    for path in folder.glob("*.whl"):
        with zipfile.ZipFile(path) as archive:
            unpacked = sum(info.file_size for info in archive.infolist())
        name, version = path.name.split("-")[:2]
        rows.append((unpacked, path.stat().st_size, f"{canonical(name)} {version}", through.get(canonical(name), "")))
    rows.sort(reverse=True)
    rows.append((sum(row[0] for row in rows), sum(row[1] for row in rows), "all", ""))
    lines = ["| package | through | download, MB | on disk, MB |", "|---|---|---|---|"]
    return lines + [f"| {name} | {by} | {size / 1e6:.1f} | {unpacked / 1e6:.1f} |" for unpacked, size, name, by in rows]


def main() -> int:
    """Run the program."""
    needs = [f"{one.name}>={one.oldest}" for one in read() if one.group == "base"]
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-cache-dir", "--dest", folder]
        started = time.perf_counter()
        subprocess.run([*command, "--only-binary", ":all:", *needs], check=True)
        print("\n".join(table(Path(folder))))
    print(f"\n{time.perf_counter() - started:.0f} s to download", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())

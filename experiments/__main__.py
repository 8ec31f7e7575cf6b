"""List the experiments: ``python -m experiments``."""

import argparse
import ast
from collections.abc import Sequence
from pathlib import Path

FOLDER = Path(__file__).parent


def programs() -> dict[str, str]:
    """Return what follows ``python -m experiments.``, and the first line of what each module says of itself."""
    found = {}
    for path in sorted(FOLDER.rglob("*.py")):
        name = ".".join(path.relative_to(FOLDER).with_suffix("").parts).removesuffix("__main__").removesuffix(".")
        text = path.read_text(encoding="utf-8")
        if name and '\nif __name__ == "__main__":' in text:
            found[name] = (ast.get_docstring(ast.parse(text)) or "").split("\n")[0]
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the list; returns the exit code."""
    argparse.ArgumentParser(
        prog="python -m experiments",
        description="List the experiments. Each has its own program, python -m experiments.NAME, with --help.",
    ).parse_args(arguments)
    print("python -m experiments.NAME [--help]\n")
    for name, measures in programs().items():
        print(f"{name}\n    {measures}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

"""The faults of faults.txt."""

from pathlib import Path
from typing import NamedTuple


class Fault(NamedTuple):
    """What is wrong, in which file, the text and what replaces it, and the test file that must fail."""

    what: str
    file: str
    old: str
    new: str
    test: str

    def put_in(self, text: str) -> str:
        """Return the text of the file with the fault.

        Raises
        ------
        ValueError
            The old text is not in the file exactly once.
        """
        if (count := text.count(self.old)) != 1:
            raise ValueError(f"{self.file}: {self.what}: the text is there {count} times, not once: {self.old!r}")
        return text.replace(self.old, self.new)


def read(text: str) -> list[Fault]:
    """Read the table."""
    found = []
    for group in text.split("\n== ")[1:]:
        files, *faults = group.split("\n# ")
        file, test = files.split()
        for fault in faults:
            what, *lines = fault.rstrip("\n").split("\n")
            old, new = ("\n".join(line[2:] for line in lines if line[0] == sign) for sign in "-+")
            found.append(Fault(what, file, old, new, test))
    return found


FAULTS = read(Path(__file__).with_name("faults.txt").read_text(encoding="utf-8"))

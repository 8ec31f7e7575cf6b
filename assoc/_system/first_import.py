"""Steps at the package's first import, before programs import anything else.

Programs and their processes import nothing from the current folder, which may hold untrusted files: `python -m` would
search it first. And Ctrl-C ends a program without a traceback until the program handles it.
"""

import _signal  # type: ignore[import-not-found]
import os
import sys

_HOME = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))


def path_without() -> list[str]:
    """Return the search path for modules, without the current folder unless this package lies there."""
    return [folder for folder in sys.path if _is(folder, _HOME) or not _is(folder, ".")]


def _is(folder: str, other: str) -> bool:
    folder = folder or "."
    return os.path.isdir(folder) and os.path.samefile(folder, other)


def _is_program() -> bool:
    """Whether this process runs `python -m assoc...` or the command `assoc`."""
    words = getattr(sys, "argv", None) or [""]
    if words[0] == "-m":
        return sys.orig_argv[-len(words)].removeprefix("-m").partition(".")[0] == "assoc"
    return os.path.basename(words[0]).removesuffix(".exe") == "assoc"


if _is_program():
    sys.path[:] = path_without()
    # without signal handling, programs need the exception
    if hasattr(_signal, "pthread_sigmask") and _signal.getsignal(_signal.SIGINT) is _signal.default_int_handler:
        _signal.signal(_signal.SIGINT, _signal.SIG_DFL)

"""Programs, each run in this process, or as what it is, in a process of its own: that costs a second to import."""

import contextlib
import importlib
import io
import subprocess
import sys

from tests.told import told


def here(name: str, *words: object, cwd: object = ".") -> subprocess.CompletedProcess[str]:
    """Run ``python -m name words`` in this process, but for what signals do."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.chdir(cwd), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = importlib.import_module(name).main([*map(str, words)])
        except SystemExit as ended:
            code = ended.code
    return subprocess.CompletedProcess([name, *words], code, out.getvalue(), told(err.getvalue()))


def program(*words: object, cwd: object = None) -> subprocess.CompletedProcess[str]:
    """Run ``python -W error -m words``."""
    command = [sys.executable, "-W", "error", "-m", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, cwd=cwd)
    done.stderr = told(done.stderr)
    return done

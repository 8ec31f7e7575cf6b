"""Programs, each run in this process, or as what it is, in a process of its own: that costs a second to import."""

import contextlib
import importlib
import io
import os
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


def process(*words: object, cwd: object = None, **variables: object) -> subprocess.CompletedProcess[str]:
    """Run ``python words`` with these variables of the environment."""
    environment = {**os.environ, **{name: str(value) for name, value in variables.items()}}
    command = [sys.executable, *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, cwd=cwd, env=environment)
    done.stderr = told(done.stderr)
    return done


def program(*words: object, cwd: object = None) -> subprocess.CompletedProcess[str]:
    """Run ``python -W error -m words``."""
    return process("-W", "error", "-m", *words, cwd=cwd)


def printed(*words: object, cwd: object = None, **variables: object) -> str:
    """What ``python words`` prints; it must end well, and say nothing on stderr."""
    done = process(*words, cwd=cwd, **variables)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout

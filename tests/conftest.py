"""What all tests share."""

from __future__ import annotations

import contextlib
import os
import signal

from hypothesis import settings

# tests are of compiled kernels, and what they start is not to compile beside them; those of interpreting switch it on
os.environ.setdefault("ASSOC_INTERPRET", "0")

# the first example pays for compilation, and machines differ: a deadline would only find that out
settings.register_profile("assoc", deadline=None)
settings.load_profile("assoc")

# a job in the background ignores Ctrl-C, and so would the programs that the tests start
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    with contextlib.suppress(ValueError):
        signal.signal(signal.SIGINT, signal.default_int_handler)

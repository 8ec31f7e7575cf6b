"""Ctrl-C while kernels are compiled: it is heard at once, and nothing of the compiler stays behind."""

import contextlib
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.running import printed

COMPILING = """
import atexit, os, signal, threading
from assoc._system.interrupts import end_if_abandoned, uninterrupted

steps = []


def work():
    os.kill(os.getpid(), signal.SIGINT)
    for _ in range(2):
        threading.Event().wait(0.5)
        steps.append(threading.current_thread() is threading.main_thread())
    end_if_abandoned()
    steps.append("not ended")


atexit.register(lambda: print(steps))
try:
    uninterrupted(work)
except KeyboardInterrupt:
    print(steps)
assert uninterrupted(lambda: 3) == 3
"""


def test_a_signal_is_heard_at_once_and_work_ends_between_two_steps():
    assert printed("-c", COMPILING) == "[]\n[False, False]\n"


def command_lines():
    for path in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            yield (path / "cmdline").read_text()


SLOW = """
import sys, time
from assoc._cli.signals import EarlyEnd, Interruption
from assoc._system.compiled import compile_ahead, wait_for_kernels
from assoc._system.compiled import njit
from assoc._system.interrupts import uninterrupted


@njit
def kernel(x):
    return x


def prepare():
    time.sleep(600)


def work():
    print("at work", flush=True)
    if sys.argv[2] == "here":
        uninterrupted(prepare)
    else:
        assert compile_ahead(kernel, prepare, anyway=True)
        wait_for_kernels()


class Slow:
    # as Python's own end, when it takes compiled code apart
    def __del__(self):
        prepare()


kind = sys.argv[1] if len(sys.argv) > 1 else "helper"
slow = Slow() if kind != "helper" else None
if kind == "early end":
    early = EarlyEnd("slow")
    early.on_signals()
    with early.work(0.0):
        work()
elif kind == "interruption":
    interruption = Interruption("slow")
    interruption.interrupt_on_signals()
    with interruption.reported(lambda: None):
        work()
"""


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="needs POSIX signals")
@pytest.mark.parametrize(("kind", "where"), [("early end", "here"), ("interruption", "in another process")])
def test_programs_do_not_wait_for_the_compiler(kind, where, tmp_path):
    (tmp_path / "slow.py").write_text(SLOW)
    code = f"import sys; sys.path.append({str(tmp_path)!r}); import slow"
    command = [sys.executable, "-c", code, kind, where]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline() == "at work\n"
            time.sleep(0.5)
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate(timeout=600)
        finally:
            process.kill()
    assert (process.returncode, errors) == (130, "slow: interrupted\n")
    last = time.monotonic() + 120.0
    while any(str(tmp_path) in line for line in command_lines()):
        assert time.monotonic() < last, "a process that compiles is left"
        time.sleep(0.05)

"""Ctrl-C in the middle of a solve: it ends soon, in the library by KeyboardInterrupt, and what was there stays."""

import importlib
import json
import pkgutil
import typing

import pytest
from numba.core.dispatcher import Dispatcher

import assoc
from tests.running import printed, process

LIBRARY = """
import _thread, json, os, signal, sys, threading
import numpy as np
import assoc
from tests.reliability.big import ghosts

problem = ghosts(60, 60_000)
# first calls compile, and would be late for that
endless = {"iterations": 10**9, "patience": 10**9}
ways = {
    "exact": lambda limit: assoc.assign(problem, "exact", time_limit=limit),
    "aco": lambda limit: assoc.assign(problem, "aco", time_limit=limit, **endless),
    "tabu": lambda limit: assoc.assign(problem, "tabu", time_limit=limit, **endless),
    "genetic": lambda limit: assoc.assign(problem, "genetic", time_limit=limit, **endless),
    "milp": lambda limit: assoc.assign(problem, "milp", time_limit=limit),
    "kbest": lambda limit: assoc.kbest(problem, 10**6, time_limit=limit),
}
heard = {}
for name in sys.argv[1].split(","):
    ways[name](0.3)
    heard[name] = False
    # Python drops an interrupt that comes in a destructor (while a kernel is compiled, say): once more then
    for attempt in range(3):
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
        try:
            ways[name](30.0)
        except KeyboardInterrupt:
            heard[name] = True
            break
print(json.dumps(heard), flush=True)
# a MIP that was left behind may still be at work
os._exit(0)
"""


CONVERTING = """
import os, signal, threading
import assoc
from tests.reliability.big import ghosts

problem = ghosts(60, 60_000)
# long enough that no kernel is left to compile or to load
assoc.assign(problem, "exact", time_limit=5.0)
heard = 0
for delay in (0.02, 0.03, 0.05, 0.08, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35):
    threading.Timer(delay, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    try:
        assoc.assign(problem, "exact", time_limit=5.0)
    except KeyboardInterrupt:
        heard += 1
print(heard, flush=True)
os._exit(0)
"""


@pytest.mark.slow
def test_while_a_result_is_converted():
    # a signal that comes during a kernel is heard when its result is converted: a record's class is then missing
    assert printed("-c", CONVERTING).strip() == "10"


@pytest.mark.slow
def test_in_the_library():
    names = ["exact", "aco", "tabu", "genetic", "milp", "kbest"]
    done = process("-c", LIBRARY, ",".join(names))
    assert done.returncode == 0, done.stderr
    # what is not interrupted comes back at its time limit
    assert json.loads(done.stdout) == dict.fromkeys(names, True)


def records(kind):
    if isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields"):
        yield kind.__name__
    for inner in typing.get_args(kind):
        yield from records(inner)


def test_no_kernel_returns_a_record_to_python():
    """numba goes on where Python raised instead of giving a record's class: that ends the process."""
    returned = set()
    for module in pkgutil.walk_packages(assoc.__path__, "assoc."):
        if module.name.endswith("__main__"):
            continue
        for kernel in vars(importlib.import_module(module.name)).values():
            if isinstance(kernel, Dispatcher) and not kernel.targetoptions.get("no_cpython_wrapper"):
                kinds = typing.get_type_hints(kernel.py_func)
                returned |= {f"{kernel.py_func.__qualname__} returns {name}" for name in records(kinds["return"])}
    assert returned == set()


DRAWN = """
import ctypes, sys, assoc
from tests.reliability.big import ghosts

problem, cast = ghosts(12, 900), ctypes.cast
none = {"refinement": "none"}
ways = [("aco", {}), ("aco", none), ("aco", none | {"mode": "paper"}), ("genetic", none), ("tabu", none),
        ("lagrangian", {})]


def interrupted(found, kind):
    # numpy casts to functions; Draws asks before any kernel is called
    if kind is ctypes.c_void_p and sys._getframe(1).f_code.co_filename.find("numba_private") < 0:
        raise KeyboardInterrupt
    return cast(found, kind)


for number in range(2):
    for name, options in ways:
        assoc.assign(problem, name, iterations=5, **options)
    ctypes.cast = interrupted
"""


def test_while_a_kernel_takes_a_generator():
    # numba asks Python's ctypes for addresses; a signal that comes there ended the process
    assert printed("-c", DRAWN, ASSOC_INTERPRET=0) == ""


EARLY = """
import signal
from assoc._cli.program import Program

Program("early", lambda words: None, lambda: signal.raise_signal(signal.SIGINT)).start([])
"""


def test_before_the_work_begins():
    done = process("-c", EARLY)
    assert (done.returncode, done.stderr) == (130, "early: interrupted\n")

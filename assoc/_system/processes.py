"""Work spread over processes of this machine, which all end with this one, however it ends."""

from __future__ import annotations

import _thread
import os
import pickle
import queue
import signal
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable, Generator, Iterable, Sequence, Sized
from contextlib import suppress
from itertools import islice
from typing import Any, NoReturn

from assoc._system import memory, temporary
from assoc._system.compile_time import announcement
from assoc.errors import InvalidInputError, LimitExceededError

# bytes of a process with numpy, scipy, compiled kernels and a small task
_PROCESS = 100e6
# seconds; a waiting main thread hears of a signal that another thread received only when it wakes up
_POLL = 0.05
# items a process that may be asked for before the first of them is done: results wait for it
_AHEAD = 16
_DIED = "a worker process died: it was killed or ran out of memory; fewer processes take less memory"


def start_python(path: Sequence[str], **options: Any) -> subprocess.Popen[bytes]:
    """Start a process that serves (`serve`), and imports from the folders of ``path`` alone."""
    folders = [folder for folder in path if isinstance(folder, str)]  # Python itself ignores others
    code = f"import sys; sys.path[:] = {folders!r}; from {__name__} import serve; serve()"
    return subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE, **options)


class _Exchange:
    """Queues between the caller and the threads that wait for processes.

    An interrupt may strike anywhere: `threading` could be left locked by it, these queues and threads of C cannot.
    """

    def __init__(self) -> None:
        self.tasks: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        self.questions: queue.SimpleQueue[tuple[int, Any] | None] = queue.SimpleQueue()
        self.answers: queue.SimpleQueue[tuple[int, Any, bool]] = queue.SimpleQueue()
        self.left: queue.SimpleQueue[None] = queue.SimpleQueue()
        self.ended: list[bool] = []

    def attend(self, worker: subprocess.Popen[bytes]) -> None:
        """Give a process the task and questions, one after the other, and take its answers."""
        try:
            # if it died, its first item will find that
            with suppress(OSError, EOFError, pickle.UnpicklingError):
                _write(worker.stdin, self.tasks.get())
                # others may take the first items until it has started
                pickle.load(worker.stdout)  # type: ignore[arg-type]
            while (entry := self.questions.get()) is not None and not self.ended:
                number, item = entry
                try:
                    self.answers.put((number, *_asked(worker, item)))
                except BaseException as error:
                    self.answers.put((number, error, True))
        finally:
            self.left.put(None)


def process_map(
    task: Callable[[Any], Any], items: Iterable[Any], jobs: int, *, ordered: bool = True, here: bool = False
) -> Generator[Any]:
    """Yield ``task(item)`` for each item, made by ``jobs`` processes; the rest is as of `engine.parallel_map`."""
    if isinstance(items, Sized):
        jobs = min(jobs, len(items))
    if jobs <= 1:
        yield from map(task, items)
        return
    memory.require(_PROCESS * jobs, f"jobs: {jobs} processes", "take fewer", here=False)
    content = _packed(task)
    workers: list[subprocess.Popen[bytes]] = []
    at = _Exchange()
    questions, answers = at.questions, at.answers
    # a thread for each process waits for its answers
    threads = 0
    numbered, asked, given = enumerate(items), 0, 0
    arrived: dict[int, Any] = {}
    try:
        _start(workers, jobs - here)
        for worker in workers:
            at.tasks.put(content)
            _thread.start_new_thread(at.attend, (worker,))
            threads += 1
        del content  # it may be large
        while True:
            for entry in islice(numbered, (_AHEAD if ordered else 2) * jobs - (asked - given)):
                questions.put(entry)
                asked += 1
            if given == asked:
                return
            busy, interrupted = False, None
            if here:
                with suppress(queue.Empty):
                    number, item = questions.get_nowait()  # type: ignore[misc]
                    busy = True
                    try:
                        arrived[number if ordered else given + len(arrived)] = _tried(task, item)
                    except KeyboardInterrupt as error:
                        # what the others have done meanwhile is handed on first
                        interrupted = error
            with suppress(queue.Empty):
                while True:
                    number, value, failed = answers.get(timeout=0.0 if busy else _POLL)
                    arrived[number if ordered else given + len(arrived)] = value, failed
                    busy = True
            while given in arrived:
                value, failed = arrived.pop(given)
                given += 1
                if failed:
                    raise value
                yield value
            if interrupted is not None:
                raise interrupted
    finally:
        # after an interruption or an error, nobody needs what they still do
        at.ended.append(True)
        for worker in workers:
            worker.kill()
            questions.put(None)
        for _ in range(threads):
            at.left.get()
        for worker in workers:
            worker.communicate()


def _tried(task: Callable[[Any], Any], item: Any) -> tuple[Any, bool]:
    """The answer of this process, or its error; and whether it is one."""
    try:
        return task(item), False
    except Exception as error:
        return error, True


def _asked(worker: subprocess.Popen[bytes], item: Any) -> tuple[Any, bool]:
    """The answer of a process, or its error; and whether it is one."""
    question = _packed(item)
    try:
        _write(worker.stdin, question)
        answer = pickle.load(worker.stdout)  # type: ignore[arg-type]
    except (OSError, EOFError, pickle.UnpicklingError):
        raise LimitExceededError(_DIED) from None
    value, failed = pickle.loads(answer)
    return value, failed


def _start(workers: list[subprocess.Popen[bytes]], jobs: int) -> None:
    """Start processes that do not receive Ctrl-C, which only this one reports."""
    held = hasattr(signal, "pthread_sigmask")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT}) if held else ()
    try:
        for _ in range(jobs):
            workers.append(start_python(sys.path, stdout=subprocess.PIPE))
    except OSError as error:
        raise LimitExceededError(f"jobs: {jobs} processes cannot be started ({error.strerror}); take fewer") from None
    finally:
        if held:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def send(process: subprocess.Popen[bytes], content: object) -> None:
    """Send a process that serves (`serve`) its task, or an item."""
    _write(process.stdin, _packed(content))


def leave(process: subprocess.Popen[bytes]) -> None:
    """Let a process that serves end after the item that it is at."""
    _write(process.stdin, b"")


def _packed(content: object) -> bytes:
    # also functions and classes of a script or a notebook, which other processes cannot import
    import cloudpickle

    try:
        return cloudpickle.dumps(content)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InvalidInputError(f"jobs: cannot be sent from one process to another ({error})") from None


def _write(pipe: Any, content: bytes) -> None:
    pickle.dump(content, pipe, pickle.HIGHEST_PROTOCOL)
    pipe.flush()


def serve() -> None:
    """Answer the parent: it sends a task, then items, each of which the task is called with."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        # programs block it, and their processes inherit that
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    questions, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # what a task reads or prints must not reach the pipes
    nowhere = os.open(os.devnull, os.O_RDWR)
    os.dup2(nowhere, 0)
    os.dup2(2 if sys.stderr else nowhere, 1)
    sys.stdout = sys.stderr
    received: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    leaving = threading.Event()

    def listen() -> None:
        try:
            while question := pickle.load(questions):
                received.put(question)
        except (OSError, EOFError, pickle.UnpicklingError):
            # the parent ended this process, or is gone itself
            temporary.end_process(1)
        leaving.set()
        received.put(b"")

    threading.Thread(target=listen, name="parent", daemon=True).start()
    task = _loaded(received.get())
    with suppress(OSError):
        _write(answers, b"")
    with announcement.silenced(), suppress(OSError):
        while (item := received.get()) and not leaving.is_set():
            _write(answers, _answer(task, item))
    temporary.end_process(0)


def _loaded(content: bytes) -> Callable[[Any], Any]:
    """Return the task, or one that raises for every item what keeps it from being loaded."""
    try:
        return pickle.loads(content)
    except Exception as error:
        wrong: Exception = error
        if isinstance(error, (ImportError, AttributeError)):
            wrong = InvalidInputError(f"jobs: a function or class cannot be imported by other processes ({error})")

    def fail(item: object) -> NoReturn:
        raise wrong

    return fail


def _answer(task: Callable[[Any], Any], item: bytes) -> bytes:
    """Return the packed result of an item and False, or an error and True."""
    try:
        return _packed((task(pickle.loads(item)), False))
    except BaseException as error:
        error.add_note(traceback.format_exc())
        try:
            return _packed((error, True))
        except InvalidInputError as unsent:
            return _packed((unsent, True))

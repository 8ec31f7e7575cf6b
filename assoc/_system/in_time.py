"""Work in a thread that is abandoned when time is over: for libraries that have no time limit, or check it seldom."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TypeVar

Answer = TypeVar("Answer")


def in_time(work: Callable[[], Answer], seconds: float, name: str) -> Answer | None:
    """Return what the work returns, or None when it is not back in that time; what it raises is raised.

    The work must let other threads run and must be safe to abandon: it continues until it ends by itself.
    """
    answers: list[Answer] = []
    errors: list[BaseException] = []

    def run_aside() -> None:
        try:
            answers.append(work())
        except BaseException as error:  # handed to the caller below
            errors.append(error)

    thread = threading.Thread(target=run_aside, name=name, daemon=True)
    thread.start()
    thread.join(max(seconds, 0.0))
    if errors:
        raise errors[0]
    return answers[0] if answers else None

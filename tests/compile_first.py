"""Compile the kernels that most tests need, before pytest starts: two processes, each of which compiles other ones.

    python -m tests.compile_first      (make test; a minute or two after the installation, then some seconds)

Two workers of pytest begin with the same kernels, and each would compile all of them.
"""

import multiprocessing
import os

# nothing is to be interpreted meanwhile
os.environ["ASSOC_INTERPRET"] = "0"


def _solvers() -> None:
    from assoc.solvers.warm_up import warm_up

    # first what trackers ask of it: the other process would compile that as well
    for names in (["exact"], None):
        warm_up(names)


def _all_but_solvers() -> None:
    from assoc.costs import build_problem
    from assoc.simulation import simulate
    from assoc.tracking.warm_up import follow_all, rank_all

    # costs first: what trackers and rankings need of the solvers is on disk by then
    for name in ("three-radar", "bearing-only"):
        build_problem(simulate(name, 3, scans=2), 0)
    follow_all()
    rank_all()


if __name__ == "__main__":
    processes = [multiprocessing.get_context("spawn").Process(target=one) for one in (_solvers, _all_but_solvers)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    raise SystemExit(max(process.exitcode or 0 for process in processes))

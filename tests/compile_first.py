"""Compile the kernels that most tests need, before pytest starts: two processes, each of which compiles other ones.

    python -m tests.compile_first      (make test; a minute or two after the installation, then some seconds)

Two workers of pytest begin with the same kernels, and each would compile all of them.
"""

import multiprocessing
import os

# nothing is to be interpreted meanwhile
os.environ["ASSOC_INTERPRET"] = "0"


def _solvers() -> None:
    import assoc

    # first what trackers ask of it: the other process would compile that as well
    assoc.warm_up(["exact"])
    assoc.warm_up()


def _all_but_solvers() -> None:
    from assoc.costs import build_problem
    from assoc.ranking.kbest import kbest
    from assoc.ranking.marginals import marginals
    from assoc.simulation import simulate
    from assoc.tracking import TRACKERS
    from assoc.tracking.filter_choice import make_filter
    from tests.oracles import small_problems
    from tests.tracking.stepping import stepped

    # costs and filters first: what trackers and rankings need of the solvers is on disk by then
    for name in ("three-radar", "bearing-only"):
        build_problem(simulate(name, 3, scans=2), 0)
    scene = simulate("three-radar", 4, scans=6)
    for kind, filter_name in (("multi-sensor", "ekf"), ("nearest-neighbour", "ukf"), ("mht", "imm")):
        filter_ = make_filter(filter_name, scene.sensors, 20.0, 0)
        stepped(TRACKERS[kind](scene.sensors, filter_, region=scene.region, time_limit=None), scene)
    for problem in small_problems(3, seed=22, dummy=True):
        kbest(problem, 3)
        marginals(problem)


if __name__ == "__main__":
    processes = [multiprocessing.get_context("spawn").Process(target=one) for one in (_solvers, _all_but_solvers)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    raise SystemExit(max(process.exitcode or 0 for process in processes))

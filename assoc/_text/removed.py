"""What existed once, and what to use instead: the one place that answers old spellings.

A removed option, name, argument or value does nothing any more; where it is met, one line says so. The spelling tells
where:

- ``--flag``: an option of the programs, also as a key of their TOML files; ``assoc.program --flag``: of one of them;
  ``--flag value``: one of its values
- ``assoc.room.name``: a public name of a package
- ``Class.name``: an attribute or a method
- ``function(argument)``, ``Class.method(argument)``: an argument by keyword of a public function (one that
  `explains_wrong_types` decorates), or a parameter of a solver, ``aco(argument)``
"""

from __future__ import annotations

_ONE_PROCESS = "a recording is tracked by one process, which takes about 0.3 hours for a day of 26 million plots"
_NOT_TOLD = "identities are evidence (identity=IdentityParameters()); those that do not fit are not told by name"
_LOSS = "associate twice, with gate_probability 0.999 and 1, and compare costs"
_HULLS = "tracks are one ship if they keep their distance along its course, whatever its length"

_STANDARD = "Marginals.error is the standard error, 0 where Marginals.exact"

REMOVED: dict[str, str] = {
    "assoc.integrations.stonesoup.AssocTracker": "make a scene by scene_from_detections, track it by assoc.tracking",
    "assoc.integrations.stonesoup.TrackFusionTracker": "use assoc.tracking.fusion.TrackFusion on the tracks' states",
    "assoc.integrations.stonesoup.RegistrationFeeder": "make a scene by scene_from_detections, for assoc.registration",
    "Tracker.odd_identities": _NOT_TOLD,
    "LatePlots.odd_identities": _NOT_TOLD,
    "Health.identities": _NOT_TOLD,
    "MovingTargets(length)": _HULLS,
    "MovingTargets(together)": _HULLS,
    "--tiles": "scans are solved in one piece, 10 million tuples in seconds",
    "--gate-loss": "solve twice, with --gate-probability 0.999 and 1, and compare costs",
    "associate(gate_loss)": _LOSS,
    "--lines": "use --json, or --csv for a row a scan",
    "--slice": _ONE_PROCESS,
    "assoc.metrics.rmse": "numpy.sqrt(((truth - estimates) ** 2).sum(axis=1).mean())",
    "assoc.recordings.autoferry": "experiments/real/ferry_files.py reads these files",
    "assoc.integrations.motile": "assoc.link follows particles, also those that divide or merge, with a proved optimum",
    "assoc.filters.FunctionMotion": "write a class of assoc.filters.Motion",
    "assoc.metrics.association_accuracy": "see Association.summary, or hota and identity of tracks",
    "assoc.metrics.AssociationAccuracy": "see Association.summary, or hota and identity of tracks",
    "assoc.recordings.fixed_groups": "use irregular_groups, or clustering_time_window with a rotation",
    "assoc.recordings.groups_of_sizes": "use irregular_groups, or clustering_time_window with a rotation",
    "assoc.plotting.plot_costs": "draw problem.costs with matplotlib; solution.indices are the chosen ones",
    "assoc.plotting.plot_gates": "assoc inspect says whether noise and model are right",
    "plot_scene(gates)": "assoc inspect says whether noise and model are right",
    "assoc.plotting.plot_heat_map": "write --heatmap FILE.png or --report FILE.html of assoc sweep",
    "assoc.plotting.plot_metric": "draw the values over the times with matplotlib",
    "assoc.plotting.plot_overview": "call plot_scene, plot_solution and plot_convergence",
    "assoc.plotting.plot_residuals": "write_registration_report draws them; they are in Registration.residuals",
    "--random": "give values in --grid, or search with --tune",
    "assoc.sweeps.random_settings": "draw parameters with numpy, and make a Setting of each",
    "assoc.sweeps.settings_from": "call grid for each table",
    "--registration online": "trackers find biases by themselves while they track (--no-adapt switches that off)",
    "assoc.registration.OnlineRegistration": "trackers find biases by themselves while they track, with adapt=True",
    "Tracker.registration": "see Tracker.health, which tells the biases that measurements are corrected for",
    "register(drift)": "trackers follow biases that drift by themselves, with adapt=True",
    "assoc.track --jobs": _ONE_PROCESS,
    "assoc.track --scheduler": _ONE_PROCESS,
    "assoc.sweep --plot": "write --heatmap FILE.png --convergence FILE.png",
    "--all-sensors": "joint-probabilistic takes one sensor after the other; multi-sensor takes all at once",
    "aco(nodes)": 'use tuples, "useful" or "all"; nodes are those of branch and bound',
    "marginals(k)": "nothing is listed; probabilities are exact sums or sampled, and say their error",
    "marginals(method)": "sums where these are short, else samples; see Marginals.exact and Marginals.error",
    "Marginals.lower": _STANDARD,
    "Marginals.upper": _STANDARD,
    "Marginals.unseen": _STANDARD,
    "Marginals.listed": "nothing is listed; Marginals.exact says what is summed",
}
"""By old spelling, the sentence that says what to use instead."""


def removed(spelling: str) -> str:
    """Return the line for something that existed once; empty for all else."""
    sentence = REMOVED.get(spelling)
    return f"{spelling} exists no longer: {sentence}" if sentence else ""

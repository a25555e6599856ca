"""Control of a drive along a reference: tune a law from the description, run it on the drive, score it, compare laws.

A law has a key of the core as its name (`pneudrive.control.laws`). Its gains are derived from its model of the drive::

    drive = pn.Circuit.load("axis.toml")
    run = pn.control.run(drive, law="nmpc", reference="sine 60 mm 0.5 Hz around 250 mm", setup="real", seed=1)
    run.attrs["score"]["max_error_m"]

All results are simulated: no law has run on a machine.
"""

from __future__ import annotations

from pneudrive.lazy_names import lazily

with lazily(__name__):
    from pneudrive.control.benchmarks import ControlComparison, benchmark, read_comparison, standard
    from pneudrive.control.demand import Feasibility, Suitability, feasibility, suitability
    from pneudrive.control.loop import run
    from pneudrive.control.mismatch import Mismatch, read_mismatch, ready_mismatches
    from pneudrive.control.motion import Reference
    from pneudrive.control.own_law import signals
    from pneudrive.control.pose import PosePath, PoseScore, pose_path, run_pose
    from pneudrive.control.references import reference
    from pneudrive.control.scores import Score, score
    from pneudrive.control.setup import Setup, read_setup
    from pneudrive.control.source_code import export
    from pneudrive.control.tuning import Controller, LawModel, Plant, TunedGain, Tuning, laws, tune

__all__ = [
    "ControlComparison",
    "Controller",
    "Feasibility",
    "LawModel",
    "Mismatch",
    "Plant",
    "PosePath",
    "PoseScore",
    "Reference",
    "Score",
    "Setup",
    "Suitability",
    "TunedGain",
    "Tuning",
    "benchmark",
    "export",
    "feasibility",
    "laws",
    "pose_path",
    "read_comparison",
    "read_mismatch",
    "read_setup",
    "ready_mismatches",
    "reference",
    "run",
    "run_pose",
    "score",
    "signals",
    "standard",
    "suitability",
    "tune",
]

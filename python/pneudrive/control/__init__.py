"""Control of a drive along a reference: tune controllers from its description, simulate, score and compare them.

`pneudrive.control.laws` lists the controllers, also called laws. Their gains follow from a model of the drive::

    drive = pn.Circuit.load("axis.toml")
    run = pn.control.run(drive, law="nmpc", reference="sine 60 mm 0.5 Hz around 250 mm", setup="real", seed=1)
    run.attrs["score"]["max_error_m"]

All results are simulated. No controller has run on a machine.
"""

from __future__ import annotations

from pneudrive.lazy_names import lazily

with lazily(__name__):
    from pneudrive.control.benchmarks import ControlComparison as ControlComparison
    from pneudrive.control.benchmarks import benchmark as benchmark
    from pneudrive.control.benchmarks import read_comparison as read_comparison
    from pneudrive.control.benchmarks import standard as standard
    from pneudrive.control.loop import feasibility as feasibility
    from pneudrive.control.loop import run as run
    from pneudrive.control.loop import suitability as suitability
    from pneudrive.control.mismatch import Mismatch as Mismatch
    from pneudrive.control.mismatch import read_mismatch as read_mismatch
    from pneudrive.control.mismatch import ready_mismatches as ready_mismatches
    from pneudrive.control.motion import Reference as Reference
    from pneudrive.control.motion import reference as reference
    from pneudrive.control.own_law import signals as signals
    from pneudrive.control.pose.legs import run_pose as run_pose
    from pneudrive.control.pose.path import PoseScore as PoseScore
    from pneudrive.control.pose.path import pose_path as pose_path
    from pneudrive.control.scores import Score as Score
    from pneudrive.control.scores import score as score
    from pneudrive.control.setup import Setup as Setup
    from pneudrive.control.setup import read_setup as read_setup
    from pneudrive.control.source_code import export as export
    from pneudrive.control.tuning import Controller as Controller
    from pneudrive.control.tuning import Tuning as Tuning
    from pneudrive.control.tuning import laws as laws
    from pneudrive.control.tuning import tune as tune

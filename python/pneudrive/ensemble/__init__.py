"""Ensembles: many variants of one drive, with designs, outputs of each run, and sensitivities."""

from __future__ import annotations

from pneudrive.lazy_names import lazily

with lazily(__name__):
    from pneudrive.ensemble.design import EnsembleDesign as EnsembleDesign
    from pneudrive.ensemble.design import Lognormal as Lognormal
    from pneudrive.ensemble.design import Normal as Normal
    from pneudrive.ensemble.design import Triangular as Triangular
    from pneudrive.ensemble.design import Uniform as Uniform
    from pneudrive.ensemble.many import DaskExecutor as DaskExecutor
    from pneudrive.ensemble.many import Executor as Executor
    from pneudrive.ensemble.outputs import Output as Output
    from pneudrive.ensemble.outputs import own as own

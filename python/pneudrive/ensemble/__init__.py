"""Ensembles: many variants of one drive, with designs, outputs of each run, and sensitivities."""

from __future__ import annotations

from pneudrive.lazy_names import lazily

with lazily(__name__):
    from pneudrive.ensemble.design import EnsembleDesign as EnsembleDesign
    from pneudrive.ensemble.design import Lognormal as Lognormal
    from pneudrive.ensemble.design import Normal as Normal
    from pneudrive.ensemble.design import Triangular as Triangular
    from pneudrive.ensemble.design import Uniform as Uniform
    from pneudrive.ensemble.design import grid as grid
    from pneudrive.ensemble.many import DaskExecutor as DaskExecutor
    from pneudrive.ensemble.many import Executor as Executor
    from pneudrive.ensemble.many import InProcess as InProcess
    from pneudrive.ensemble.many import simulate_many as simulate_many
    from pneudrive.ensemble.outputs import Output as Output
    from pneudrive.ensemble.outputs import final as final
    from pneudrive.ensemble.outputs import integral as integral
    from pneudrive.ensemble.outputs import largest as largest
    from pneudrive.ensemble.outputs import mean as mean
    from pneudrive.ensemble.outputs import own as own
    from pneudrive.ensemble.outputs import samples as samples
    from pneudrive.ensemble.outputs import settling as settling
    from pneudrive.ensemble.outputs import smallest as smallest
    from pneudrive.ensemble.outputs import time_when as time_when
    from pneudrive.ensemble.sensitivity import sensitivity as sensitivity

"""Simulate pneumatic piston drives and characterise their friction from recordings, with uncertainty.

>>> import pneudrive as pn
>>> drive = pn.Drive.load("catalogue:reference")
>>> run = pn.simulate(drive, command=[(0.0, 0.6)], duration="0.1 s")
>>> run.position.attrs["units"]
'm'
"""

from __future__ import annotations

import sys
from types import ModuleType

from pneudrive.lazy_names import lazily
from pneudrive.processor import require as require_processor

__version__ = "0.1.0"

require_processor()

# Imported at first use: `import pneudrive` stays fast.
with lazily(__name__) as _HOME:
    from pneudrive import control as control
    from pneudrive import ensemble as ensemble
    from pneudrive import errors as errors
    from pneudrive import mujoco as mujoco
    from pneudrive import report as report
    from pneudrive import units as units
    from pneudrive.datasheet.characteristics.air import energy_balance as energy_balance
    from pneudrive.datasheet.characteristics.frequency import lines as lines
    from pneudrive.datasheet.equilibrium import equilibrium as equilibrium
    from pneudrive.datasheet.equilibrium import linearise as linearise
    from pneudrive.datasheet.registry import drive_characteristic as drive_characteristic
    from pneudrive.describe import Circuit as Circuit
    from pneudrive.describe import Drive as Drive
    from pneudrive.describe import FrictionLaw as FrictionLaw
    from pneudrive.describe.files.catalogue import catalogue_folders as catalogue_folders
    from pneudrive.describe.tables.dependences import SealPressure as SealPressure
    from pneudrive.describe.tables.friction import Friction as Friction
    from pneudrive.describe.tables.parts import Ambient as Ambient
    from pneudrive.describe.tables.parts import Cylinder as Cylinder
    from pneudrive.describe.tables.parts import EndStop as EndStop
    from pneudrive.describe.tables.parts import Gas as Gas
    from pneudrive.describe.tables.parts import Initial as Initial
    from pneudrive.describe.tables.parts import Load as Load
    from pneudrive.describe.tables.parts import Spring as Spring
    from pneudrive.describe.tables.parts import Supply as Supply
    from pneudrive.describe.tables.parts import Valve as Valve
    from pneudrive.describe.tank import Tank as Tank
    from pneudrive.ensemble.design import EnsembleDesign as EnsembleDesign
    from pneudrive.ensemble.design import grid as grid
    from pneudrive.ensemble.many import simulate_many as simulate_many
    from pneudrive.ensemble.sensitivity import sensitivity as sensitivity
    from pneudrive.errors import PneudriveError as PneudriveError
    from pneudrive.explore import explore as explore
    from pneudrive.fmu.package import export_c as export_c
    from pneudrive.fmu.package import export_fmu as export_fmu
    from pneudrive.friction.campaign.characteristics import campaign_friction as campaign_friction
    from pneudrive.friction.campaign.characteristics import characterise as characterise
    from pneudrive.friction.campaign.compare import compare_campaigns as compare_campaigns
    from pneudrive.gradients.differentiable import Differentiable as Differentiable
    from pneudrive.identify import fit_any_law as fit_any_law
    from pneudrive.identify import fit_friction as fit_friction
    from pneudrive.identify.design import next_measurements as next_measurements
    from pneudrive.identify.design import select_friction_law as select_friction_law
    from pneudrive.identify.dynamic import Sensor as Sensor
    from pneudrive.identify.dynamic import identify as identify
    from pneudrive.identify.dynamic import identify_presliding as identify_presliding
    from pneudrive.identify.follow.fit import identify_motion as identify_motion
    from pneudrive.identify.static.survey import survey as survey
    from pneudrive.identify.volume import identify_regulator as identify_regulator
    from pneudrive.identify.volume import identify_volume as identify_volume
    from pneudrive.platforms import platform as platform
    from pneudrive.results import compare_results as compare_results
    from pneudrive.results import load as load
    from pneudrive.simulation.simulate import citations as citations
    from pneudrive.simulation.simulate import simulate as simulate
    from pneudrive.simulation.trajectory import save as save
    from pneudrive.sizing.search import size as size
    from pneudrive.validate import validate as validate
    from pneudrive.validate.motion import validate_motion as validate_motion

_SUBMODULES = ("control", "ensemble", "mujoco", "report", "rig", "errors", "units")

__all__ = ["__version__", *sorted(_HOME), *_SUBMODULES]  # noqa: PLE0604 # pyright: ignore[reportUnsupportedDunderAll]


def __dir__() -> list[str]:
    return sorted(__all__)


class _Package(ModuleType):
    """Package whose public functions take precedence over modules of the same name.

    Importing ``pneudrive.simulate`` would otherwise bind the module to ``pn.simulate``, and ``pn.simulate(...)``
    would work or fail depending on earlier imports.
    """

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _HOME and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package

"""From friction maps to parameters with uncertainty."""

from __future__ import annotations

from pneudrive.identify.diagnose import Undetermined
from pneudrive.identify.fit import fit_directions, fit_friction
from pneudrive.identify.result import FrictionFit, Prediction

__all__ = ["FrictionFit", "Prediction", "Undetermined", "fit_directions", "fit_friction"]

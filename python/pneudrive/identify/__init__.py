"""Fits of friction maps, drives and tanks: parameters with uncertainty."""

from __future__ import annotations

from pneudrive.identify.determined import Undetermined
from pneudrive.identify.static.any_law import fit_any_law
from pneudrive.identify.static.fit import fit_directions, fit_friction
from pneudrive.identify.static.law_fit import LawFit
from pneudrive.identify.static.result import FrictionFit, Prediction

__all__ = ["FrictionFit", "LawFit", "Prediction", "Undetermined", "fit_any_law", "fit_directions", "fit_friction"]

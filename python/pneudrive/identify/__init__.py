"""Fits of friction maps, drives and tanks: parameters with uncertainty."""

from __future__ import annotations

from pneudrive.identify.base import Undetermined
from pneudrive.identify.static.fit import fit_any_law, fit_friction
from pneudrive.identify.static.result import FrictionFit, LawFit, Prediction

__all__ = ["FrictionFit", "LawFit", "Prediction", "Undetermined", "fit_any_law", "fit_friction"]

"""Identification of parameters of a drive from recordings of its motion, with uncertainty."""

from __future__ import annotations

from pneudrive.identify.dynamic.fit import identify, identify_presliding
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.identify.dynamic.sensors import Sensor

__all__ = ["DriveFit", "Sensor", "identify", "identify_presliding"]

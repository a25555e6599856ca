"""Friction parameters in the form of other tools' laws, with what the conversion costs.

A conversion is a least-squares fit of the other tool's curve to ours over the measured speeds; its greatest deviation
is stated, and so is what the other law cannot say.
"""

from __future__ import annotations

from pneudrive.identify.export.convert import TOOLS, Exported, check_tool, export
from pneudrive.identify.files import read_source
from pneudrive.identify.friction_curve import SlidingCurve as Curve
from pneudrive.identify.friction_curve import curve_of_drive, curve_of_fit

__all__ = ["TOOLS", "Curve", "Exported", "check_tool", "curve_of_drive", "curve_of_fit", "export", "read_source"]

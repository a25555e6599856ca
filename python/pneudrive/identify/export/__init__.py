"""Export of friction parameters to the laws of other tools, with the error of the conversion.

A conversion is a least-squares fit of the other tool's curve to that of pneudrive over the measured speeds. The result
states the largest deviation and the effects that the other law does not have.
"""

from __future__ import annotations

from pneudrive.identify.export.convert import TOOLS, Exported, check_tool, export
from pneudrive.identify.files import read_source
from pneudrive.identify.static.friction_curve import SlidingCurve as Curve
from pneudrive.identify.static.friction_curve import curve_of_drive, curve_of_fit

__all__ = ["TOOLS", "Curve", "Exported", "check_tool", "curve_of_drive", "curve_of_fit", "export", "read_source"]

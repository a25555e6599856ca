"""Dependence of a motion on the pressure ratio above which the valve's flow is linear.

This ratio is part of the model.
"""

import warnings

import numpy as np
import xarray as xr

import pneudrive as pn

# The reference drive's friction is not passive, as that of many fitted sets; it does not matter here.
warnings.simplefilter("ignore", pn.errors.PneudriveWarning)

COMMON = 0.999
drive = pn.Drive.load("catalogue:reference")
b = drive.valve.critical_pressure_ratio


def motion(linear_above: float) -> xr.Dataset:
    """Full strokes of the reference drive, one second each way."""
    tables = drive.to_dict()
    tables["valve"]["linear_above"] = linear_above
    initial = pn.Initial(position="50 mm", pressure_a="3 bar abs", pressure_b="3 bar abs")
    return pn.simulate(pn.Drive(**tables), "0 s: 0.6, 1 s: -0.6", "2 s", initial=initial, rtol=1e-9)


usual = motion(COMMON)
print("| `linear_above` | slope of the chord | largest shift of position, µm | of pressure a, Pa |")
print("| ---: | ---: | ---: | ---: |")
for ratio in (0.99, 0.995, COMMON, 0.9999, 0.99999):
    slope = np.sqrt(1.0 - ((ratio - b) / (1.0 - b)) ** 2) / (1.0 - ratio)
    run = motion(ratio)
    shift = 1e6 * np.abs(run.position - usual.position).max()
    pressure = np.abs(run.pressure_a - usual.pressure_a).max()
    print(f"| {ratio:g} | {slope:.3g} | {float(shift):.0f} | {float(pressure):.0f} |")

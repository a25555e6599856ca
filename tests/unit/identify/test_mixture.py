"""What is applied beside start values: the fit says how far off a run of that mixture is, as a new run finds it too."""

import re

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import PneudriveWarning
from pneudrive.identify.files import read_fit

pytestmark = pytest.mark.filterwarnings("ignore::pneudrive.errors.PneudriveWarning")
COMMAND, DURATION, START = "0 s: 0.3, 0.15 s: -0.4", "0.3 s", "position = 200 mm, pressure_a = 3 bar abs"


def test_values_that_only_their_sum_determines_are_kept_with_the_error_of_the_mixture(tmp_path):
    truth = pn.Drive.load("catalogue:reference").replace({"load.mass": "5 kg"})
    run = pn.simulate(truth, COMMAND, DURATION, initial=START)
    start = truth.replace({"load.mass": "8 kg", "cylinder.moving_mass": "3 kg", "valve.conductance": "2.5 dm3/(s bar)"})
    fit = pn.identify(start, run, ["load.mass", "cylinder.moving_mass", "valve.conductance"])
    assert {u.parameter for u in fit.undetermined} == {"load.mass", "cylinder.moving_mass"}
    assert fit.values["valve.conductance"] == pytest.approx(truth.valve.conductance_m3_s_pa, rel=1e-4)
    words = "apply keeps the start value of load.mass, cylinder.moving_mass in addition to the fitted values"
    with pytest.warns(PneudriveWarning, match=words) as said:
        mixed = fit.apply()
    again = pn.simulate(mixed, COMMAND, DURATION, initial=START)
    (note,) = [str(w.message) for w in said if str(w.message).startswith(words)]
    off_m = float(np.sqrt(np.mean((again.position - run.position).to_numpy() ** 2)))
    stated_mm, fitted_mm = map(float, re.findall(r"([0-9.e-]+) mm", note))
    assert stated_mm == pytest.approx(1e3 * off_m, rel=0.02)
    assert stated_mm > 1.0 > 100.0 * fitted_mm
    fit.to_toml(tmp_path / "fit.toml")
    with pytest.warns(PneudriveWarning, match=words):
        read_fit(tmp_path / "fit.toml").apply()
    with pytest.warns(PneudriveWarning, match="combined with values outside the fit: run `pneudrive validate`"):
        read_fit(tmp_path / "fit.toml").apply(start.replace({"load.mass": "4 kg"}))

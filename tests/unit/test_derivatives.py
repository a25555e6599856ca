"""Derivatives of a run by numbers of the drive against differences of runs."""

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import CommandError
from pneudrive.free.parameters import Differentiator

REFERENCE = pn.Drive.load("catalogue:reference")
WARM = REFERENCE.replace({"friction.temperature": {"reference": "0 degC", "viscous": "1 %/K", "levels": "-0.5 %/K"}})
STICKING = REFERENCE.replace(
    {
        "friction": {
            "law": "stribeck",
            "coulomb": "30 N",
            "breakaway": "45 N",
            "viscous": "40 N s/m",
            "stribeck_velocity": "20 mm/s",
        }
    }
)
#: Heat transfer by its law.
_TABLES = REFERENCE.to_dict()
_TABLES["cylinder"] = {key: value for key, value in _TABLES["cylinder"].items() if key != "heat_transfer"}
LAW = pn.Drive.model_validate(_TABLES).replace({"cylinder.port_diameter": "6 mm"})
COLUMNS = ["position_m", "velocity_m_s", "pressure_a_pa"]


def differences(of: Differentiator, values, times, step):
    """Differences of fourth order, shape (n, c, p)."""
    out = []
    for k, value in enumerate(values):
        ends = []
        for share in (1.0, -1.0, 2.0, -2.0):
            moved = np.array(values)
            moved[k] += share * step * value
            ends.append(of.run(moved, times, COLUMNS, derivatives=False)[0])
        out.append((8.0 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12.0 * step * value))
    return np.stack(out, axis=2)


@pytest.mark.parametrize(
    ("drive", "command", "until", "names", "step"),
    [
        # before the first impact, which washes out derivatives of pressure and velocity at a given time
        (REFERENCE, "0.6", 0.15, ["friction.coulomb", "cylinder.bore", "supply.pressure", "valve.conductance"], 1e-3),
        (WARM, "0.6", 0.15, [f"friction.temperature.{key}" for key in ("viscous", "levels")], 1e-3),
        (LAW, "0.6", 0.15, [f"cylinder.{key}" for key in ("heat_transfer_scale", "port_diameter", "bore")], 1e-3),
        # breaks away, sticks, breaks away, sticks: derivatives jump there, and a large step moves a sample over it
        (STICKING, "0.003", 1.5, ["friction.coulomb", "friction.breakaway", "cylinder.bore"], 1e-5),
    ],
    ids=["stroke", "temperature", "heat", "stick-slip"],
)
def test_derivatives_are_those_of_the_runs(drive, command, until, names, step):
    of = Differentiator(drive, names, command, {"position": "50 mm"}, rtol=1e-12)
    values = [one.value for one in of.parameters]
    times = np.linspace(0.0, until, 151)
    found, derivatives = of.run(values, times, COLUMNS)
    wanted = differences(of, values, times, step)
    scale = np.abs(wanted).max(axis=0)
    if drive is STICKING:
        assert np.count_nonzero(np.diff(found[:, 1] != 0.0)) == 4
    assert (scale > 0.0).all()
    assert (np.abs(derivatives - wanted) <= 1e-6 * scale).all()


@pytest.mark.filterwarnings("ignore")
def test_a_run_carries_its_derivatives_beside_the_same_trajectory():
    command = "0 s: 0.6, 0.1 s: -0.6"
    plain = pn.simulate(REFERENCE, command, "0.2 s", sample_rate="100 Hz")
    run = pn.simulate(REFERENCE, command, "0.2 s", sample_rate="100 Hz", sensitivities=["friction.coulomb"])
    assert plain.equals(run[list(plain)].drop_vars(["parameter", "parameter_units"], errors="ignore"))
    assert run.sensitivity_position.sel(parameter="friction.coulomb").attrs["units"] == "m per unit of the parameter"
    assert run.parameter_units.item() == "N"
    assert run.sensitivity_position.dims == ("parameter", "time")
    assert run.sensitivity_position.min() < 0.0  # more friction, less way


def test_what_cannot_be_differentiated_is_said():
    with pytest.raises(CommandError, match="not a number of this drive"):
        Differentiator(REFERENCE, ["friction.coulom"], "0.6")
    with pytest.raises(CommandError, match="known in advance"):
        Differentiator(REFERENCE, ["friction.coulomb"], lambda _t: 0.5)
    with pytest.raises(CommandError, match="not a number of this circuit"):
        Differentiator(pn.Circuit.load("examples/two_cylinders.toml"), ["left.bor"], {"valve_l": 0.6})

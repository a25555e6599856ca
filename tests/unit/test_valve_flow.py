"""The size of a valve in four ways: against printed pairs of a catalogue, which no formula here was fitted to."""

import re

import pytest

from pneudrive.describe import Valve
from pneudrive.describe.files.schema import drive_schema
from pneudrive.describe.tables.valve_flow import KV_PER_CV, conductance_from_kv

# series: C dm3/(s bar), b, Cv, nominal flow l/min ANR [smc-eus11-83]
SY = {
    "SY3000": (1.1, 0.28, 0.29, 276),
    "SY5000": (2.8, 0.37, 0.90, 746),
    "SY7000": (4.5, 0.28, 1.4, 1130),
    "SY9000": (10, 0.29, 2.5, 2527),
}


def valve(**size):
    return Valve(kind="proportional-5/3", **size).conductance_m3_s_pa


@pytest.mark.parametrize(("c", "b", "cv", "flow"), SY.values(), ids=SY)
def test_printed_pairs(c, b, cv, flow):
    assert valve(conductance=f"{c} dm3/(s bar)", critical_pressure_ratio=b) == pytest.approx(c * 1e-8)
    assert valve(nominal_flow=f"{flow} l/min ANR", critical_pressure_ratio=b) == pytest.approx(c * 1e-8, rel=2e-3)
    assert valve(cv=cv, critical_pressure_ratio=b) == pytest.approx(c * 1e-8, rel=0.19)


def test_kv_and_cv_are_one_thing_in_two_units():
    assert pytest.approx(0.865, abs=5e-4) == KV_PER_CV
    assert valve(cv=1.0, critical_pressure_ratio=0.3) == valve(kv=KV_PER_CV, critical_pressure_ratio=0.3)
    assert valve(kv="2 Kv", critical_pressure_ratio=0.3) == conductance_from_kv(2.0)


@pytest.mark.parametrize(("key", "own", "other"), [("kv", "0.3 m3/h", "0.3 Cv"), ("cv", "0.3 Cv", "0.3 Kv")])
def test_the_schema_takes_what_the_file_takes(key, own, other):
    number, text = drive_schema()["$defs"]["Valve"]["properties"][key]["anyOf"]
    assert number == {"type": "number", "exclusiveMinimum": 0.0}
    assert re.search(text["pattern"], own)
    assert not re.search(text["pattern"], other)
    assert valve(**{key: own}, critical_pressure_ratio=0.3) == valve(**{key: 0.3}, critical_pressure_ratio=0.3)

"""Quantities become SI once: exactly, or with one message that says what is wrong."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pneudrive import units
from pneudrive.errors import DescriptionError


def test_the_table_agrees_with_pint():
    for unit, (si_unit, factor, offset) in units.TABLE.items():
        by_pint = units.converter_of_pint(unit, si_unit)
        assert by_pint == pytest.approx((factor, offset), rel=1e-12, abs=1e-9 if offset else 0.0), unit


@pytest.mark.parametrize(
    ("text", "si_unit", "value"),
    [
        ("25.7 mm", "m", 0.0257),
        ("20 degC", "K", 293.15),
        ("-5 °C", "K", 268.15),
        ("1.1 dm3/(s bar)", "m^3/(s Pa)", 1.1e-8),
        ("700 l/min ANR", "m^3/s ANR", 700e-3 / 60),
        ("42 m3/h (ANR)", "m^3/s ANR", 42 / 3600),
        ("1.5 N/bar", "N/Pa", 1.5e-5),
        ("1e5N/m", "N/m", 1e5),
        ("2 N·s/mm", "N s/m", 2000.0),
        ("3 ft", "m", 0.9144),  # by pint
        ("2 km/h", "m/s", 2 / 3.6),
    ],
)
def test_values(text, si_unit, value):
    assert units.parse(text, si_unit) == pytest.approx(value, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "si_unit"), [("10 Hz", "rad/s"), ("1 kHz", "rad/s"), ("10 rad/s", "1/s"), ("60 rpm", "1/s")]
)
def test_cycles_and_angles_are_not_mixed(text, si_unit):
    with pytest.raises(DescriptionError, match="2 pi"):
        units.parse(text, si_unit)
    assert units.parse("360 deg/s", "rad/s") == pytest.approx(units.parse("60 rpm", "rad/s"))
    assert units.parse("90 1/s", "rad/s") == 90.0


def test_decimal_units_round_once():
    # a product of floats gives 101299.99999999999
    assert units.parse_pressure("1.013 bar abs") == units.Pressure(101300.0, gauge=False)


def test_gauge_counts_from_ambient():
    for text, absolute in (("6 bar gauge", 7e5), ("6 barg", 7e5), ("6 bar abs", 6e5), ("6 bara", 6e5)):
        assert units.parse_pressure(text).absolute_pa(1e5) == absolute, text
    assert units.parse_pressure("6 barg").absolute_pa(101_325.0) == 701_325.0


@given(st.floats(min_value=-1e12, max_value=1e12))
def test_written_values_read_back_to_the_same_bits(value):
    for si_unit, unit in [("m", "mm"), ("Pa", "bar"), ("m^3/(s Pa)", "dm3/(s bar)"), ("rad", "deg"), ("K", "degC")]:
        assert units.parse(units.write(value, si_unit, unit), si_unit) == value


@pytest.mark.parametrize(
    ("text", "si_unit", "message"),
    [
        ("25", "m", '"25" has no unit'),
        ("", "m", "is not a quantity"),
        ("25 bar", "m", 'unit "bar" is a pressure'),
        ("25 N m", "N", r'unit "N m" is of dimension \[mass\]'),
        ("25 smoots", "m", 'unit "smoots" is not known'),
        ("2,5 mm", "m", "Use a decimal point"),
        ("nan mm", "m", "is not finite"),
        ("1e999 mm", "m", "is not finite"),
        ("700 l/min", "m^3/s ANR", "does not state the reference pressure and temperature"),
        ("700 Nl/min", "m^3/s ANR", "does not state the reference pressure and temperature"),
    ],
)
def test_refusals(text, si_unit, message):
    with pytest.raises(DescriptionError, match=message):
        units.parse(text, si_unit)


def test_a_pressure_says_against_what():
    with pytest.raises(DescriptionError, match=r'Write "3 bar abs" or "3 bar gauge"'):
        units.parse_pressure("3 bar")


def test_ranges():
    assert units.parse_range("5 mm .. 30 mm", "m") == (0.005, 0.03)
    with pytest.raises(DescriptionError, match="is empty"):
        units.parse_range("30 mm .. 5 mm", "m")


@pytest.mark.parametrize("text", ["10700 Pa abs", "40 psi gauge", "6 barg", "90 psia"])
def test_a_difference_of_pressures_has_its_own_rule(text):
    with pytest.raises(DescriptionError, match="is a pressure, not a difference") as told:
        units.parse(text, "Pa")
    assert 'without abs or gauge, e.g. "0.3 bar"' in told.value.rule
    with pytest.raises(DescriptionError, match='"s" is a time') as told:
        units.parse_pressure("3 s abs")
    assert told.value.rule == 'a pressure is needed, e.g. "7 bar abs" or "95 psi gauge"'

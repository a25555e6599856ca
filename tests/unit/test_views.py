"""One form for terminal, notebook, report and page: what a reader sees of values and curves, in usual units."""

import numpy as np
import pytest

from pneudrive.views import ShownCurve, ShownValue, View


def test_a_table_has_a_row_for_each_label_and_names_a_common_unit_once():
    view = View(
        "two recordings",
        (
            ShownValue("1.v", "one", "speed", 0.0132, "m/s"),
            ShownValue("1.f", "one", "friction", 9.79, "N", (9.30, 10.28)),
            ShownValue("2.f", "two", "friction", -0.0001, "N", (-0.064, 0.064)),
            ShownValue("2.e", "two", "friction per pressure", float("nan"), "N/Pa"),
        ),
    )
    head, rows = view.table()
    assert head == ("", "speed mm/s", "friction N", "friction per pressure N/bar")
    assert rows == [("one", "13.2", "9.79 ± 0.49", ""), ("two", "", "0.000 ± 0.064", "")]
    assert "9.79 ± 0.49" in view.card().rows[0]


def test_a_column_of_several_units_names_each():
    values = (("drift", 0.2, "N/h"), ("slope", 2e-5, "N/Pa"))
    view = View("effects", tuple(ShownValue(n, n, "value", v, u, (0.5 * v, 1.5 * v)) for n, v, u in values))
    assert view.table()[1] == [("drift", "0.20 ± 0.10 N/h"), ("slope", "2.0 ± 1.0 N/bar")]


def test_the_band_of_a_curve_is_that_at_its_measured_points():
    speed, friction = np.array([0.01, 0.02, 0.1]), np.array([30.0, 20.0, 25.0])
    reach = np.array([1.0, 50.0, 3.0])  # wide between the measured points
    curve = ShownCurve(
        *("key", "1 bar", speed, friction, "speed", "friction", "m/s", "N", (friction - reach, friction + reach)),
        measured=np.array([True, False, True]),
    )
    assert curve.half_band == pytest.approx(2.0)
    head, rows = View("a campaign", curves=(curve,)).curve_table()
    assert head == ("curve", "points", "speed mm/s", "friction N", "95 % band")
    assert rows == [("1 bar", "2", "10 .. 100", "20.00 .. 30.00", "± 2")]

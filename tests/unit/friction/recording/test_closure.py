"""Half the sum of both directions against pressure gives effective area and force zero."""

from dataclasses import replace

import numpy as np
import pytest

from pneudrive.characterise import characterise_recordings


def test_area_error_and_force_zero_are_found(make):
    recordings = [
        make(friction=4.0 + p / 1e5, gauge_b=p, swing=0.04e5, area_error=0.02, zero=1.0, seed=i, name=f"{p:g}",
             stroke_spread=0.1, labels={"seal": "lip"})
        for i, p in enumerate((1e5, 2e5, 3e5, 5e5, 7e5))
    ]  # fmt: skip
    (fit,) = characterise_recordings(recordings).closures
    area = fit.areas_m2["b"]
    truth = 1.02 * fit.nominal_m2["b"]
    assert area.value == pytest.approx(truth, rel=0.005)
    assert area.low <= truth <= area.high
    assert area.low > fit.nominal_m2["b"], "an error of 2 % is seen"
    assert fit.force_zero_n.value == pytest.approx(1.0, abs=0.2)
    assert fit.force_zero_n.low <= 1.0 <= fit.force_zero_n.high
    assert fit.group == "lip"
    assert "not separable" in fit.statement


def test_area_of_chamber_a_has_its_own_sign(make):
    recordings = []
    for i, gauge in enumerate((1e5, 3e5, 5e5)):
        made = make(gauge_b=gauge, seed=i, name=f"{gauge:g}")
        push = (made.pressure_b_pa - 101325.0) * made.area_b_m2
        recordings.append(
            replace(
                made,
                pressure_a_pa=made.pressure_b_pa,
                pressure_b_pa=made.pressure_a_pa,
                force_n=made.force_n - push - 1.01 * push,
            )
        )
    (fit,) = characterise_recordings(recordings).closures
    assert list(fit.areas_m2) == ["a"]
    assert fit.areas_m2["a"].value == pytest.approx(1.01 * fit.nominal_m2["a"], rel=0.002)


def test_a_pressure_in_the_wrong_chamber_is_noticed(make):
    made = [make(gauge_b=p, seed=i, name=f"{p:g}") for i, p in enumerate((1e5, 3e5, 5e5))]
    swapped = [replace(r, pressure_a_pa=r.pressure_b_pa, pressure_b_pa=r.pressure_a_pa) for r in made]
    assert "probably wrong in the layout" in characterise_recordings(swapped).closures[0].statement
    assert "probably wrong" not in characterise_recordings(made).closures[0].statement


def test_one_pressure_says_nothing_about_the_area(make):
    found = characterise_recordings([make(seed=1), make(seed=2, name="b")])
    assert found.closures == ()
    assert any("cannot be determined" in note for note in found.notes)


def test_two_points_have_no_interval(make):
    (fit,) = characterise_recordings([make(gauge_b=1e5), make(gauge_b=5e5, name="b")]).closures
    assert fit.degrees_of_freedom == 0
    assert fit.areas_m2["b"].high == float("inf")
    assert "no interval" in fit.statement


def both(make, pairs, area_b=1.0, sensor=0.0):
    """Make recordings with gauge pressures (a, b); the true areas are 1.02 times what the recording says.

    ``sensor`` is the standard deviation of each recording's error of pressure, Pa.
    """
    recordings = []
    for i, (a, b) in enumerate(pairs):
        error = np.random.default_rng(i).normal(0.0, sensor, 2)
        made = make(gauge_b=0.0, seed=i, name=f"{a:g}/{b:g}")
        area_a, area_b_m2 = made.area_a_m2, made.area_b_m2 * area_b
        recordings.append(
            replace(
                made,
                pressure_a_pa=made.pressure_a_pa + a + error[0],
                pressure_b_pa=made.pressure_b_pa + b + error[1],
                area_b_m2=area_b_m2,
                force_n=made.force_n + 1.0 + 1.02 * (b * area_b_m2 - a * area_a),
            )
        )
    return characterise_recordings(recordings)


def test_both_areas_are_found_where_the_pressures_change_apart(make):
    (fit,) = both(make, [(0, 0), (2e5, 0), (0, 2e5), (4e5, 1e5), (1e5, 4e5)]).closures
    for side in ("a", "b"):
        assert fit.areas_m2[side].value == pytest.approx(1.02 * fit.nominal_m2[side], rel=0.002)
    assert fit.force_zero_n.value == pytest.approx(1.0, abs=0.1)


def test_pressures_that_change_together_give_one_factor_or_nothing(make):
    equal = [(p, p) for p in (1e5, 2e5, 4e5, 6e5)]
    assert both(make, equal).closures == (), "on equal areas equal pressures cancel"
    (fit,) = both(make, equal, area_b=0.8).closures
    assert "one factor applies to both" in fit.statement
    for side in ("a", "b"):
        assert fit.areas_m2[side].value == pytest.approx(1.02 * fit.nominal_m2[side], rel=0.005)


@pytest.mark.parametrize("area_b", [1.0, 0.98])
def test_what_is_left_of_opposed_pressures_is_not_taken_for_a_signal_where_it_is_noise(make, area_b):
    # On noise alone the factor falls to zero: an area of -100 % with a narrow interval.
    found = both(make, [(p, p) for p in np.linspace(0.5e5, 7e5, 15)], area_b=area_b, sensor=0.05e5)
    assert found.closures == ()
    assert any("cannot be determined" in note for note in found.notes)


def test_noise_that_is_small_against_the_change_takes_nothing_away(make):
    pairs = [(0, 0), (2e5, 0), (0, 2e5), (4e5, 1e5), (1e5, 4e5), (3e5, 6e5)]
    (fit,) = both(make, pairs, sensor=0.02e5).closures
    for side in ("a", "b"):
        assert fit.areas_m2[side].value == pytest.approx(1.02 * fit.nominal_m2[side], rel=0.03)
        assert fit.areas_m2[side].low <= 1.02 * fit.nominal_m2[side] <= fit.areas_m2[side].high

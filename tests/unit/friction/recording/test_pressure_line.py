"""Friction against pressure per seal; the prediction interval knows the spread between runs."""

import numpy as np
import pytest

from pneudrive.friction.pressure import LevelPoint, fit_pressure_lines, run_spread


def points(seal: str, runs: int, spread: float, rng: np.random.Generator, speed: float = 0.01) -> list[LevelPoint]:
    def at(bar: int) -> float:
        return (3 + bar) * (1 + spread * rng.normal())

    return [
        LevelPoint(f"{seal}-{run}-{bar}", seal, str(run), bar * 1e5, speed, at(bar), 0.1)
        for run in range(runs)
        for bar in (1, 3, 5, 7)
    ]


def test_pooled_relative_spread_is_recovered():
    spread = run_spread([p for s in "abcdefgh" for p in points(s, 3, 0.2, np.random.default_rng(ord(s)))])
    assert spread.relative == pytest.approx(0.2, rel=0.2)
    assert spread.degrees_of_freedom == 8 * 4 * 2


def test_nothing_run_twice_is_said():
    rng = np.random.default_rng(1)
    assert run_spread(points("a", 1, 0.2, rng)) is None
    (line,) = fit_pressure_lines(points("a", 1, 0.02, rng))
    assert line.basis == "unknown"
    assert "too narrow" in line.statement


def test_a_further_run_falls_into_the_band_in_about_95_of_100():
    inside = total = 0
    for seed in range(150):
        rng = np.random.default_rng(seed)
        (line,) = fit_pressure_lines(points("a", 2, 0.2, rng))
        assert line.basis == "own"
        for new in points("a", 1, 0.2, rng):
            low = np.interp(new.pressure_pa, line.band_pressure_pa, line.band_low_n)
            top = np.interp(new.pressure_pa, line.band_pressure_pa, line.band_high_n)
            inside += low <= new.friction_n <= top
            total += 1
    assert 0.90 <= inside / total <= 0.995


def test_a_seal_with_one_run_borrows_the_spread_of_the_others():
    rng = np.random.default_rng(5)
    lines = {line.seal: line for line in fit_pressure_lines([*points("a", 4, 0.2, rng), *points("b", 1, 0.0, rng)])}
    half = (lines["b"].band_high_n - lines["b"].band_low_n) / 2
    assert lines["b"].basis == "pooled"
    assert (half >= 1.9 * 0.12 * lines["b"].band_mean_n).all()
    assert lines["b"].intercept_n == pytest.approx(3.0)
    assert lines["b"].slope_n_pa * 1e5 == pytest.approx(1.0)


def test_confounded_speed_is_said():
    rng = np.random.default_rng(2)
    fast = [
        LevelPoint(p.recording, p.seal, p.run, p.pressure_pa, 0.015 - p.pressure_pa * 1e-8, p.friction_n, 0.1)
        for p in points("a", 2, 0.1, rng)
    ]
    (line,) = fit_pressure_lines(fast)
    assert line.speed_pressure_correlation < -0.9
    assert "speed falls with pressure" in line.statement


def test_crossed_speeds_get_a_line_each():
    rng = np.random.default_rng(2)
    lines = fit_pressure_lines([*points("a", 1, 0.0, rng, 0.01), *points("a", 1, 0.0, rng, 0.1)])
    assert [line.seal for line in lines] == ["a at 10 mm/s", "a at 100 mm/s"]


def test_a_speed_that_was_held_neither_falls_nor_rises_with_pressure(make):
    from pneudrive.characterise import characterise_recordings
    from pneudrive.identify import fit_friction

    held = zip((149.9995e-3, 149.9954e-3, 150.0031e-3), (0.0, 2e5, 1e5), strict=True)
    recordings = [
        make(name=f"{p:g}", friction=5 + p * 1e-5, gauge_b=p, speed=v, travel=0.3, rate=1000.0, seed=int(p) + 1)
        for v, p in held
    ]
    found = characterise_recordings(recordings)
    said = [*found.notes, found.pressure_lines[0].statement, *fit_friction(found.friction_map, "coulomb").notes]
    assert not [note for note in said if "speed" in note.lower() and "pressure" in note]
    assert found.pressure_lines[0].speed_pressure_correlation == 0.0
    assert found.pressure_lines[0].slope_n_pa * 1e5 == pytest.approx(1.0, abs=0.05)

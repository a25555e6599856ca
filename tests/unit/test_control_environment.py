"""The environment of a learner: what Gymnasium asks of one, and the run of a law that it must give."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import CommandError

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402 - behind what it needs

from pneudrive.control.environment import ID, PositionEnv, ResidualCommand  # noqa: E402

AXIS = Path(__file__).parents[2] / "examples" / "controlled_axis.toml"
STEP = "220 mm; 0.02 s: 222 mm in 0.1 s"


@pytest.fixture(scope="module")
def axis():
    return pn.Circuit.load(AXIS)


@pytest.mark.parametrize("told", [{}, {"drive": pn.Circuit.load(AXIS), "setup": "real", "spread": "standard"}])
def test_gymnasium_accepts_it(told):
    env = gymnasium.make(ID, duration="20 ms", **told)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "(?s).*(infinity|pneudrive/Position-v0|version).*")
        check_env(env.unwrapped, skip_render_check=True)


def _episode(env, actions, **begin):
    observation, _ = env.reset(**begin)
    rows = [observation]
    for action in actions:
        observation, reward, terminated, truncated, info = env.step(action)
        rows.append([*observation, reward])
        if terminated or truncated:
            break
    return rows, terminated, truncated, info


def test_equal_seeds_give_equal_bits_also_with_drives_and_references_that_are_drawn(axis):
    def heavier(drive, random):
        return drive.replace({"components.cylinder.moving_mass": f"{random.uniform(1.5, 3.0)} kg"})

    env = PositionEnv(axis, spread=heavier, duration="40 ms")
    actions = np.random.default_rng(1).uniform(-0.2, 0.2, (40, 1))
    first, other, again = (np.concatenate(_episode(env, actions, seed=seed)[0]) for seed in (1, 2, 1))
    assert np.array_equal(first, again)
    assert not np.array_equal(first[:4], other[:4])


def test_a_spread_by_name_draws_the_drive_that_a_run_with_its_values_is(axis):
    env = PositionEnv(axis, spread="standard", reference=STEP, duration="0.1 s", setup="ideal")
    actions = np.full((100, 1), 0.2)
    episodes = []
    for seed in (1, 2, 1):
        truth = env.reset(seed=seed)[1]["truth"]
        episodes.append((truth, np.concatenate(_episode(env, actions, seed=seed)[0])))
    (first, rows), (other, others), (again, repeated) = episodes
    assert first == again
    assert np.array_equal(rows, repeated)
    assert first != other
    assert not np.array_equal(rows, others)
    assert 0.5 <= first["moving_mass"] <= 1.6
    _episode(env, actions, seed=1)
    alone = PositionEnv(
        axis, spread=pn.control.Mismatch(**_texts(first)), reference=STEP, duration="0.1 s", setup="ideal"
    )
    assert np.array_equal(_moved(alone, actions, 5), _moved(env, actions, 1))  # without noise a seed is nothing else
    heavy = PositionEnv(axis, spread="mass+30", reference=STEP, duration="0.1 s", setup="ideal")
    light = PositionEnv(axis, reference=STEP, duration="0.1 s", setup="ideal")
    assert _moved(heavy, actions, 1)[-1] < _moved(light, actions, 1)[-1] - 1e-4  # more mass goes less far
    for wrong, word in (("usual", "standard"), ("axis.toml", "axis.toml")):
        with pytest.raises(pn.errors.PneudriveError, match=word):
            PositionEnv(axis, spread=wrong)


def _moved(env, actions, seed):
    _episode(env, actions[:-1], seed=seed)
    return env.columns()["position_m"]


def _texts(values):
    """Write values as a mismatch has them."""
    units = {"spool_frequency_hz": "Hz", "delay_s": "s", "pressure_zero_pa": "Pa"}
    short = {"spool_frequency_hz": "spool_frequency", "delay_s": "delay", "pressure_zero_pa": "pressure_zero"}
    return {
        short.get(name, name): f"{value!r} {units[name]}" if name in units else value
        for name, value in values.items()
        if not name.endswith("_b")
    }


def test_a_reference_of_one_reset_does_not_stay_for_the_next(axis):
    env = PositionEnv(axis, reference=STEP, duration="20 ms")
    heard = [env.reset(seed=1, options=own)[1]["reference"] for own in (None, {"reference": "100 mm"}, None)]
    assert heard == [STEP, "100 mm", STEP]


def test_an_episode_ends_after_its_time_or_where_the_drive_is_lost(axis):
    env = PositionEnv(axis, reference=STEP, duration="0.3 s", lost="5 mm")
    *_, terminated, truncated, info = _episode(env, np.zeros((400, 1)), seed=1)
    assert (terminated, truncated) == (False, True)
    assert info["time_s"] == pytest.approx(0.3)
    rows, terminated, truncated, info = _episode(env, np.ones((400, 1)), seed=1)
    assert (terminated, truncated) == (True, False)
    assert info["error_m"] < -5e-3  # opening drives it to +x, beyond the reference
    assert rows[-1][-1] == pytest.approx(1e3 * info["error_m"])
    _episode(env, np.zeros((400, 1)), seed=1)
    with pytest.raises(CommandError, match="over"):
        env.step([0.0])


def test_a_residual_of_nothing_is_the_run_of_the_law(axis):
    env = ResidualCommand(
        gymnasium.make(ID, drive=axis, law="inversion", reference=STEP, duration="0.2 s", setup="ideal")
    )
    _, terminated, truncated, info = _episode(env, np.zeros((400, 1)), seed=1)
    assert (terminated, truncated) == (False, True)
    run = pn.control.run(axis, "inversion", reference=STEP, duration="0.2 s", setup="ideal")
    columns = env.unwrapped.columns()
    assert np.array_equal(columns["command"], run.command.values[:-1])
    assert np.array_equal(columns["position_m"], run.position.values[:-1])
    assert info["position_m"] == run.position.values[-1]
    rows, *_ = _episode(env, np.full((400, 1), 0.5), seed=1)
    assert rows[-1][0] > info["position_m"] + 1e-4  # half of a fifth of the command beside it
    with pytest.raises(CommandError, match="needs a law"):
        ResidualCommand(PositionEnv(axis))


def test_wrong_arguments_are_refused_when_it_is_made(axis):
    wrong = (({"inputs": ["speed"]}, "no input 'speed'"), ({"duration": "-1 s"}, "duration"), ({"law": "pdi"}, "pid"))
    wrong += (({"inputs": "position"}, "is the text"), ({"inputs": ["position"] * 2}, "stands twice"))
    wrong += (({"ahead": 0.01}, "no sequence"), ({"ahead": ["-1 ms"]}, "ahead"), ({"ahead": [float("nan")]}, "ahead"))
    for told, word in (*wrong, ({"law": "mine.py:Law"}, "is code")):
        with pytest.raises(pn.errors.PneudriveError, match=word):
            PositionEnv(axis, **told)


def test_an_action_is_one_finite_number(axis):
    """A learner that diverged, or gives two commands, is told so and has lost nothing."""
    env = PositionEnv(axis, duration="20 ms", ahead=("0 s", "10 ms"))
    with pytest.raises(CommandError, match="the one option"):
        env.reset(options={"start": "R1"})
    env.reset(seed=1)
    for wrong in ([np.nan], [0.1, 0.2], [], None, ["left"]):
        with pytest.raises(CommandError, match="one finite number"):
            env.step(wrong)
    assert env.step(0.1)[4]["time_s"] == 0.001

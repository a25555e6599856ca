"""A simulated drive as an environment of Gymnasium: the action is the command of the valve, -1 .. 1.

An observation has the position, the velocity, both chamber pressures and the target, in SI units. The reward of a
sample is minus the error in mm. Train on it as on any other environment.
"""

from __future__ import annotations

from pathlib import Path

import gymnasium
import numpy as np
from gymnasium import spaces

import pneudrive as pn

OBSERVED = ("cylinder.position_m", "cylinder.velocity_m_s", "cylinder.a.pressure_pa", "cylinder.b.pressure_pa")


class PositionEnv(gymnasium.Env):
    """Move the piston to a random target within 10 to 90 % of the stroke and hold it there."""

    observation_space = spaces.Box(-np.inf, np.inf, (len(OBSERVED) + 1,), np.float64)
    action_space = spaces.Box(-1.0, 1.0, (1,), np.float64)

    def __init__(self, circuit: pn.Circuit, period_s: float = 1e-3, duration_s: float = 3.0) -> None:
        self.circuit, self.period_s, self.duration_s = circuit, period_s, duration_s
        self.stroke_m = circuit.components["cylinder"].stroke_m

    def _observation(self) -> np.ndarray:
        return np.array([*(self.session.read(name) for name in OBSERVED), self.target_m])

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple:
        super().reset(seed=seed)
        self.session = self.circuit.start()
        self.target_m = self.np_random.uniform(0.1, 0.9) * self.stroke_m
        return self._observation(), {}

    def step(self, action: np.ndarray) -> tuple:
        self.session.set("valve.command", float(np.clip(action[0], -1.0, 1.0)))
        self.session.advance(self.session.time + self.period_s)
        observation = self._observation()
        reward = -1e3 * abs(self.target_m - observation[0])
        return observation, reward, False, self.session.time >= self.duration_s, {}


if __name__ == "__main__":
    env = PositionEnv(pn.Circuit.load(Path(__file__).with_name("controlled_axis.toml")))
    observation, _ = env.reset(seed=1)
    total = 0.0
    for _ in range(1000):  # a proportional controller in place of a learner
        observation, reward, *_ = env.step(np.array([10.0 * (observation[4] - observation[0])]))
        total += reward
    target, position = 1e3 * observation[4], 1e3 * observation[0]
    print(f"target {target:.1f} mm, position {position:.1f} mm, mean error {-total / 1000:.1f} mm")

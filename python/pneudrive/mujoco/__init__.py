"""Pneumatic drives at the actuators of a MuJoCo model. They need the extra ``mujoco``."""

from pneudrive.mujoco.actuators import Actuators, StepReport

__all__ = ["Actuators", "StepReport"]

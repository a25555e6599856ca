"""Pneumatic drives at the actuators of a MuJoCo model. This package needs the extra ``mujoco``."""

from pneudrive.mujoco.actuators import Actuators, StepReport

__all__ = ["Actuators", "StepReport"]

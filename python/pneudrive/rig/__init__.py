"""Recordings from a simulated rig whose truth is known."""

from __future__ import annotations

from pneudrive.rig.motion import Limits, Motion, cycles, dwell, move, uniform_in_position
from pneudrive.rig.sensors import AnalogSensor, Encoder, EncoderClock, TimeClock
from pneudrive.rig.simulated import SimulatedRig, Trace, sweep

__all__ = [
    "AnalogSensor",
    "Encoder",
    "EncoderClock",
    "Limits",
    "Motion",
    "SimulatedRig",
    "TimeClock",
    "Trace",
    "cycles",
    "dwell",
    "move",
    "sweep",
    "uniform_in_position",
]

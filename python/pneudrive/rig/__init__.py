"""Rigs, real and simulated.

A campaign uses a rig only through the protocols of `pneudrive.rig.interface`: `Rig` (nine verbs), and for simulated
rigs `Reproducible` (begin_cycle, memory, restore) and `Changeable` (levels, change: mounting, seal, drive).
Times of samples are those of `pneudrive.rig.motion.schedule`::

    rig = load_rig("default", seed=7)              # name, TOML file, folder, address, or a class as "module:Name"
    rig = load_rig("my_rig.toml", pace=1.0)        # in real time, for a live display or behind a server
    rig.set_pressure(1.5e5, 1.5e5)
    rig.begin_cycle("0001")
    for samples in rig.acquire([Move(0.2, 0.05), Hold(15.0), Move(0.1, 0.05)], Sampling()):
        ...

Simulated rigs are TOML files, each value with its source (`shipped_rigs` lists those of the package; one can extend
another).

A new kind of rig needs a function (source, seed, pace) -> Rig and a line in `pneudrive.rig.rig_file.LOADERS`. The kind
is the scheme of an address, ``kind = "..."`` in a TOML file, or ``folder``.

Without a campaign, `SimulatedRig` is a stateless object: `drag` returns the true signals of cycles at one speed.
`record` returns the readings of the sensors. `measure` does both, and `sweep` does so over speeds and pressures.
`session` returns the stateful `RigSession` of `load_rig`.
"""

from __future__ import annotations

from pneudrive.lazy_names import lazily
from pneudrive.rig.interface import (
    Changeable,
    Envelope,
    Hold,
    Identity,
    Move,
    Reproducible,
    Rig,
    RigState,
    Samples,
    Sampling,
)

with lazily(__name__):
    from pneudrive.rig.description import AnalogSensor, Encoder, EncoderClock, TimeClock
    from pneudrive.rig.motion import Limits, Motion, cycles, dwell, move, schedule, uniform_in_position
    from pneudrive.rig.rig_file import load_rig, shipped_rigs
    from pneudrive.rig.simulated import RigSession, SimulatedRig, Trace, sweep

__all__ = [
    "AnalogSensor",
    "Changeable",
    "Encoder",
    "EncoderClock",
    "Envelope",
    "Hold",
    "Identity",
    "Limits",
    "Motion",
    "Move",
    "Reproducible",
    "Rig",
    "RigSession",
    "RigState",
    "Samples",
    "Sampling",
    "SimulatedRig",
    "TimeClock",
    "Trace",
    "cycles",
    "dwell",
    "load_rig",
    "move",
    "schedule",
    "shipped_rigs",
    "sweep",
    "uniform_in_position",
]

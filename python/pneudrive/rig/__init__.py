"""Rigs, real and simulated.

A campaign uses a rig only through the protocols of `pneudrive.rig.interface`: `Rig` (nine methods), and for simulated
rigs `Reproducible` (begin_cycle, memory, restore) and `Changeable` (levels, change: mounting, seal, drive).
`pneudrive.rig.motion.step_times` gives the times of samples::

    rig = load_rig("default", seed=7)              # name, TOML file, folder, address, or a class as "module:Name"
    rig = load_rig("my_rig.toml", pace=1.0)        # in real time, for a live display or behind a server
    rig.set_pressure(1.5e5, 1.5e5)
    rig.begin_cycle("0001")
    for samples in rig.acquire([Move(0.2, 0.05), Hold(15.0), Move(0.1, 0.05)], Sampling()):
        ...

A simulated rig is a TOML file in which each value has its source. `shipped_rigs` lists the files of the package. A file
can extend another file.

A new kind of rig needs a function (source, seed, pace) -> Rig and a line in `pneudrive.rig.rig_file.LOADERS`. The kind
of a rig is the scheme of its address, the key ``kind`` of its TOML file, or ``folder``.

`SimulatedRig` can also be used without a campaign, and is then stateless. `drag` returns the true signals of cycles at
one speed, `record` the readings of the sensors, and `measure` does both. `sweep` measures over speeds and pressures.
`session` returns the stateful `RigSession` of `load_rig`.
"""

from __future__ import annotations

from pneudrive.lazy_names import lazily
from pneudrive.rig.interface import Changeable as Changeable
from pneudrive.rig.interface import Envelope as Envelope
from pneudrive.rig.interface import Hold as Hold
from pneudrive.rig.interface import Identity as Identity
from pneudrive.rig.interface import Move as Move
from pneudrive.rig.interface import Reproducible as Reproducible
from pneudrive.rig.interface import Rig as Rig
from pneudrive.rig.interface import RigState as RigState
from pneudrive.rig.interface import Samples as Samples
from pneudrive.rig.interface import Sampling as Sampling

with lazily(__name__):
    from pneudrive.rig.description import AnalogSensor as AnalogSensor
    from pneudrive.rig.description import Encoder as Encoder
    from pneudrive.rig.motion import Limits as Limits
    from pneudrive.rig.rig_file import load_rig as load_rig
    from pneudrive.rig.rig_file import shipped_rigs as shipped_rigs
    from pneudrive.rig.simulated import RigSession as RigSession
    from pneudrive.rig.simulated import SimulatedRig as SimulatedRig
    from pneudrive.rig.simulated import Trace as Trace
    from pneudrive.rig.simulated import sweep as sweep

"""Hit rate of the diagnosis for seeded causes: ``python -m trials.diagnosis_hits --count 3``.

A true drive with one thing changed makes a record with sensor noise; the unchanged model is validated against it. A hit
is the seeded cause in the first place; "among" counts causes that are named as not told apart from the first, too. The
true model against its own records counts false alarms.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from oracle.drive_records import drive, record
from pneudrive.signals.drive_recording import DriveRecording, drive_recording
from pneudrive.validate import diagnose
from pneudrive.validate.balance import Signals
from pneudrive.validate.diagnosis import Diagnosis
from trials.shares import is_within, options


@dataclass(frozen=True)
class Case:
    """Change of the true drive or of its sensor signals, and the causes that the diagnosis should name."""

    name: str
    causes: frozenset[str]
    changes: dict
    sensors: Callable[[dict], dict] | None = None

    def diagnosed(self, seed: int, noise_m: float, noise_pa: float) -> Diagnosis:
        """Diagnose the unchanged model against a record of the changed drive."""
        made = record(drive(**self.changes), seed, noise_m=noise_m, noise_pa=noise_pa)
        shown: DriveRecording = made if self.sensors is None else drive_recording(self.sensors(dict(made.columns)))
        return diagnose(drive(), [Signals.of(shown)])


def _case(name: str, cause: str, sensors: Callable[[dict], dict] | None = None, **changes: object) -> Case:
    return Case(name, frozenset([cause] if cause else []), changes, sensors)


def _later(columns: dict, samples: int) -> dict:
    """Command that was sent earlier than the valve acted: the recorded one leads."""
    command = columns["command"]
    return {**columns, "command": np.r_[command[samples:], np.repeat(command[-1], samples)]}


CASES = (
    _case("true model", ""),
    _case("C -20 %", "conductance", valve__conductance="1.6 dm3/(s bar)"),
    _case("b 0.3 -> 0.5", "critical pressure ratio", valve__critical_pressure_ratio=0.5),
    _case("Coulomb +30 %", "Coulomb friction", friction__coulomb="39 N", friction__breakaway="54 N"),
    _case("viscous +75 %", "viscous friction", friction__viscous="70 N s/m"),
    _case("direction +-20 %", "direction of friction", friction__direction={"positive": 1.2, "negative": 0.8}),
    _case(
        "friction along the stroke +-30 %",
        "friction along the stroke",
        friction__position={"harmonics": [{"period": "0.25 m", "amplitude": 0.3}]},
    ),
    _case("dead volumes +50 %", "dead volumes", cylinder__dead_volume={"a": "15 cm3", "b": "15 cm3"}),
    _case("dead volume a +100 %", "dead volume of a", cylinder__dead_volume={"a": "20 cm3", "b": "10 cm3"}),
    _case("mass +20 %", "moving mass", cylinder__moving_mass="2.4 kg"),
    _case("heat transfer x3", "heat transfer", cylinder__heat_transfer="90 W/(m2 K)"),
    _case("leak past the piston", "leak past the piston", cylinder__leakage="0.04 dm3/(s bar)"),
    _case("supply -0.5 bar", "supply pressure", supply__pressure="6.5 bar abs"),
    _case("force 8 N", "constant force", load__force="8 N"),
    _case("spring 150 N/m", "spring", load__spring={"stiffness": "150 N/m", "rest_position": "250 mm"}),
    _case("pressure a +0.1 bar", "zero of pressure a", lambda c: {**c, "pressure_a_pa": c["pressure_a_pa"] + 1e4}),
    _case("position +10 mm", "zero of the position", lambda c: {**c, "position_m": c["position_m"] + 1e-2}),
    _case("valve 5 ms late", "valve delay", lambda c: _later(c, 5)),
    _case("valve zero 0.02", "valve zero", lambda c: {**c, "command": np.clip(c["command"] + 0.02, -1.0, 1.0)}),
)


def main() -> None:
    """Print the hit rate of each case at two noise levels."""
    given, fine = options(__doc__, 3), True
    for noise_m, noise_pa in ((2e-6, 300.0), (1e-5, 2e3)):
        hits, among = [], []
        for case in CASES:
            firsts = []
            for seed in range(given.seed, given.seed + given.count):
                culprits = case.diagnosed(seed, noise_m, noise_pa).culprits
                first = culprits[0].key if culprits else ""
                named = {first, *(name for name, _ in culprits[0].rivals)} if culprits else {""}
                wanted = case.causes or {""}
                hits.append(first in wanted)
                among.append(bool(named & wanted))
                firsts.append(first + ("" if len(culprits) < 2 else f" + {len(culprits) - 1}"))
            sys.stdout.write(f"{case.name:34s} {', '.join(firsts)}\n")
        title = f"noise {1e6 * noise_m:g} um, {noise_pa:g} Pa"
        fine &= is_within(f"{title}: first", hits, 0.95) & is_within(f"{title}: among", among, 0.98)
    sys.exit(not fine)


if __name__ == "__main__":
    main()

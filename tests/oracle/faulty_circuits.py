"""Records of drives with faults that no drive file describes: a leak as an orifice, a supply behind a restriction."""

from __future__ import annotations

import warnings

import numpy as np

import pneudrive as pn
from oracle.drive_records import RATE_HZ, commands, drive
from pneudrive.errors import PneudriveWarning
from pneudrive.signals.drive_recording import DriveRecording, drive_recording

#: Fault -> connections of its orifice.
LEAKS = {
    "a": "cylinder.a -> hole -> ambient",
    "b": "cylinder.b -> hole -> ambient",
    "piston": "cylinder.a -> hole -> cylinder.b",
}
CONDUCTANCE = 2.0  # dm3/(s bar), of the valve
PER_MM2 = 0.199 * 0.8 * np.pi / 4.0  # conductance of an orifice per diameter squared, dm3/(s bar mm2)


def faulty_record(
    fault: str, size: float, seed: int = 0, duration_s: float = 4.0, critical: float = 0.528
) -> DriveRecording:
    """Return the record of a drive with an orifice of `size` times the valve's conductance.

    `fault` is ``sag`` (regulator and a tank of 0.2 l before the valve), or a key of `LEAKS`.
    """
    tables = drive().circuit.to_dict()
    components, connections = dict(tables["components"]), list(tables["connections"])
    diameter = float(np.sqrt(size * CONDUCTANCE / PER_MM2))
    components["hole"] = {"kind": "orifice", "diameter": f"{diameter!r} mm", "critical_pressure_ratio": critical}
    start = {"cylinder.a.pressure": "4 bar abs", "cylinder.b.pressure": "4 bar abs"}
    if fault == "sag":
        components["tank"] = {"kind": "tank", "volume": "0.2 l"}
        connections[0] = "supply -> hole -> tank -> valve.1"
        start["tank.pressure"] = "7 bar abs"
    else:
        connections.append(LEAKS[fault])
    n = round(duration_s * RATE_HZ) + 1
    times, command = np.arange(n) / RATE_HZ, commands(seed, duration_s, drive())[:n]
    change = np.r_[True, np.diff(command) != 0.0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PneudriveWarning)
        circuit = pn.Circuit.model_validate(tables | {"components": components, "connections": connections})
        steps = list(zip(times[change].tolist(), command[change].tolist(), strict=True))
        run = pn.simulate(circuit, steps, duration_s, initial=start, sample_rate=RATE_HZ)
    random = np.random.default_rng(1000 + seed)
    columns = {"time_s": times, "command": command}
    for name, column, noise in (
        ("position_m", "cylinder.position", 2e-6),
        ("pressure_a_pa", "cylinder.a.pressure", 300.0),
        ("pressure_b_pa", "cylinder.b.pressure", 300.0),
    ):
        columns[name] = run[column].to_numpy() + noise * random.standard_normal(n)
    return drive_recording(columns, fault)

"""Records of simulated drives with known truth, as sensors would show them."""

from __future__ import annotations

import warnings

import numpy as np

import pneudrive as pn
from benches.servo import controller, follow_sine
from pneudrive.errors import PneudriveWarning
from pneudrive.signals.drive_recording import DriveRecording, drive_recording

RATE_HZ = 1000.0


def drive(**changes):
    """Return the drive of these tests with some values changed: keys with ``__`` for dots."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PneudriveWarning)
        base = pn.Drive.load("catalogue:reference").replace(
            {
                "friction.pressure": {
                    "coulomb": {"a": "1 N/bar", "b": "1 N/bar"},
                    "breakaway": {"a": "1.5 N/bar", "b": "1.5 N/bar"},
                }
            }
        )
        return base.replace({key.replace("__", "."): value for key, value in changes.items()})


def commands(seed: int, duration_s: float, truth) -> np.ndarray:
    """Return a command for each sample: what a sampled servo gives on a sine, with stick and slip on its way."""
    random = np.random.default_rng(seed)
    core = truth.system.compiled()
    start = truth.core_initial(pn.Initial(pressure_a="4 bar abs", pressure_b="4 bar abs"))
    gains = [float(random.uniform(*each)) for each in ((15.0, 25.0), (0.3, 0.6), (0.08, 0.14), (0.4, 0.9))]
    control = controller(*gains, 0.5 * truth.cylinder.stroke_m)
    done = follow_sine(core, control, duration_s, 100.0, start, 1e-6)
    return np.repeat(done["command"], round(RATE_HZ / 100.0))


def record(
    truth,
    seed: int = 0,
    duration_s: float = 6.0,
    noise_m: float = 2e-6,
    noise_pa: float = 300.0,
    name: str = "run",
    steps: list[tuple[float, float]] | None = None,
) -> DriveRecording:
    """Simulate a record with noise: servo motion, or the steps of the command that are given."""
    n = round(duration_s * RATE_HZ) + 1
    times = np.arange(n) / RATE_HZ
    if steps is None:
        command = commands(seed, duration_s, truth)[:n]
    else:
        at, values = np.array(steps).T
        command = values[np.searchsorted(at, times + 1e-9, side="right") - 1]
    change = np.r_[True, np.diff(command) != 0.0]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PneudriveWarning)
        run = pn.simulate(
            truth,
            list(zip(times[change].tolist(), command[change].tolist(), strict=True)),
            duration_s,
            initial=pn.Initial(pressure_a="4 bar abs", pressure_b="4 bar abs"),
            sample_rate=RATE_HZ,
        )
    random = np.random.default_rng(1000 + seed)
    return drive_recording(
        {
            "time_s": times,
            "command": command,
            "position_m": run.position.to_numpy() + noise_m * random.standard_normal(n),
            "pressure_a_pa": run.pressure_a.to_numpy() + noise_pa * random.standard_normal(n),
            "pressure_b_pa": run.pressure_b.to_numpy() + noise_pa * random.standard_normal(n),
        },
        name,
    )

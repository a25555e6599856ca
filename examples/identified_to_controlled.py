"""From a datasheet to a controlled drive: measure its friction, identify its valve, tune, run; all of it simulated.

The true axis differs from its datasheet in numbers that are hidden from all steps. They show only in the measurements
of a simulated rig and of the axis' sensors. Run as ``python examples/identified_to_controlled.py
docs/figures/identified-to-controlled.png`` it renews the tutorial's figure.
"""

import json
import sys
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import matplotlib.figure
import numpy as np
import xarray as xr
from scipy.optimize import least_squares

import pneudrive as pn
from pneudrive.campaign.run import Options, run_campaign

VALVE, FRICTION = "components.valve", "components.cylinder.friction"
# The true axis; all values are assumed.
SEAL = {
    "coulomb": "41 N",
    "breakaway": "63 N",
    "stribeck_velocity": "12 mm/s",
    "viscous": "65 N s/m",
    "bristle_stiffness": "1.4e5 N/m",
    "bristle_damping": "300 N s/m",
    "damping_fade_velocity": "100 mm/s",
}
TRUE_VALVE = {
    "conductance": "1.6 dm3/(s bar)",
    "critical_pressure_ratio": 0.38,
    "frequency": "72 Hz",
    "delay": "1.8 ms",
    "overlap": 0.038,
    "leakage": 0.004,
}
# Fitted numbers: SI unit, title, written form, its factor.
FITTED = {
    "coulomb": ("N", "Coulomb friction", "{:.0f} N", 1.0),
    "breakaway": ("N", "breakaway friction", "{:.0f} N", 1.0),
    "stribeck_velocity": ("m/s", "Stribeck velocity", "{:.0f} mm/s", 1e3),
    "viscous": ("N s/m", "viscous friction", "{:.0f} N s/m", 1.0),
}
# Identified numbers of the valve: unit, title, written form, its factor, value of the datasheet.
SOUGHT = {
    "conductance": ("dm3/(s bar)", "conductance of the valve", "{:.2f} dm3/(s bar)", 1.0, 2.0),
    "critical_pressure_ratio": ("", "critical pressure ratio", "{:.2f}", 1.0, 0.3),
    "frequency": ("Hz", "frequency of the spool", "{:.0f} Hz", 1.0, 100.0),
    "delay": ("ms", "dead time", "{:.1f} ms", 1.0, 1.0),
    "overlap": ("", "overlap", "{:.1f} %", 100.0, 0.02),
}
# Measured columns: noise, and the deviation that counts as one unit of a residual, m and Pa.
CHANNELS = {
    "cylinder.position": (5e-6, 2e-4),
    "cylinder.a.pressure": (300.0, 1e3),
    "cylinder.b.pressure": (300.0, 1e3),
}
# Steps of the command from rest, small ones about the overlap and full ones: time in s, command.
STEPS = [(0.0, 0.0), (0.05, 0.06), (0.25, -0.06), (0.45, 0.25), (0.6, -0.4)]
STEPS += [(0.75, 0.08), (0.95, -0.1), (1.15, 1.0), (1.22, -1.0), (1.32, 0.05)]
REST = {"cylinder.position": "250 mm", "cylinder.a.pressure": "4 bar abs", "cylinder.b.pressure": "4 bar abs"}
RIG = """
schema = 1
name = "Rig of this seal"
extends = "default"
[friction]
law = "lugre"
"""
PROTOCOL = """
schema = 1
name = "Speeds"
seed = 1
directions = "both"
speed = { from = "2 mm/s", to = "400 mm/s", count = 10, settled_time = "0 s" }
pressure = { both = ["0 bar gauge"] }
"""
LAW, REFERENCE, DURATION, SEEDS = "super-twisting", "sine 60 mm 1 Hz around 250 mm", "6 s", (1, 2, 3)


def measured_friction(folder: Path) -> dict[str, float]:
    """Drag the piston on a simulated rig at ten speeds, and fit Stribeck's law."""
    source = 'source = "assumed", reason = "the truth"'
    seal = (f'{key} = {{ value = "{value}", {source} }}\n' for key, value in SEAL.items())
    (folder / "rig.toml").write_text(RIG + "".join(seal), encoding="utf-8")
    (folder / "protocol.toml").write_text(PROTOCOL, encoding="utf-8")
    run_campaign(folder / "protocol.toml", folder / "rig.toml", folder / "campaign", options=Options(yes=True))
    return pn.fit_friction(pn.characterise(folder / "campaign"), law="stribeck").parameters


def answer(axis: pn.Circuit) -> np.ndarray:
    """Return position and pressures under the steps of the command."""
    run = pn.simulate(axis, {"valve.command": STEPS}, "1.5 s", initial=REST, rtol=1e-5)
    return np.array([run[name].values for name in CHANNELS])


def identified_valve(axis: pn.Circuit, measured: np.ndarray) -> tuple[pn.Circuit, dict[str, float]]:
    """Find the numbers of the valve from the error of the simulated response. The search starts at the datasheet."""

    def with_valve(shares: np.ndarray) -> tuple[pn.Circuit, dict[str, float]]:
        values = {key: float(share * row[4]) for (key, row), share in zip(SOUGHT.items(), shares, strict=True)}
        texts = {key: f"{value!r} {SOUGHT[key][0]}" if SOUGHT[key][0] else value for key, value in values.items()}
        return axis.replace({f"{VALVE}.{key}": text for key, text in texts.items()}), values

    def residuals(shares: np.ndarray) -> np.ndarray:
        return ((answer(with_valve(shares)[0]) - measured) / scale).ravel()

    scale = np.array([[unit] for _, unit in CHANNELS.values()])
    options = {"diff_step": 1e-2, "bounds": (0.2, 4.0), "loss": "soft_l1"}
    return with_valve(least_squares(residuals, np.ones(len(SOUGHT)), **options).x)


def friction_of(axis: pn.Circuit) -> dict[str, float]:
    """Return the parameters of the friction law, SI."""
    components = {table["name"]: table for table in json.loads(axis.core_json())["components"]}
    return components["cylinder"]["friction"]["parameters"]


def controlled(truth: pn.Circuit, believed: pn.Circuit, *, adaptation: bool) -> list[xr.Dataset]:
    """Return the runs of the true axis under a controller that is tuned from a description."""
    controller = pn.control.Controller(law=LAW, adaptation=adaptation)
    drive = partial(pn.control.run, truth, controller=controller, believes=believed)
    return [drive(reference=REFERENCE, duration=DURATION, seed=seed) for seed in SEEDS]


def print_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    for row in (head, ["---", *["---:"] * (len(head) - 1)], *rows):
        print(f"| {' | '.join(row)} |")
    print()


def main() -> None:
    sheet = pn.Circuit.load(Path(__file__).parent / "controlled_axis.toml")
    sheet = sheet.replace({f"{FRICTION}.damping_fade_velocity": SEAL["damping_fade_velocity"]})
    true_friction = {f"{FRICTION}.{key}": value for key, value in SEAL.items()}
    truth = sheet.replace(true_friction).replace({f"{VALVE}.{key}": value for key, value in TRUE_VALVE.items()})
    with tempfile.TemporaryDirectory() as folder:
        friction = measured_friction(Path(folder))
    with_friction = sheet.replace({f"{FRICTION}.{key}": f"{friction[key]!r} {FITTED[key][0]}" for key in FITTED})
    measured, noise = answer(truth), np.array([[noise] for noise, _ in CHANNELS.values()])
    measured += noise * np.random.default_rng(1).standard_normal(measured.shape)
    identified, valve = identified_valve(with_friction, measured)

    values = {key: (friction_of(sheet)[key], friction[key], friction_of(truth)[key]) for key in FITTED}
    for key, (unit, *_, start) in SOUGHT.items():
        values[key] = (start, valve[key], float(str(TRUE_VALVE[key]).removesuffix(unit)))
    forms = [(key, *(FITTED | SOUGHT)[key][1:4]) for key in values]
    numbers = [(title, *(form.format(factor * value) for value in values[key])) for key, title, form, factor in forms]
    print_table(("", "datasheet", "identified", "truth"), numbers)

    drives = {"the datasheet": sheet, "and the friction": with_friction, "and the valve": identified}
    drives["the truth"] = truth
    rows: list[list[str]] = []
    curves: dict[str, xr.Dataset] = {}
    for name, believed in drives.items():
        row = [name]
        for adaptation in (False, True):
            runs = controlled(truth, believed, adaptation=adaptation)
            curves.setdefault(name, runs[0])
            for measure in ("rmse_m", "max_error_m"):
                median = 1e6 * float(np.median([run.attrs["score"][measure] for run in runs]))
                row.append(f"{float(f'{median:.2g}'):.0f} um")
        rows.append(row)
    print_table(("assumed drive", "RMSE", "largest error", "RMSE, learning", "largest error, learning"), rows)

    if len(sys.argv) > 1:
        figure = matplotlib.figure.Figure(figsize=(7.0, 2.8), layout="constrained")
        axes = figure.subplots()
        for name in ("the datasheet", "and the friction", "and the valve"):
            late = curves[name].isel(time=slice(4000, None))
            axes.plot(late.time, 1e3 * (late.reference - late.position), label=name)
        axes.set(xlabel="time / s", ylabel="error / mm")
        axes.legend()
        figure.savefig(sys.argv[1], dpi=150)


if __name__ == "__main__":
    main()

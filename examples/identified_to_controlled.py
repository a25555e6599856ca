"""From a datasheet to a controlled drive: measure its friction, identify its valve, tune, run; all of it simulated.

The drive that is run differs from its datasheet in numbers that no step below reads: they show only in what the rig and
the sensors measure. Run as ``python examples/identified_to_controlled.py FIGURE.png`` it renews the guide's figure.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

import pneudrive as pn
from pneudrive.campaign.run import Options, run_campaign

AXIS = Path(__file__).parent / "controlled_axis.toml"
VALVE, FRICTION = "components.valve", "components.cylinder.friction"
SHEET = pn.Circuit.load(AXIS).replace({f"{FRICTION}.damping_fade_velocity": "100 mm/s"})

# The truth, which only the simulated rig and the simulated axis know.
SEAL = {"coulomb": "41 N", "breakaway": "63 N", "stribeck_velocity": "12 mm/s", "viscous": "65 N s/m"}
BRISTLES = {"bristle_stiffness": "1.4e5 N/m", "bristle_damping": "300 N s/m", "damping_fade_velocity": "100 mm/s"}
TRUTH = SHEET.replace(
    {f"{FRICTION}.{key}": value for key, value in (SEAL | BRISTLES).items()}
    | {f"{VALVE}.conductance": "1.6 dm3/(s bar)", f"{VALVE}.critical_pressure_ratio": 0.38}
    | {f"{VALVE}.frequency": "72 Hz", f"{VALVE}.delay": "1.8 ms", f"{VALVE}.overlap": 0.038, f"{VALVE}.leakage": 0.004}
)


def friction_of_a_campaign(folder: Path) -> "pn.FrictionFit":
    """Drag the piston on a rig at ten speeds, and fit Stribeck's law."""
    rig = 'schema = 1\nname = "Rig of this seal"\nextends = "default"\n[friction]\nlaw = "lugre"\n'
    for key, value in (SEAL | BRISTLES).items():
        rig += f'{key} = {{ value = "{value}", source = "assumed", reason = "the truth of this example" }}\n'
    (folder / "rig.toml").write_text(rig)
    (folder / "protocol.toml").write_text(
        'schema = 1\nname = "Speeds"\nseed = 1\ndirections = "both"\n'
        '[speed]\nfrom = "2 mm/s"\nto = "400 mm/s"\ncount = 10\nsettled_time = "0 s"\n'
        '[pressure]\nboth = ["0 bar gauge"]\n'
    )
    campaign = folder / "campaign"
    run_campaign(folder / "protocol.toml", folder / "rig.toml", campaign, options=Options(yes=True))
    return pn.fit_friction(pn.characterise(campaign), law="stribeck")


STEPS = [(0.0, 0.0), (0.05, 0.06), (0.25, -0.06), (0.45, 0.25), (0.6, -0.4)]
STEPS += [(0.75, 0.08), (0.95, -0.1), (1.15, 1.0), (1.22, -1.0), (1.32, 0.05)]
REST = {"cylinder.position": "250 mm", "cylinder.a.pressure": "4 bar abs", "cylinder.b.pressure": "4 bar abs"}
CHANNELS = {"cylinder.position": (5e-6, 2e-4), "cylinder.a.pressure": (300.0, 1e3), "cylinder.b.pressure": (300.0, 1e3)}
START = {"conductance": 2.0, "critical_pressure_ratio": 0.3, "frequency": 100.0, "delay": 1.0, "overlap": 0.02}
UNITS = {"conductance": "dm3/(s bar)", "frequency": "Hz", "delay": "ms"}


def answer(drive: pn.Circuit) -> np.ndarray:
    """Return position and pressures under steps of the command, from rest."""
    run = pn.simulate(drive, {"valve.command": STEPS}, "1.5 s", initial=REST, rtol=1e-5)
    return np.array([run[name].values for name in CHANNELS])


def valve_of_an_answer(drive: pn.Circuit, measured: np.ndarray) -> tuple[pn.Circuit, dict[str, float]]:
    """Find conductance, critical pressure ratio, spool, dead time and overlap by output error."""
    names, start = list(START), np.array(list(START.values()))

    def with_valve(shares: np.ndarray) -> tuple[pn.Circuit, dict[str, float]]:
        values = dict(zip(names, (start * shares).tolist(), strict=True))
        written = {key: f"{value!r} {UNITS[key]}" if key in UNITS else value for key, value in values.items()}
        return drive.replace({f"{VALVE}.{key}": value for key, value in written.items()}), values

    scale = np.array([[one[1]] for one in CHANNELS.values()])
    found = least_squares(
        lambda shares: ((answer(with_valve(shares)[0]) - measured) / scale).ravel(),
        np.ones(len(start)),
        diff_step=1e-2,
        bounds=(0.2, 4.0),
        loss="soft_l1",
    )
    return with_valve(found.x)


LAW, REFERENCE, SEEDS = "super-twisting", "sine 60 mm 1 Hz around 250 mm", (1, 2, 3)


def runs_of(believed: pn.Circuit, *, adaptation: bool) -> list:
    """Run the true drive under a law that believes another one."""
    controller = pn.control.Controller(law=LAW, adaptation=adaptation)
    told = {"controller": controller, "reference": REFERENCE, "duration": "6 s", "believes": believed}
    return [pn.control.run(TRUTH, setup="real", seed=seed, **told) for seed in SEEDS]


def middle(runs: list, measure: str) -> float:
    """Return the median of a measure over the seeds, um."""
    return 1e6 * float(np.median([run.attrs["score"][measure] for run in runs]))


def table(head: list[str], rows: list[list[str]]) -> None:
    """Print a table of the guide."""
    for row in (head, ["---", *["---:"] * (len(head) - 1)], *rows):
        print(f"| {' | '.join(row)} |")


def drawn(errors: dict, path: str) -> None:
    """Draw the error over the last two periods of each belief."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(7.0, 2.8), layout="constrained")
    for (name, run), look in zip(errors.items(), ("#9a9a9a", "#d98c2b", "#1f5fa8"), strict=False):
        late = run.time > 4.0
        axes.plot(run.time[late], 1e3 * (run.position - run.reference)[late], color=look, lw=1.0, label=name)
    axes.set(xlabel="time / s", ylabel="error / mm", title="simulated; the law was told", xlim=(4.0, 6.0))
    axes.legend(ncols=3, loc="upper center", frameon=False)
    axes.margins(y=0.2)
    figure.savefig(path, dpi=150)


with tempfile.TemporaryDirectory() as folder_name:
    fit = friction_of_a_campaign(Path(folder_name))
noise = np.random.default_rng(1).standard_normal((len(CHANNELS), 1501))
measured = answer(TRUTH) + np.array([[one[0]] for one in CHANNELS.values()]) * noise
values = {key: fit.parameters[key] for key in SEAL}
units = {"coulomb": "N", "breakaway": "N", "stribeck_velocity": "m/s", "viscous": "N s/m"}
with_friction = SHEET.replace({f"{FRICTION}.{key}": f"{values[key]!r} {unit}" for key, unit in units.items()})
identified, valve = valve_of_an_answer(with_friction, measured)

rows = [
    ["Coulomb friction", "30 N", f"{values['coulomb']:.0f} N", "41 N"],
    ["breakaway friction", "45 N", f"{values['breakaway']:.0f} N", "63 N"],
    ["Stribeck velocity", "20 mm/s", f"{1e3 * values['stribeck_velocity']:.0f} mm/s", "12 mm/s"],
    ["viscous friction", "40 N s/m", f"{values['viscous']:.0f} N s/m", "65 N s/m"],
    ["conductance of the valve", "2.0 dm3/(s bar)", f"{valve['conductance']:.2f} dm3/(s bar)", "1.60 dm3/(s bar)"],
    ["critical pressure ratio", "0.30", f"{valve['critical_pressure_ratio']:.2f}", "0.38"],
    ["frequency of the spool", "100 Hz", f"{valve['frequency']:.0f} Hz", "72 Hz"],
    ["dead time", "1.0 ms", f"{valve['delay']:.1f} ms", "1.8 ms"],
    ["overlap", "2.0 %", f"{100.0 * valve['overlap']:.1f} %", "3.8 %"],
]
table(["", "datasheet", "identified", "truth"], rows)
print()
beliefs = {"the datasheet": SHEET, "and the friction": with_friction, "and the valve": identified, "the truth": TRUTH}
rows, first = [], {}
for told, believed in beliefs.items():
    row = [told]
    for adaptation in (False, True):
        runs = runs_of(believed, adaptation=adaptation)
        first.setdefault(told, runs[0])
        row += [f"{middle(runs, 'rmse_m'):.0f} um", f"{middle(runs, 'max_error_m'):.0f} um"]
    rows.append(row)
table(["the law is told", "RMSE", "largest error", "RMSE, learning", "largest error, learning"], rows)
if len(sys.argv) > 1:
    drawn(first, sys.argv[1])

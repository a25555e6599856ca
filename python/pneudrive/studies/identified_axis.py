"""From a datasheet to a controlled axis: its friction is measured, its valve identified, a law tuned and run.

All results are simulated. The true axis differs from its datasheet in numbers that are hidden from all steps. They show
only in the
measurements of a simulated rig and of the axis' sensors.
"""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.campaign.run import Options, run_campaign
from pneudrive.control.loop import run
from pneudrive.control.tuning import Controller
from pneudrive.figures import Figure, Line, Panel, look
from pneudrive.friction.campaign.characteristics import characterise
from pneudrive.identify.static.fit import fit_friction
from pneudrive.report.page import Paragraph, section
from pneudrive.simulation.simulate import simulate
from pneudrive.views import ShownFigure, ShownTable

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.describe.circuit import Circuit
    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.report.page import Section

VALVE, FRICTION = "components.valve", "components.cylinder.friction"
#: The truth; assumed, as all values here.
SEAL = {"coulomb": "41 N", "breakaway": "63 N", "stribeck_velocity": "12 mm/s", "viscous": "65 N s/m"}
BRISTLES = {"bristle_stiffness": "1.4e5 N/m", "bristle_damping": "300 N s/m", "damping_fade_velocity": "100 mm/s"}
TRUE_VALVE = {
    "conductance": "1.6 dm3/(s bar)",
    "critical_pressure_ratio": 0.38,
    "frequency": "72 Hz",
    "delay": "1.8 ms",
    "overlap": 0.038,
    "leakage": 0.004,
}
#: What is identified of a valve: unit, the datasheet's value, in which it is sought, and how it is written.
SOUGHT = {
    "conductance": ("dm3/(s bar)", 2.0, "conductance of the valve", "{:.2f} dm3/(s bar)", 1.0),
    "critical_pressure_ratio": ("", 0.3, "critical pressure ratio", "{:.2f}", 1.0),
    "frequency": ("Hz", 100.0, "frequency of the spool", "{:.0f} Hz", 1.0),
    "delay": ("ms", 1.0, "dead time", "{:.1f} ms", 1.0),
    "overlap": ("", 0.02, "overlap", "{:.1f} %", 100.0),
}
FITTED = {
    "coulomb": ("N", "Coulomb friction", "{:.0f} N", 1.0),
    "breakaway": ("N", "breakaway friction", "{:.0f} N", 1.0),
    "stribeck_velocity": ("m/s", "Stribeck velocity", "{:.0f} mm/s", 1e3),
    "viscous": ("N s/m", "viscous friction", "{:.0f} N s/m", 1.0),
}
#: Steps of the command from rest: small ones about the overlap, and full ones; s.
STEPS = [(0.0, 0.0), (0.05, 0.06), (0.25, -0.06), (0.45, 0.25), (0.6, -0.4), (0.75, 0.08), (0.95, -0.1)]
STEPS += [(1.15, 1.0), (1.22, -1.0), (1.32, 0.05)]
ANSWER = "1.5 s"
REST = {"cylinder.position": "250 mm", "cylinder.a.pressure": "4 bar abs", "cylinder.b.pressure": "4 bar abs"}
#: Channels: noise, and what counts as one unit of a residual, m and Pa.
CHANNELS = {"cylinder.position": (5e-6, 2e-4), "cylinder.a.pressure": (300.0, 1e3), "cylinder.b.pressure": (300.0, 1e3)}
LAW, REFERENCE, DURATION, SEEDS = "super-twisting", "sine 60 mm 1 Hz around 250 mm", "6 s", (1, 2, 3)
FROM_S = 4.0  # what is drawn of a run


def true_axis(sheet: Circuit) -> Circuit:
    """Return the true axis, which is measured and run, for the axis of the datasheet."""
    friction = {f"{FRICTION}.{key}": value for key, value in (SEAL | BRISTLES).items()}
    return sheet.replace(friction | {f"{VALVE}.{key}": value for key, value in TRUE_VALVE.items()})


def measure_friction(folder: Path) -> FrictionFit:
    """Drag the piston on a simulated rig at ten speeds, and fit Stribeck's law."""
    rig = 'schema = 1\nname = "Rig of this seal"\nextends = "default"\n[friction]\nlaw = "lugre"\n'
    for key, value in (SEAL | BRISTLES).items():
        rig += f'{key} = {{ value = "{value}", source = "assumed", reason = "the truth of this study" }}\n'
    (folder / "rig.toml").write_text(rig)
    (folder / "protocol.toml").write_text(
        'schema = 1\nname = "Speeds"\nseed = 1\ndirections = "both"\n'
        '[speed]\nfrom = "2 mm/s"\nto = "400 mm/s"\ncount = 10\nsettled_time = "0 s"\n'
        '[pressure]\nboth = ["0 bar gauge"]\n'
    )
    campaign = folder / "campaign"
    run_campaign(folder / "protocol.toml", folder / "rig.toml", campaign, options=Options(yes=True))
    return fit_friction(characterise(campaign), law="stribeck")


def answer(axis: Circuit) -> NDArray[np.float64]:
    """Return position and pressures under the steps of the command."""
    found = simulate(axis, {"valve.command": STEPS}, ANSWER, initial=REST, rtol=1e-5)
    return np.array([found[name].values for name in CHANNELS])


def identify_valve(axis: Circuit, measured: NDArray[np.float64]) -> tuple[Circuit, dict[str, float]]:
    """Find the numbers of the valve from the error of the simulated response. The search starts at the datasheet."""
    from scipy.optimize import least_squares

    def with_valve(shares: NDArray[np.float64]) -> tuple[Circuit, dict[str, float]]:
        values = {key: float(share * own[1]) for (key, own), share in zip(SOUGHT.items(), shares, strict=True)}
        written = {key: f"{value!r} {SOUGHT[key][0]}" if SOUGHT[key][0] else value for key, value in values.items()}
        return axis.replace({f"{VALVE}.{key}": value for key, value in written.items()}), values

    scale = np.array([[one] for _, one in CHANNELS.values()])
    found = least_squares(
        lambda shares: ((answer(with_valve(shares)[0]) - measured) / scale).ravel(),
        np.ones(len(SOUGHT)),
        diff_step=1e-2,
        bounds=(0.2, 4.0),
        loss="soft_l1",
    )
    return with_valve(found.x)


@dataclass(frozen=True)
class IdentifiedAxis:
    """Result of the chain.

    Attributes
    ----------
    numbers : tuple of tuple of str
        Rows: name, datasheet, identified, truth.
    scores : tuple of tuple of str
        Rows: assumed drive, RMSE and largest error without and with learning, medians of the seeds.
    runs : dict
        Assumed drive -> its first run without learning.
    """

    numbers: tuple[tuple[str, ...], ...]
    scores: tuple[tuple[str, ...], ...]
    runs: dict[str, xr.Dataset]

    #: Heads of both tables.
    NUMBERS = ("", "datasheet", "identified", "truth")
    SCORES = ("assumed drive", "RMSE", "largest error", "RMSE, learning", "largest error, learning")

    def section(self) -> Section:
        """Return the section of a report."""
        said = (
            "A rodless axis differs from its datasheet. Its friction is measured in a campaign on a rig. Its valve is "
            f"identified from its response to command steps. {LAW} is tuned from the description and runs "
            f"the true axis along a {REFERENCE}. Simulated: controllers and axis share the equations of the "
            "simulation. Only the controllers' parameters can be wrong."
        )
        caption = "Error over two periods, by assumed drive, without learning. Simulated."
        return section(
            "identified-axis",
            "From a datasheet to a controlled axis",
            Paragraph(said),
            ShownFigure("identified-axis", caption, self.figure()),
            ShownTable("Errors, medians of three seeds, simulated.", self.SCORES, self.scores),
            ShownTable("Values of the datasheet, identified values, and true values.", self.NUMBERS, self.numbers),
            synthetic=True,
        )

    def figure(self) -> Figure:
        """Draw the error over the last periods."""
        lines = []
        for number, (assumed, found) in enumerate(list(self.runs.items())[:3]):
            late = found.time > FROM_S
            lines.append(Line(found.time[late], (found.reference - found.position)[late], assumed, look(number)))
        return Figure([Panel(lines)], "time / s", "error / mm", row_in=2.8, rest_in=0.0)


def identify_axis(sheet: Circuit) -> IdentifiedAxis:
    """Measure, identify, tune and run an axis; compare the score with that of a controller from the datasheet.

    Parameters
    ----------
    sheet : Circuit
        As ``examples/controlled_axis.toml``.
    """
    sheet = sheet.replace({f"{FRICTION}.damping_fade_velocity": BRISTLES["damping_fade_velocity"]})
    truth = true_axis(sheet)
    with tempfile.TemporaryDirectory() as folder:
        fit = measure_friction(Path(folder))
    known = {f"{FRICTION}.{key}": f"{fit.parameters[key]!r} {own[0]}" for key, own in FITTED.items()}
    with_friction = sheet.replace(known)
    measured, noise = answer(truth), np.array([[one] for one, _ in CHANNELS.values()])
    measured += noise * np.random.default_rng(1).standard_normal(measured.shape)
    identified, valve = identify_valve(with_friction, measured)
    told = {"the datasheet": sheet, "and the friction": with_friction, "and the valve": identified, "the truth": truth}
    scores, firsts = [], {}
    for name, believed in told.items():
        row = [name]
        for adaptation in (False, True):
            controller = Controller(law=LAW, adaptation=adaptation)
            options = {"controller": controller, "reference": REFERENCE, "duration": DURATION, "believes": believed}
            runs = [run(truth, setup="real", seed=seed, **options) for seed in SEEDS]
            firsts.setdefault(name, runs[0])
            each = (np.median([one.attrs["score"][what] for one in runs]) for what in ("rmse_m", "max_error_m"))
            row += [f"{float(f'{1e6 * float(one):.2g}'):.0f} um" for one in each]
        scores.append(tuple(row))
    return IdentifiedAxis(tuple(_numbers(sheet, truth, fit.parameters, valve)), tuple(scores), firsts)


def _numbers(sheet: Circuit, truth: Circuit, friction: dict[str, float], valve: dict[str, float]) -> list[tuple]:
    """Return the rows of the result."""
    rows = []
    ends = [_friction(one) for one in (sheet, truth)]
    for key, (_, title, form, factor) in FITTED.items():
        values = (ends[0][key], friction[key], ends[1][key])
        rows.append((title, *(form.format(factor * value) for value in values)))
    for key, (unit, start, title, form, factor) in SOUGHT.items():
        true = TRUE_VALVE[key]
        plain = float(str(true).removesuffix(unit).strip()) if unit else float(true)
        rows.append((title, *(form.format(factor * value) for value in (start, valve[key], plain))))
    return rows


def _friction(axis: Circuit) -> dict[str, float]:
    """Return the parameters of the friction law, SI."""
    components = {own["name"]: own for own in json.loads(axis.core_json())["components"]}
    return components["cylinder"]["friction"]["parameters"]

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
from pneudrive.describe.files import toml
from pneudrive.figures import Figure, Line, Panel, look
from pneudrive.friction.campaign.characteristics import characterise
from pneudrive.identify.static.fit import fit_friction
from pneudrive.report.page import Paragraph, section, texts_of
from pneudrive.simulation.simulate import simulate
from pneudrive.views import ShownFigure, ShownTable

if TYPE_CHECKING:
    import xarray as xr

    from pneudrive.arrays import Array
    from pneudrive.describe.circuit import Circuit
    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.report.page import Section

VALVE, FRICTION = "components.valve", "components.cylinder.friction"
_TABLES = texts_of(Path(__file__).with_name("identified_axis.toml"))
#: Of the true axis: friction and valve.
SEAL, TRUE_VALVE = _TABLES["friction"], _TABLES["valve"]
#: Numbers that are identified: unit, start of the search, title, written form and its factor.
FITTED, SOUGHT = _TABLES["fitted"], _TABLES["sought"]
CHANNELS = _TABLES["channels"]
LAW, REFERENCE, DURATION, SEEDS = "super-twisting", "sine 60 mm 1 Hz around 250 mm", "6 s", (1, 2, 3)
FROM_S = 4.0  # what is drawn of a run


def true_axis(sheet: Circuit) -> Circuit:
    """Return the true axis, which is measured and run, for the axis of the datasheet."""
    friction = {f"{FRICTION}.{key}": value for key, value in SEAL.items()}
    return sheet.replace(friction | {f"{VALVE}.{key}": value for key, value in TRUE_VALVE.items()})


def measure_friction(folder: Path) -> FrictionFit:
    """Drag the piston on a simulated rig at ten speeds, and fit Stribeck's law."""
    assumed = {"source": "assumed", "reason": "the truth of this study"}
    friction = {"law": "lugre"} | {key: {"value": value} | assumed for key, value in SEAL.items()}
    for name, tables in (("rig", _TABLES["rig"] | {"friction": friction}), ("protocol", _TABLES["protocol"])):
        (folder / f"{name}.toml").write_text(toml.write(tables), encoding="utf-8")
    campaign = folder / "campaign"
    run_campaign(folder / "protocol.toml", folder / "rig.toml", campaign, options=Options(yes=True))
    return fit_friction(characterise(campaign), law="stribeck")


def answer(axis: Circuit) -> Array:
    """Return position and pressures under the steps of the command."""
    test = _TABLES["test"]
    steps = [tuple(step) for step in test["steps"]]
    found = simulate(axis, {"valve.command": steps}, test["duration"], initial=test["rest"], rtol=1e-5)
    return np.array([found[name].values for name in CHANNELS])


def identify_valve(axis: Circuit, measured: Array) -> tuple[Circuit, dict[str, float]]:
    """Find the numbers of the valve from the error of the simulated response. The search starts at the datasheet."""
    from scipy.optimize import least_squares

    def with_valve(shares: Array) -> tuple[Circuit, dict[str, float]]:
        values = {k: float(share * own["start"]) for (k, own), share in zip(SOUGHT.items(), shares, strict=True)}
        written = {k: f"{value!r} {unit}" if (unit := SOUGHT[k]["unit"]) else value for k, value in values.items()}
        return axis.replace({f"{VALVE}.{key}": value for key, value in written.items()}), values

    scale = np.array([[channel["residual"]] for channel in CHANNELS.values()])
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
        """Return the results as a section of a report."""
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
    sheet = sheet.replace({f"{FRICTION}.damping_fade_velocity": SEAL["damping_fade_velocity"]})
    truth = true_axis(sheet)
    with tempfile.TemporaryDirectory() as folder:
        fit = measure_friction(Path(folder))
    known = {f"{FRICTION}.{key}": f"{fit.parameters[key]!r} {own['unit']}" for key, own in FITTED.items()}
    with_friction = sheet.replace(known)
    measured, noise = answer(truth), np.array([[channel["noise"]] for channel in CHANNELS.values()])
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
    ends = [_friction(one) for one in (sheet, truth)]
    values = {key: (ends[0][key], friction[key], ends[1][key]) for key in FITTED}
    for key, own in SOUGHT.items():
        true = str(TRUE_VALVE[key]).removesuffix(own["unit"]).strip()
        values[key] = (own["start"], valve[key], float(true))
    about = FITTED | SOUGHT
    return [
        (about[k]["title"], *(about[k]["form"].format(about[k]["factor"] * value) for value in row))
        for k, row in values.items()
    ]


def _friction(axis: Circuit) -> dict[str, float]:
    """Return the parameters of the friction law, SI."""
    components = {own["name"]: own for own in json.loads(axis.core_json())["components"]}
    return components["cylinder"]["friction"]["parameters"]

"""The report as a whole: which sections there are, in which order."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.report import (
    chambers,
    closure,
    loops,
    measured,
    paper,
    pressure,
    provenance,
    record,
    recovered,
    speed,
    stick_slip,
    strokes,
    style,
    uncertainty,
)
from pneudrive.report.page import Report
from pneudrive.report.verdict import verdict

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.characterise import Characterisation
    from pneudrive.identify import FrictionFit
    from pneudrive.paper import Claim, PaperFigure
    from pneudrive.paper.chamber_laws import ChamberComparison
    from pneudrive.report.page import Section
    from pneudrive.rig import SimulatedRig
    from pneudrive.rig.description import RigDescription

    Fits = Mapping[str, Mapping[str, FrictionFit]]

#: Speeds and pressures at which the simulated rig's recordings are compared with their truth.
RECOVERY_SPEEDS_M_S = (1e-3, 0.45, 24)  # from, to, number; logarithmic
RECOVERY_GAUGES_PA = (0.0, 0.5e5, 1.0e5, 1.5e5)
RECOVERY_CYCLES = 3


@dataclass(frozen=True)
class Reproduction:
    """What the simulated rig and drive gave.

    Attributes
    ----------
    rig : SimulatedRig
        That made the recordings with known truth.
    figures : dict of PaperFigure
        By number in the source paper.
    rigs : dict
        Rig -> its description; those of the figures.
    found : Characterisation
        Of simulated recordings with known truth.
    fits : dict
        Group -> law -> fit, of those recordings.
    chambers : ChamberComparison
        Printed equations against the energy balance.
    claims : tuple of Claim
        Every sentence of the paper that can be checked, with its verdict.
    seed : int
        Of the simulated sensors.
    """

    rig: SimulatedRig
    figures: Mapping[int, PaperFigure]
    rigs: Mapping[str, RigDescription]
    found: Characterisation
    fits: Fits
    chambers: ChamberComparison
    claims: tuple[Claim, ...]
    seed: int


def reproduce(into: str | Path, seed: int = 0, rigs: Mapping[str, str | Path] | None = None) -> Reproduction:
    """Run the source paper's experiments on simulated rigs and a drive, and make its figures 1 to 9.

    Parameters
    ----------
    into : path-like
        Folder for the campaigns; what is finished in it is not run again.
    seed : int
        Of all that is random on the rigs.
    rigs : mapping, optional
        Experiment (`pneudrive.paper.EXPERIMENTS`) -> rig file that takes the place of its own.

    Returns
    -------
    Reproduction

    Raises
    ------
    CampaignError
        The folder cannot be used.
    """
    import numpy as np

    from pneudrive.characterise import characterise_recordings
    from pneudrive.identify.seals import fit_characterisation
    from pneudrive.paper import general_claims, paper_figures, run_experiments
    from pneudrive.paper.chamber_laws import compare_chamber_laws
    from pneudrive.rig import SimulatedRig, shipped_rigs, sweep

    runs = run_experiments(into, seed, rigs)
    rig = SimulatedRig.default()
    recordings = sweep(rig, np.geomspace(*RECOVERY_SPEEDS_M_S), RECOVERY_GAUGES_PA, count=RECOVERY_CYCLES, seed=seed)
    found = characterise_recordings(recordings)
    fits, _ = fit_characterisation(found)
    files = {run.rig: shipped_rigs().get(run.rig, run.rig) for run in runs.values()}
    described = {name: SimulatedRig.load(path).description for name, path in files.items()}
    figures, chamber_laws = paper_figures(runs, seed), compare_chamber_laws()
    claims = tuple(claim for figure in figures.values() for claim in figure.claims)
    claims += general_claims(chamber_laws, figures)
    return Reproduction(rig, figures, described, found, fits, chamber_laws, claims, seed)


def write_report(
    found: Characterisation | None, fits: Fits, folder: str | Path, reproduction: Reproduction | None = None
) -> Path:
    """Write report.html, which loads nothing from anywhere, and its figures as PNG and SVG.

    Parameters
    ----------
    found : Characterisation or None
        Of recordings, real or simulated.
    fits : mapping
        Group -> law -> FrictionFit; may be empty.
    folder : path-like
        Must be there; figures go into its folder ``figures``.
    reproduction : Reproduction, optional
        Adds the sections of the source paper.

    Returns
    -------
    pathlib.Path
        Of report.html.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    folder = Path(folder)
    with style.applied():
        report = Report(
            _title(found, reproduction), verdict(found, fits, reproduction), sections(found, fits, reproduction)
        )
        return report.write(folder)


def sections(found: Characterisation | None, fits: Fits, made: Reproduction | None) -> list[Section]:
    """All sections for which there are data, in the report's order."""
    parts: list[Section | None] = []
    if found is not None:
        parts += [
            measured.section(found),
            record.section(found),
            loops.section(found),
            closure.section(found),
            pressure.section(found),
            speed.section(found, fits),
            strokes.drift(found),
            strokes.peaks(found),
            uncertainty.budget(found),
            uncertainty.flags(found),
            recovered.section(found, fits),
        ]
    if made is not None:
        if found is None or not found.synthetic:
            parts.append(recovered.section(made.found, made.fits))
        parts.append(paper.section(made.figures, made.claims))
    parts.append(stick_slip.section(found, made.figures if made is not None else {}))
    if made is not None:
        parts.append(chambers.section(made.chambers))
    parts.append(provenance.section(found, made))
    return [part for part in parts if part is not None]


def _title(found: Characterisation | None, made: Reproduction | None) -> str:
    if found is None:
        return "The source paper's figures from a simulated rig"
    title = "Friction of simulated recordings" if found.synthetic else "Friction of a pneumatic piston from recordings"
    return f"{title}, with a simulated rig" if made is not None and not found.synthetic else title

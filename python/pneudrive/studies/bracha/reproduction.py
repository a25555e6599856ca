"""The whole study: its campaigns and simulations, and the sentences that they check."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise import characterise_recordings
from pneudrive.identify.static.fit import fit_characterisation
from pneudrive.report.fit import Addition
from pneudrive.report.page import Topic
from pneudrive.report.strokes import recovered_section
from pneudrive.rig import SimulatedRig, shipped_rigs, sweep
from pneudrive.studies.bracha import pages
from pneudrive.studies.bracha.figure import run_experiments
from pneudrive.studies.bracha.figures import paper_figures
from pneudrive.studies.bracha.general import ENERGY_BALANCE, compare_chamber_laws, general_claims

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pneudrive.characterise import Characterisation
    from pneudrive.report.fit import Fits
    from pneudrive.rig.description import RigDescription
    from pneudrive.studies.bracha.figure import Claim, PaperFigure
    from pneudrive.studies.bracha.general import ChamberComparison

#: Speeds and pressures at which the simulated rig's recordings are compared with their truth.
RECOVERY_SPEEDS_M_S = (1e-3, 0.45, 24)  # from, to, number; logarithmic
RECOVERY_GAUGES_PA = (0.0, 0.5e5, 1.0e5, 1.5e5)
RECOVERY_CYCLES = 3


@dataclass(frozen=True)
class Reproduction:
    """Results of the simulated rigs and drives.

    Attributes
    ----------
    rig : SimulatedRig
        Rig of the recordings with known ground truth.
    figures : dict of PaperFigure
        Figures by number in the source paper.
    rigs : dict
        Rig -> its description, for the figures.
    found : Characterisation
        Result of simulated recordings with known ground truth.
    fits : dict
        Group -> law -> fit, of those recordings.
    chambers : ChamberComparison
        Printed equations against the energy balance.
    claims : tuple of Claim
        Every sentence of the paper that can be checked, with its verdict.
    seed : int
        Seed of the simulated sensors.
    """

    rig: SimulatedRig
    figures: Mapping[int, PaperFigure]
    rigs: Mapping[str, RigDescription]
    found: Characterisation
    fits: Fits
    chambers: ChamberComparison
    claims: tuple[Claim, ...]
    seed: int

    def addition(self, found: Characterisation | None) -> Addition:
        """Return the study's addition to the report of these recordings, or a whole report."""
        own = found is not None and found.synthetic  # such recordings have their own comparison with the ground truth
        parts = (
            None if own else recovered_section(self.found, self.fits),
            pages.paper(self.figures, self.claims),
            pages.stick_slip([self.figures[n] for n in pages.STICK_SLIP if n in self.figures]),
            pages.chambers(self.chambers),
        )
        lines = pages.verdict(self.found, self.claims, self.figures, self.chambers, alone=found is None)
        solver = str(self.chambers.runs[ENERGY_BALANCE].attrs["solver"])
        return Addition(
            title="The source paper's figures from a simulated rig",
            verdict=tuple(lines),
            sections=tuple(part for part in parts if part is not None),
            validity=Topic(pages.PAGE, "provenance").say("validity"),
            settings=(("solver of the simulations", solver), ("seed of the simulated sensors", str(self.seed))),
            sources=tuple(pages.values(self.rig.description, self.rigs.values())),
            cited=("bracha", *(key for run in self.chambers.runs.values() for key in run.attrs["citations"])),
            laws=("lugre", "stribeck"),
        )


def reproduce(into: str | Path, seed: int = 0, rigs: Mapping[str, str | Path] | None = None) -> Reproduction:
    """Run the source paper's experiments on simulated rigs and a drive, and make its figures 1 to 9.

    Parameters
    ----------
    into : path-like
        Folder for the campaigns; finished cycles are not run again.
    seed : int
        Seed of all random values of the rigs.
    rigs : mapping, optional
        Experiment (`pneudrive.studies.bracha.EXPERIMENTS`) -> rig file to use instead.

    Returns
    -------
    Reproduction

    Raises
    ------
    CampaignError
        If the folder cannot be used.
    """
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

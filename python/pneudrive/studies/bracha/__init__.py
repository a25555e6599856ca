"""The source paper's figures from simulated data, and a verdict on each of its sentences that can be checked."""

from __future__ import annotations

from pneudrive.studies.bracha.figure import EXPERIMENTS, FOLDER, Claim, Experiment, PaperFigure, run_experiments
from pneudrive.studies.bracha.figures import paper_figures
from pneudrive.studies.bracha.general import general_claims
from pneudrive.studies.bracha.reproduction import Reproduction, reproduce

__all__ = [
    "EXPERIMENTS",
    "FOLDER",
    "Claim",
    "Experiment",
    "PaperFigure",
    "Reproduction",
    "general_claims",
    "paper_figures",
    "reproduce",
    "run_experiments",
]

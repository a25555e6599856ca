"""The source paper's figures from simulated data, and a verdict on each of its sentences that can be checked."""

from __future__ import annotations

from pneudrive.studies.bracha.figure import EXPERIMENTS as EXPERIMENTS
from pneudrive.studies.bracha.figure import FOLDER as FOLDER
from pneudrive.studies.bracha.figure import Claim as Claim
from pneudrive.studies.bracha.figure import Experiment as Experiment
from pneudrive.studies.bracha.figure import PaperFigure as PaperFigure
from pneudrive.studies.bracha.figure import run_experiments as run_experiments
from pneudrive.studies.bracha.figures import paper_figures as paper_figures
from pneudrive.studies.bracha.general import general_claims as general_claims
from pneudrive.studies.bracha.reproduction import Reproduction as Reproduction
from pneudrive.studies.bracha.reproduction import reproduce as reproduce

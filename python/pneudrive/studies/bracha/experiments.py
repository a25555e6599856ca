"""The source paper's experiments: ready protocols run on simulated rigs, each into a campaign folder."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.campaign.storage.folder import Campaign
    from pneudrive.rig import Envelope

#: Experiment -> (ready protocol, rig as `load_rig` takes it). The paper does not describe its rigs: the first one is
#: without pressure, the second with one pressure for both chambers.
EXPERIMENTS = {
    "cycle": ("paper-cycle", "open-chambers"),
    "speed": ("paper-speed", "open-chambers"),
    "pressure": ("paper-pressure", "common-manifold"),
    "stops": ("paper-stops", "open-chambers"),
}
FOLDER = "campaigns"


@dataclass(frozen=True)
class Experiment:
    """A finished campaign of the study.

    Attributes
    ----------
    name : str
        Key of `EXPERIMENTS`.
    protocol, rig : str
        Protocol and rig.
    campaign : Campaign
    envelope : Envelope
        Seed of the rig.
    """

    name: str
    protocol: str
    rig: str
    campaign: Campaign
    envelope: Envelope

    def truth(self) -> list[dict[str, Any]]:
        """Return the ground truth of each cycle in running order."""
        return [json.loads(path.read_text("utf-8")) for path in sorted(self.campaign.path.glob("truth/*.json"))]


def run_experiments(
    into: str | Path, seed: int = 0, rigs: Mapping[str, str | Path] | None = None
) -> dict[str, Experiment]:
    """Run the campaigns, each in its own process.

    Parameters
    ----------
    into : path-like
        Folder for the campaign folders; finished cycles are not run again.
    seed : int
        Seed of the rigs.
    rigs : mapping, optional
        Experiment -> rig to use instead.

    Returns
    -------
    dict of Experiment
        Results by name, in the order of `EXPERIMENTS`.

    Raises
    ------
    CampaignError, RigError, SimulationError
        If a campaign fails.
    """
    from pneudrive.batching import in_processes

    jobs = [
        (name, protocol, str((rigs or {}).get(name, rig)), str(Path(into) / protocol), seed)
        for name, (protocol, rig) in EXPERIMENTS.items()
    ]
    return {experiment.name: experiment for experiment in in_processes(run_experiment, jobs)}


def run_experiment(name: str, protocol: str, rig: str, into: str, seed: int) -> Experiment:
    """Run one campaign."""
    from pneudrive.campaign.run import Options, run_campaign
    from pneudrive.rig import load_rig

    bench = load_rig(rig, seed=seed)
    done = run_campaign(protocol, bench, into, options=Options(yes=True))
    return Experiment(name, protocol, rig, done.campaign, bench.limits())

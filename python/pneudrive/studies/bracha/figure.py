"""The source paper's experiments on simulated rigs, figures of their data, and verdicts on the paper's sentences."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.campaign.storage.control import write_whole
from pneudrive.errors import CampaignError, package_table
from pneudrive.files.content import read_json
from pneudrive.rig.interface import Move, Step

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.arrays import Array, Columns, Keyed, NamedNumbers, Plain
    from pneudrive.campaign.storage.folder import Campaign
    from pneudrive.rig import Envelope, Identity
    from pneudrive.rig.machine import Machine, Past
    from pneudrive.rig.motion import Motion


#: Experiment -> (ready protocol, argument of `load_rig`). The paper does not describe its rigs: the first is assumed to
#: be without pressure, the second with equal pressure in both chambers.
EXPERIMENTS = {
    "cycle": ("paper-cycle", "open-chambers"),
    "speed": ("paper-speed", "open-chambers"),
    "pressure": ("paper-pressure", "common-manifold"),
    "stops": ("paper-stops", "open-chambers"),
}
#: File in the folder of a campaign: key of a cycle -> speed and true friction of its strokes.
TRUE_STROKES = "true-strokes.json"
#: Seed of the simulated sensors.
SEED = 0
#: Relative deviation up to which the commanded speed counts as reached.
AT_SPEED = 1e-3


def true_strokes(run: Campaign) -> list[list[tuple[float, float | None]]]:
    """Return speed and true friction of the strokes of each cycle in running order, see `run_experiment`."""
    return list(read_json(run.path / TRUE_STROKES, CampaignError).values())


def run_experiments(into: str | Path) -> dict[str, Campaign]:
    """Run the campaigns, each in its own process.

    Parameters
    ----------
    into : path-like
        Folder for the campaign folders; finished cycles are not run again.

    Returns
    -------
    dict of Campaign
        Finished campaigns by name, in the order of `EXPERIMENTS`.

    Raises
    ------
    CampaignError, RigError, SimulationError
        If a campaign fails.
    """
    from pneudrive.batching import in_processes

    jobs = [(protocol, rig, str(Path(into) / protocol), SEED) for protocol, rig in EXPERIMENTS.values()]
    return dict(zip(EXPERIMENTS, in_processes(run_experiment, jobs), strict=True))


def run_experiment(protocol: str, rig: str, into: str, seed: int) -> Campaign:
    """Run one campaign; store speed and mean true friction at constant speed, N, of every stroke."""
    from pneudrive.campaign.run import Options, run_campaign
    from pneudrive.rig import load_rig

    bench, path = load_rig(rig, seed=seed), Path(into) / TRUE_STROKES
    strokes: dict[str, list] = read_json(path, CampaignError) if path.exists() else {}

    def observe(machine: Machine, before: Past, step: Step, motion: Motion, true: Columns) -> None:
        if isinstance(step, Move):
            stroke = (step.speed_m_s, _friction_n(step, motion, true))
            strokes.setdefault(before.key, []).append(stroke)

    def store(document: str, content: Plain) -> None:
        if document == "event":  # a cycle is finished
            write_whole(path, json.dumps(strokes).encode(), flush=False)

    bench.observe = observe  # type: ignore[attr-defined] - of a simulated rig
    return run_campaign(protocol, bench, into, options=Options(yes=True), subscribers=(store,)).campaign


def _friction_n(step: Move, motion: Motion, true: Columns) -> float | None:
    """Return the mean true friction of a stroke while its commanded speed is constant; None for a short stroke."""
    direction = 1.0 if step.to_m > motion.start_m else -1.0
    commanded = motion.at(true["time_s"])[1] * direction
    steady = np.abs(commanded - step.speed_m_s) < AT_SPEED * step.speed_m_s
    if np.count_nonzero(steady) < 2:
        return None
    time, friction = true["time_s"][steady], true["friction_force_n"][steady]
    return direction * float(np.trapezoid(friction, time) / (time[-1] - time[0]))


#: The paper's sentences and our results, with placeholders for numbers.
TEXTS = Path(__file__).with_name("figures.toml")
#: Suffix of a quantity's name in SI -> suffix of its name in texts with the usual unit, and number of usual units per
#: SI unit. The first match applies.
READABLE = {
    "_n_pa": ("_n_bar", 1e5),
    "_m_s": ("_mm_s", 1e3),
    "_pa": ("_bar", 1e-5),
    "_m": ("_mm", 1e3),
    "_share": ("_percent", 100.0),
}


@dataclass(frozen=True)
class Claim:
    """A sentence of the source paper that is checked by simulated data.

    Attributes
    ----------
    place : str
        Location of the sentence in the paper [bracha]: ``figure 8``, ``conclusions``, ``equations 2 and 3``.
    said : str
        Words of the paper or of a caption. ``...`` marks omissions.
    verdict : {"holds", "holds in part", "does not hold"}
        Verdict from our data. For "holds in part", `found` states which part does not hold.
    found : str
        Our result, with the decisive numbers.
    """

    place: str
    said: str
    verdict: str
    found: str


def judge(whole: object, *, part: object) -> str:
    """Return a verdict from two tests: of the whole sentence, and of a part."""
    return "holds" if whole else "holds in part" if part else "does not hold"


def claims_of(topic: str, verdicts: Mapping[str, str], numbers: Keyed) -> tuple[Claim, ...]:
    """Return the sentences of a topic with verdicts and numbers."""
    said, shown = package_table(__file__, TEXTS.name)[topic]["claims"], readable(numbers)
    return tuple(
        Claim(one["place"], one["said"], verdicts[name], one["found"].format(**shown)) for name, one in said.items()
    )


def readable(numbers: Keyed) -> Plain:
    """Return the quantities, each in SI and in its usual unit.

    Examples
    --------
    >>> readable({"step_m": 0.002, "stuck_share": 0.5})
    {'step_m': 0.002, 'step_mm': 2.0, 'stuck_share': 0.5, 'stuck_percent': 50.0}
    """
    out = {}
    for name, value in numbers.items():
        out[name] = value
        end = next((end for end in READABLE if name.endswith(end)), None)
        if end is not None:
            other, factor = READABLE[end]
            out[name.removesuffix(end) + other] = factor * value
    return out


@dataclass(frozen=True)
class PaperFigure:
    """Data of one figure, and verdicts on the paper's sentences about it.

    Attributes
    ----------
    number : int
        Number of the figure in the source paper [bracha].
    title : str
    claims : tuple of Claim
        All checkable sentences of the paper about this figure.
    measured : str
        The result in words.
    quantities : dict
        Numbers of the result, SI.
    columns : dict
        Name with unit -> array; the arrays of a figure have matching shapes (curves over pressure are 2-D).
    assumed : str
        Assumptions of the simulated rig beyond the paper.
    rig : (Identity, Envelope) or None
        Rig that the figure shows, if any.
    """

    number: int
    title: str
    claims: tuple[Claim, ...]
    measured: str
    quantities: NamedNumbers
    columns: dict[str, Array] = field(repr=False)
    assumed: str = ""
    rig: tuple[Identity, Envelope] | None = field(default=None, repr=False)

    @classmethod
    def make(
        cls,
        number: int,
        verdicts: Mapping[str, str],
        quantities: Keyed,
        columns: Columns,
        rig: tuple[Identity, Envelope] | None = None,
        **more: object,
    ) -> PaperFigure:
        """Return a figure from these numbers. The numbers in `more` are used only in its texts."""
        found = {name: float(value) for name, value in quantities.items()}
        texts, numbers = package_table(__file__, TEXTS.name)[str(number)], {**found, **more}
        claims = claims_of(str(number), verdicts, numbers)
        measured = texts["measured"].format(**readable(numbers))
        return cls(number, texts["title"], claims, measured, found, columns, texts.get("assumed", ""), rig)

"""The whole study: campaigns and simulations, checked sentences, and sections of the report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise import Characterisation, characterise_recordings
from pneudrive.figures import MEASURED, MODEL, Figure, Line, Panel, thin
from pneudrive.identify.static.fit import fit_characterisation
from pneudrive.report.page import Addition, Paragraph, Topic, plural, sentence
from pneudrive.report.strokes import DrawnMotion, in_time, phase_plane, recovered, recovered_section
from pneudrive.rig import SimulatedRig, shipped_rigs, sweep
from pneudrive.studies.bracha.figure import EXPERIMENTS, SEED, TEXTS, readable, run_experiments
from pneudrive.studies.bracha.figures import DRAWINGS, paper_figures
from pneudrive.studies.bracha.general import (
    AS_PRINTED,
    ENERGY_BALANCE,
    FULL_STROKE,
    compare_chamber_laws,
    general_claims,
)
from pneudrive.studies.bracha.stick_slip import SLOW_DRIVE
from pneudrive.views import ShownFigure

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from pneudrive.report.page import Block, Fits, Section
    from pneudrive.rig.description import RigDescription
    from pneudrive.studies.bracha.figure import Claim, PaperFigure
    from pneudrive.studies.bracha.general import ChamberComparison

#: Folder of the campaigns, next to the report.
FOLDER = "campaigns"
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
        Rig of the recordings with known true values.
    figures : dict of PaperFigure
        Figures by number in the source paper.
    rigs : tuple of RigDescription
        Rigs of the figures.
    found : Characterisation
        Result of simulated recordings with known true values.
    fits : dict
        Group -> law -> fit of those recordings.
    chambers : ChamberComparison
        Comparison of the printed equations with the energy balance.
    claims : tuple of Claim
        All checkable sentences of the paper, with verdicts.
    """

    rig: SimulatedRig
    figures: Mapping[int, PaperFigure]
    rigs: tuple[RigDescription, ...]
    found: Characterisation
    fits: Fits
    chambers: ChamberComparison
    claims: tuple[Claim, ...]

    def addition(self, found: Characterisation | None) -> Addition:
        """Return the study's addition to the report of `found`; None: a complete report of the study."""
        own = found is not None and found.synthetic  # such recordings have their own comparison with the ground truth
        parts = (
            None if own else recovered_section(self.found),
            paper(self.figures, self.claims),
            stick_slip([self.figures[n] for n in STICK_SLIP if n in self.figures]),
            chambers(self.chambers),
        )
        lines = verdict(self, alone=found is None)
        solver = str(self.chambers.runs[ENERGY_BALANCE].attrs["solver"])
        return Addition(
            title="The source paper's figures from a simulated rig",
            verdict=tuple(lines),
            sections=tuple(part for part in parts if part is not None),
            validity=Topic(PAGE, "provenance").say("validity"),
            settings=(("solver of the simulations", solver), ("seed of the simulated sensors", str(SEED))),
            sources=tuple(values(self.rig.description, self.rigs)),
            cited=("bracha", *(key for run in self.chambers.runs.values() for key in run.attrs["citations"])),
            laws=("lugre", "stribeck"),
        )


def reproduce(into: str | Path) -> Reproduction:
    """Run the source paper's experiments on simulated rigs and a drive, and make its figures 1 to 9.

    Parameters
    ----------
    into : path-like
        Folder for the campaigns; finished cycles are not run again.

    Returns
    -------
    Reproduction

    Raises
    ------
    CampaignError
        If the folder cannot be used.
    """
    runs = run_experiments(into)
    rig = SimulatedRig.default()
    recordings = sweep(rig, np.geomspace(*RECOVERY_SPEEDS_M_S), RECOVERY_GAUGES_PA, count=RECOVERY_CYCLES, seed=SEED)
    found = characterise_recordings(recordings)
    fits, _ = fit_characterisation(found)
    names = dict.fromkeys(name for _, name in EXPERIMENTS.values())
    rigs = tuple(SimulatedRig.load(shipped_rigs()[name]).description for name in names)
    figures, chamber_laws = paper_figures(runs), compare_chamber_laws()
    claims = tuple(claim for figure in figures.values() for claim in figure.claims)
    claims += general_claims(chamber_laws, figures)
    return Reproduction(rig, figures, rigs, found, fits, chamber_laws, claims)


# --- Additions of the study to a report: verdict, sections, provenance.

PAGE = Path(__file__).with_name("page.toml")
STICK_SLIP = (1, 2, 3)
LINES = {ENERGY_BALANCE: (MEASURED, "energy balance"), AS_PRINTED: (MODEL, "as printed")}


def verdict(made: Reproduction, *, alone: bool) -> Iterator[str]:
    """Yield the results as a few lines, or as one line."""
    topic, pairs = Topic(PAGE, "verdict"), recovered(made.found)
    first = topic.say("paper", count=count_verdicts(made.claims))
    truth = "" if pairs is None else topic.say("recovered", inside=pairs["is_inside"].sum(), all=pairs.height)
    if not alone:
        yield f"{first}; {truth}."
        return
    yield f"{first}."
    yield f"{truth[:1].upper()}{truth[1:]}, U with k = 2."
    slip = made.figures.get(2) or made.figures.get(1)
    if slip is not None:
        yield topic.say("slip", **readable(slip.quantities))
    c = made.chambers
    yield topic.say(
        "chambers",
        stroke_percent=100 * (c.stroke_time_s[AS_PRINTED] / c.stroke_time_s[ENERGY_BALANCE] - 1),
        temperature_k=c.largest_difference("temperature_b"),
        residual_j=c.energy_residual_j[AS_PRINTED],
        work_j=c.stroke_work_j,
    )


def count_verdicts(claims: Sequence[Claim]) -> str:
    """Return, as text, the numbers of sentences that hold, hold in part, and do not hold.

    Examples
    --------
    >>> from pneudrive.studies.bracha.figure import Claim
    >>> count_verdicts([Claim("figure 1", "It moves", "holds", "it does")])
    '1 of 1 sentence that can be checked holds, 0 hold in part, 0 do not hold'
    """
    whole, part, none = (sum(c.verdict == v for c in claims) for v in ("holds", "holds in part", "does not hold"))
    words = {"hold": "holds" if whole == 1 else "hold", "do": "does" if none == 1 else "do"}
    sentences = plural(len(claims), "sentence")
    return Topic(PAGE, "verdict").say("count", whole=whole, sentences=sentences, part=part, none=none, **words)


def paper(figures: Mapping[int, PaperFigure], claims: Sequence[Claim]) -> Section:
    """Return the section with all verdicts and figures 4 to 9. The section on stick-slip has figures 1 to 3."""
    topic, unchecked = Topic(PAGE, "paper"), Topic(TEXTS, "unchecked").texts
    failed = any(c.verdict == "does not hold" for c in claims)
    return topic.section(
        topic.text(),
        Paragraph(sentence(count_verdicts(claims)), "fails" if failed else "holds"),
        topic.table((c.place, f"“{c.said}”", sentence(c.found), c.verdict) for c in claims),
        *topic.listed((f"“{said}”: {why}." for said, why in unchecked.items()), "unchecked"),
        *topic.listed((f"Figure {f.number}: {f.assumed}." for f in figures.values() if f.assumed), "assumed"),
        topic.text("campaigns"),
        topic.text("holds", "note"),
        *(_picture(topic, figures[number], *drawn) for number, drawn in DRAWINGS.items() if number in figures),
        synthetic=True,
    )


def _picture(topic: Topic, figure: PaperFigure, name: str, drawing: Callable[[PaperFigure], Figure]) -> ShownFigure:
    caption = topic.say("caption", number=figure.number, title=figure.title, measured=sentence(figure.measured))
    return ShownFigure(f"paper-{figure.number}-{name}", caption, drawing(figure))


def stick_slip(figures: Sequence[PaperFigure]) -> Section | None:
    """Return the section on figures 1 to 3: numbers, over time, in the phase plane; None without them."""
    if not figures:
        return None
    topic, rows, shown = Topic(PAGE, "stick-slip"), [], []
    for f in figures:
        c, q, law = f.columns, readable(f.quantities), topic.say(str(f.number))
        numbers = (q["mean_speed_mm_s"], q["periods"], q["period_s"], q["step_mm"], q["peak_ratio"], q["stuck_percent"])
        rows.append((str(f.number), law, *numbers))
        columns = (c["time_s"], c["position_m"], c["velocity_m_s"])
        shown.append(DrawnMotion(f"figure {f.number}: {law}", *columns, q["mean_speed_m_s"]))
    return topic.section(
        topic.text(),
        topic.table(rows),
        topic.figure("stick-slip-time", in_time(shown)),
        topic.figure("stick-slip-phase", phase_plane(shown)),
        synthetic=True,
    )


def chambers(compared: ChamberComparison) -> Section:
    """Return the section on the errors of equations (2) and (3) of the paper, with numbers and curves over time."""
    topic, laws = Topic(PAGE, "chambers"), (ENERGY_BALANCE, AS_PRINTED)
    gas = {side: [compared.runs[law][f"temperature_{side}"] for law in laws] for side in "ab"}
    rows = (
        ("time of the stroke out, s", *(f"{compared.stroke_time_s[law]:.4f}" for law in laws)),
        *(
            (f"gas in chamber {side}, K", *(f"{float(t.min()):.0f} … {float(t.max()):.0f}" for t in runs))
            for side, runs in gas.items()
        ),
        ("energy of chamber a from nowhere, J", *(f"{compared.energy_residual_j[law]:.1f}" for law in laws)),
        ("largest difference of position, mm", None, f"{1e3 * compared.largest_difference('position'):.1f}"),
        ("largest difference of pressure a, bar", None, f"{1e-5 * compared.largest_difference('pressure_a'):.2f}"),
        ("largest difference of temperature b, K", None, f"{compared.largest_difference('temperature_b'):.0f}"),
    )
    residual = compared.energy_residual_j[AS_PRINTED]
    return topic.section(
        topic.text(),
        topic.table(rows),
        topic.figure("chamber-laws", draw_chambers(compared)),
        topic.text("energy", "note", residual_j=residual, work_j=compared.stroke_work_j),
        synthetic=True,
    )


def draw_chambers(compared: ChamberComparison) -> Figure:
    """Draw position and its difference, pressures and temperatures over time."""
    balanced, printed = (compared.runs[law] for law in LINES)
    part = thin(balanced.time)
    time = balanced.time[part]

    def lines(name: str) -> list[Line]:
        return [Line(time, compared.runs[law][name][part], words, own) for law, (own, words) in LINES.items()]

    quantities = (("pressure", "pressure {} / bar abs"), ("temperature", "gas temperature {} / K"))
    panels = [
        Panel(lines("position"), y="position / mm"),
        Panel([Line(time, (printed.position - balanced.position)[part])], y="difference / mm"),
        *(Panel(lines(f"{name}_{side}"), y=label.format(side)) for name, label in quantities for side in "ab"),
    ]
    return Figure(panels, "time / s", columns=2, row_in=1.45, rest_in=0.1, share_x="all")


def values(rig: RigDescription, rigs: Iterable[RigDescription]) -> Iterator[Block]:
    """Return the values of the default rig, the values that differ in other rigs, and the values of the drives."""
    topic, base = Topic(PAGE, "provenance"), rig.sources
    for name, sources in {rig.name: base, **{one.name: one.sources for one in rigs}}.items():
        own = sources if sources is base else {k: s for k, s in sources.items() if s != base.get(k)}
        only = "" if sources is base else topic.say("only")
        yield topic.text("values", rig=f"{name[0].lower()}{name[1:]}", only=only)
        yield topic.table((key, s.value, s.source, s.reason) for key, s in own.items())
    yield topic.text("drives")
    for path in (SLOW_DRIVE, FULL_STROKE):
        yield Paragraph(path.read_text(encoding="utf-8").strip(), "code")

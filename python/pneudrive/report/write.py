"""The report of recordings: its sections in order, and those of a study."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pneudrive.report import provenance, style
from pneudrive.report.campaign import course
from pneudrive.report.campaign import curves as campaign_curves
from pneudrive.report.campaign import run as campaign_run
from pneudrive.report.page import Report
from pneudrive.report.recording import (
    closure,
    loops,
    measured,
    pressure,
    record,
    recovered,
    speed,
    stick_slip,
    strokes,
    uncertainty,
)
from pneudrive.report.recording.verdict import lines_of

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.report.page import Section
    from pneudrive.report.study import Addition, Fits, Study


#: Sections that recordings share with campaigns; a section without data is None.
CURVES = (
    campaign_curves.curves,
    campaign_curves.pressure,
    campaign_curves.direction,
    course.position,
    course.repeatability,
    course.stick_slip,
    campaign_run.said,
    campaign_run.budget,
)


@style.applied()
def write_report(
    found: Characterisation | None,
    fits: Fits,
    folder: str | Path,
    reproduction: Study | None = None,
    curves: CampaignCharacteristics | None = None,
) -> Path:
    """Write report.html, which loads nothing from anywhere, and its figures as PNG and SVG.

    Parameters
    ----------
    found : Characterisation or None
        Result of recordings, real or simulated.
    fits : mapping
        Group -> law -> FrictionFit; may be empty.
    folder : path-like
        Must be there; figures go into its folder ``figures``.
    reproduction : Reproduction, optional
        Adds the sections of the source paper; any study with an `addition` fits.
    curves : CampaignCharacteristics, optional
        Curves, effects and statements of the recordings, from ``recorded_characteristics``.

    Returns
    -------
    pathlib.Path
        Folder of report.html.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    study = None if reproduction is None else reproduction.addition(found)
    lines = lines_of(found, fits, () if study is None else study.verdict)
    synthetic = found is not None and found.synthetic
    return Report(_title(found, study), lines, sections(found, fits, study, curves), synthetic).write(folder)


def sections(
    found: Characterisation | None, fits: Fits, study: Addition | None, curves: CampaignCharacteristics | None = None
) -> list[Section]:
    """Return all sections with data, in the report's order."""
    parts: dict[str, Section] = {}
    own = (*(_of_recordings(found, fits) if found is not None else ()), *(study.sections if study else ()))
    of_curves = () if curves is None else tuple(section(curves) for section in CURVES)
    for part in (*own, *of_curves):
        if part is not None:
            before = parts.pop(part.key, None)
            parts[part.key] = part if before is None else replace(before, blocks=before.blocks + part.blocks)
    return [*parts.values(), provenance.section(found, study)]


def _of_recordings(found: Characterisation, fits: Fits) -> tuple[Section | None, ...]:
    return (
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
        stick_slip.section(found),
    )


def _title(found: Characterisation | None, study: Addition | None) -> str:
    if found is None:
        return study.title if study is not None else "Nothing"
    title = "Friction of simulated recordings" if found.synthetic else "Friction of a pneumatic piston from recordings"
    return f"{title}, with a simulated rig" if study is not None and not found.synthetic else title

"""``pneudrive characterise``: friction map, fit and report from recordings or a campaign folder."""

from __future__ import annotations

import shutil
import sys
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.cli.options import Layout, Results, Samples, one_of
from pneudrive.cli.output import file_name, show_lines, show_view, tell, writable_folder
from pneudrive.cli.progress import on_terminal
from pneudrive.errors import Cancelled

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.friction.motion import SampleChoice
    from pneudrive.identify.static.result import FrictionFit

Fits = dict[str, dict[str, "FrictionFit"]]


def characterise(
    recordings: list[Path],
    layout: Layout = None,
    out: Results = Path("characterisation"),
    protocol: Samples = "settled",
    law: str = "stribeck",
) -> None:
    """Evaluate recordings or a campaign: friction with uncertainty.

    The files are map.parquet, map.csv, fit.toml and report.html.

    Also writes curves.parquet, effects.toml, and statements on the data.
    Each seal and mounting has its own curves and fit.

    Options
    -------
    recordings : RECORDING...|FOLDER|CAMPAIGN
        Recordings, also compressed (.gz, .xz, .bz2); their folder with layout.toml; or a campaign folder.
    law
        Friction law of fit.toml: coulomb or stribeck.
    """
    from pneudrive.friction.campaign.characteristics import recorded_characteristics
    from pneudrive.friction.campaign.files import write_curves_and_effects
    from pneudrive.friction.characterisation import characterise_recordings
    from pneudrive.friction.conditions import ALL_RECORDINGS
    from pneudrive.friction.friction_map import write_map
    from pneudrive.friction.motion import SAMPLE_CHOICES
    from pneudrive.identify.static.fit import LAWS, fit_characterisation
    from pneudrive.report import write_report
    from pneudrive.signals.load import recordings_in
    from pneudrive.validate.closure import close_balance

    choice = one_of("--protocol", protocol, SAMPLE_CHOICES)()
    one_of("--law", law, dict.fromkeys(LAWS))
    recordings = [file for path in recordings for file in (path.is_dir() and recordings_in(path)) or [path]]
    if any(path.is_dir() for path in recordings):
        _campaign(recordings, layout, out, choice, law)
        return
    with _output(out) as folder:
        watch = on_terminal()
        found = characterise_recordings(list(recordings), layout, choice, progress=watch.tell)
        written = [write_map(found.friction_map, folder / name) for name in ("map.parquet", "map.csv")]
        fits, problems = fit_characterisation(found)
        written += _write_fits(fits, law, folder, whole=ALL_RECORDINGS)
        curves = recorded_characteristics(found)
        written += [] if curves is None else write_curves_and_effects(curves, folder)
        written.append(Path(write_report(found, fits, folder, None, curves)))
    for problem in problems:
        sys.stderr.write(f"Note: no fit of {problem}\n")
    show_view(found.view())
    balances = [close_balance(recording) for recording in found.recordings if recording.force_n.any()]
    show_lines(f"- {balance}." for balance in balances if balance.gains)
    if curves is not None:
        show_view(replace(curves.view(), rows=()))
    tell(written)


def _campaign(recordings: list[Path], layout: Path | None, out: Path, choice: SampleChoice, law: str) -> None:
    """Characterise one campaign folder."""
    from pneudrive.errors import CommandError
    from pneudrive.friction.campaign.characteristics import campaign_friction
    from pneudrive.friction.campaign.dependences import ALL, fit_campaign
    from pneudrive.friction.campaign.files import write_characteristics
    from pneudrive.report.campaign.page import write_campaign_report

    if len(recordings) > 1 or layout is not None:
        raise CommandError(
            "a campaign cannot be characterised together with other files",
            value=" ".join(str(path) for path in recordings) + (f" --layout {layout}" if layout else ""),
            rule="one folder, no recordings and no layout",
            remedy="To compare two campaigns: pneudrive compare A B.",
        )
    with _output(out) as folder:
        found = campaign_friction(recordings[0], choice, progress=on_terminal().tell)
        written = write_characteristics(found, folder)
        fits, problems = fit_campaign(found)
        written += _write_fits(fits, law, folder, whole=ALL if len(fits) != 1 else next(iter(fits)))
        written.append(write_campaign_report(found, folder))
    for problem in problems:
        sys.stderr.write(f"Note: no fit of {problem}\n")
    show_view(found.view())
    tell(written)


@contextmanager
def _output(out: Path) -> Iterator[Path]:
    """Make the output folder before any work. Remove a new folder if it stays empty or the work is cancelled."""
    is_new = not out.exists()
    writable_folder(out)
    try:
        yield out
    except (KeyboardInterrupt, Cancelled):  # a map without its fit and report is no result
        if is_new:
            shutil.rmtree(out)
            is_new = False
        raise
    finally:
        if is_new and not any(out.iterdir()):
            out.rmdir()


def _write_fits(fits: Fits, law: str, folder: Path, whole: str) -> list[Path]:
    """Write fit.toml for all data, and fit-GROUP.toml for each group."""
    written = []
    for group, by_law in fits.items():
        if law in by_law:
            name = "fit.toml" if group == whole else f"fit-{file_name(group)}.toml"
            by_law[law].to_toml(folder / name)
            written.append(folder / name)
    return written

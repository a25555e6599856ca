"""Section "Size": drives for a task, data sheets, and single characteristics."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from pneudrive.cli.options import number_or_text, pairs_in
from pneudrive.cli.terminal import check_outputs, show_lines, show_paths, show_table, show_view, watch, write_outputs
from pneudrive.errors import CommandError
from pneudrive.lazy_names import used_later

with used_later(__name__):
    from pneudrive.datasheet import characteristic as kinds
    from pneudrive.datasheet import registry, sheet
    from pneudrive.describe.files import load
    from pneudrive.report import datasheet as sheet_page
    from pneudrive.simulation import trajectory
    from pneudrive.sizing import result, search

if TYPE_CHECKING:
    import xarray as xr


EXIT_INTERRUPTED = 130


def size(
    task: Path,
    *,
    out: Path | None = None,
    max_candidates: int = 160,
    samples: int = 256,
) -> None:
    """Find the drives of the catalogue that meet a task.

    Candidates are simulated over given spreads and ranked by air and margin.

    A provisional answer by nominal runs comes first. Ctrl-C ends the search and keeps its results; the same command
    with --out continues. If no drive meets the task, the nearest feasible value of each quantity is shown.

    Options
    -------
    task : TASK
        Task file (TOML).
    out : DIR
        Folder for report, ranking and circuit files (ten best, and each cylinder); an unfinished search is resumed.
    max_candidates : N
        Largest number of choices of parts that are tuned.
    samples
        Samples of each choice; the ten best have four times as many.

    Examples
    --------
    pneudrive size task.toml --out sized
    """
    found = search.size(
        task,
        progress=watch().tell,
        most=max_candidates,
        draws=samples,
        draws_best=search.DRAWS_BEST_OF * samples,
        out=out,
        provisional=lambda made: show_lines(made.answer),
    )
    show_view(found.view())
    if out is not None:
        page = found.report(out)
        tables = (out / name for name in (result.TABLE, result.SUMMARY, result.REASONS))
        show_paths(*sorted(out.glob("*.toml")), *tables, page)
    if found.interrupted:
        raise typer.Exit(EXIT_INTERRUPTED)


def datasheet(
    drive: str,
    recordings: list[Path] | None = None,
    *,
    layout: Path | None = None,
    out: Path = Path("datasheet.html"),
) -> None:
    """Write a data sheet of a drive, with standards and sources.

    Options
    -------
    recordings : [RECORDING|MAP|CAMPAIGN]...
        Recordings of the drive, or of its piston alone, or one friction map or campaign.
    out
        Page: .html or .pdf.

    Examples
    --------
    pneudrive datasheet drive.toml --out sheet.html
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    check_outputs(out, sheet_page.SUFFIXES)
    found = sheet.build(load.load_described(drive), recordings or [], layout, watch())
    show_view(found.view())
    show_paths(sheet_page.write_datasheet(found, out))


def characteristic(
    drive: str,
    name: str = "",
    *,
    set: list[str] | None = None,  # noqa: A002 - the name of the option
    out: Path | None = None,
    plot: Path | None = None,
) -> None:
    """Show a characteristic of a drive, with definition and standard.

    Options
    -------
    name : NAME
        Name; without a name, all are listed.
    set : NAME=VALUE
        A setting, "command = 0.6"; repeatable.
    out
        All results: .csv or .nc (netCDF).

    Examples
    --------
    pneudrive characteristic drive.toml stiffness
    """
    if not name:
        rows = [(each.name, each.title, each.standard or "-") for each in registry.characteristics().values()]
        show_table(("characteristic", "<title", "<standard"), rows)
        return
    check_outputs(out, (".csv", ".nc"), plot)
    kind = registry.characteristic_named(name)
    texts = pairs_in("--set", set or (), "command = 0.6")
    settings: dict[str, Any] = {}
    for key, text in texts.items():  # commas separate several values
        values = [number_or_text(part.strip()) for part in text.split(",")]
        default, _ = kind.settings.get(key, (None, ""))
        is_list = isinstance(default, tuple) or (default is None and key.endswith("s"))
        if len(values) > 1 and not is_list:
            raise CommandError(f"{key} = {text} has several values", rule=f"{kind.name} accepts only one {key}")
        settings[key] = values if is_list else values[0]
    found = registry.UncertainDrive(load.load_described(drive)).characteristic(name, watch(), **settings)
    show_view(sheet_page.characteristic_view(found))
    write_outputs((out, partial(_save, found)), (plot, partial(sheet_page.plot_characteristic, found)))


def _save(found: xr.Dataset, path: Path) -> None:
    """Write all results in SI: rows of a table, or the data set as netCDF."""
    import polars as pl

    if path.suffix.lower() == ".nc":
        trajectory.save(found, path)
        return
    about = {str(name): (values.attrs["units"], values.attrs["long_name"]) for name, values in found.data_vars.items()}
    rows = [(*row, *about[row[0]]) for row in kinds.value_rows(found)]
    names = ("result", "at", "value", "low", "high", "unit", "meaning")
    trajectory.write_frame(pl.DataFrame(rows, names, orient="row", strict=False, infer_schema_length=None), path)

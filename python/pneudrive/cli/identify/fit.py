"""``pneudrive fit``: fit friction laws to a map, recordings, or a campaign."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pneudrive.cli.options import Layout, Page, Profile, names_in, option
from pneudrive.cli.output import file_name, tell_fit
from pneudrive.cli.progress import on_terminal

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr

    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.identify.static.laws import LawComparison
    from pneudrive.identify.static.result import FrictionFit

MOST_NAMED = 6  # largest number of values of a label in a message
MAP_SUFFIXES = (".parquet", ".csv")


def fit(
    source: list[Path],
    laws: str = "",
    pressure: str = "",
    hold_out: str = "",
    direction: str = "both",
    by: str = "",
    loss: str = "huber",
    ambient: str = "",
    layout: Layout = None,
    profile: Profile = False,
    report: Page = None,
    out: Path = Path("fit.toml"),
) -> None:
    """Fit friction laws to a friction map and recommend one.

    Laws are compared by AICc, BIC and cross-validation over conditions. The cross-validation decides.

    Options
    -------
    source : MAP|RECORDING...
        Friction maps (map.parquet, map.csv) or campaigns, one or several; or recordings.
    laws : LAW,...
        Laws to compare, separated by commas; a single law is fitted. Default: all.
    pressure
        Dependence on pressure: none, linear, quadratic, saturating, interaction. Default: all.
    hold_out
        Groups for cross-validation: pressure, speed, recording, or a column of the map.
    direction
        both, +x or -x.
    by
        Column of the map, such as seal: one fit for each of its values.
    loss
        huber, soft-l1, tukey, or linear (not robust).
    ambient
        Ambient pressure, if the map lacks it.
    out
        Fit file to write; with --by one file for each value.
    """
    from pneudrive.errors import CommandError, nearest
    from pneudrive.friction.campaign.dependences import NO_POINTS, with_dependences
    from pneudrive.identify.static.laws import CANDIDATES
    from pneudrive.identify.static.model import PRESSURE_FORMS

    names = names_in(laws) or list(CANDIDATES)
    for name in names:
        if name not in CANDIDATES:
            raise CommandError(f"--laws {name!r} is not known", remedy=nearest(name, CANDIDATES))
    if pressure not in ("", "none", *PRESSURE_FORMS):
        raise CommandError(f"--pressure {pressure} is not known", remedy=nearest(pressure, ("none", *PRESSURE_FORMS)))
    turn = {"both": None, "+x": 1, "-x": -1}
    if direction not in turn:
        raise CommandError(f"--direction {direction} is not known", rule="both, +x or -x")
    if out.suffix != ".toml" or not out.parent.is_dir():
        raise CommandError(f"--out {out}: a fit cannot be written there", rule="FILE.toml in a folder that exists")
    curves, campaign = _map_of(source, layout)
    options = {"direction": turn[direction], "loss": loss, "ambient_pressure_pa": _ambient(curves, ambient)}
    options["exclude_flags"] = () if campaign is None else NO_POINTS  # as characterise does
    for note in _averaged(curves, by):
        typer.echo(f"! {note}")
    for group, part, curve_fit, comparison in _each_fitted(curves, by, names, pressure, hold_out, options):
        fitted = curve_fit if campaign is None else with_dependences(curve_fit, campaign, part)
        if comparison is not None:
            typer.echo(str(comparison))
        slug = file_name(group)
        target = out.with_stem(f"{out.stem}-{slug}") if group else out
        tell_fit(fitted, target, report and report / slug, profile=profile)
    for statement in _seals(curves, by, options["ambient_pressure_pa"], turn[direction]):
        typer.echo(f"- {statement}")


def _map_of(source: list[Path], layout: Path | None) -> tuple[xr.Dataset, CampaignCharacteristics | None]:
    """Read a friction map, or make it from recordings.

    The second result contains the other measurements of a single campaign.
    """
    from pneudrive.errors import CommandError, PneudriveError
    from pneudrive.friction.campaign.characteristics import campaign_friction
    from pneudrive.friction.characterisation import characterise_recordings
    from pneudrive.friction.friction_map import read_map

    missing = next((path for path in source if not path.exists()), None)
    if missing is not None:
        raise CommandError(f"there is no {missing}", rule="a friction map, recordings, or the folder of a campaign")
    finished = [path for path in source if path.is_dir() or path.suffix == ".parquet"]
    if finished and len(finished) < len(source):
        raise CommandError(
            "either campaigns and friction maps, or recordings",
            value=" ".join(map(str, source)),
            remedy="First make a map of the recordings: pneudrive characterise.",
        )
    if finished:
        found = [campaign_friction(one) if one.is_dir() else None for one in finished]
        maps = [read_map(one) if own is None else own.friction_map for one, own in zip(finished, found, strict=True)]
        if len(maps) == 1:
            return maps[0], found[0]
        if any(path.is_dir() for path in finished):
            typer.echo("- the fit of several campaigns contains only the curve over speed and pressure", err=True)
        return _joined(finished, maps), None
    if len(source) == 1 and source[0].suffix in MAP_SUFFIXES and layout is None:
        with suppress(PneudriveError):
            return read_map(source[0]), None
    return characterise_recordings(list(source), layout, progress=on_terminal().tell).friction_map, None


def _joined(paths: list[Path], maps: list[xr.Dataset]) -> xr.Dataset:
    """Join the rows of several maps. Each map keeps its gauge pressures at any ambient pressure."""
    import numpy as np
    import xarray as xr

    from pneudrive.constants import STANDARD_ATMOSPHERE_PA

    ambient = [float(one.attrs.get("ambient_pressure_pa", STANDARD_ATMOSPHERE_PA)) for one in maps]
    common = [str(name) for name in maps[0] if name != "ambient_pressure_pa" and all(name in one for one in maps)]
    parts = []
    for path, one, air in zip(paths, maps, ambient, strict=True):
        names = np.array([f"{path}: {name}" for name in one["recording"].to_numpy()], dtype=object)
        gauges = {name: one[name] + (ambient[0] - air) for name in ("pressure_a_pa", "pressure_b_pa")}
        parts.append(one[common].assign(gauges | {"recording": ("row", names)}))
    joined = xr.concat(parts, "row", combine_attrs="drop")
    return joined.assign_attrs(
        {} if "ambient_pressure_pa" not in maps[0].attrs else {"ambient_pressure_pa": ambient[0]}
    )


def _seals(curves: xr.Dataset, by: str, ambient_pa: float, direction: int | None) -> list[str]:
    """Return sentences on the spread between several seals of one map, if each was fitted."""
    from pneudrive.errors import FitError
    from pneudrive.identify.static.survey import survey

    if by != "seal" or "seal" not in curves or len(set(curves["seal"].to_numpy().tolist())) < 2:
        return []
    runs = "run" if "run" in curves else None
    try:
        return survey(curves, "seal", runs, direction=direction, ambient_pressure_pa=ambient_pa).statements()
    except FitError as problem:
        return [f"the seals are not surveyed: {problem.what}"]


def _averaged(curves: xr.Dataset, by: str) -> list[str]:
    """Return notes on labels that have several values, because the fit averages over these values."""
    from pneudrive.friction.friction_map import COLUMNS

    said = []
    for name, column in curves.data_vars.items():
        # A label of pressure repeats a measured column; "kind" is the purpose of a campaign's cycle.
        if column.dtype.kind not in "OUS" or name in (*COLUMNS, by, "pressure", "kind"):
            continue
        values = sorted(set(column.to_numpy().astype(str)))
        if len(values) > 1:
            shown = ", ".join(v or "none" for v in values[:MOST_NAMED]) + (", ..." if len(values) > MOST_NAMED else "")
            said.append(
                f"the map has {len(values)} values of {name} ({shown}) and the fit averages over them; "
                f"--by {name} fits each value"
            )
    return said


def _ambient(curves: xr.Dataset, said: str) -> float:
    """Return the ambient pressure from the option or the map, otherwise the standard value with a note."""
    from pneudrive.constants import STANDARD_ATMOSPHERE_PA
    from pneudrive.units import parse_pressure

    if said:
        with option("--ambient"):
            return parse_pressure(said if "abs" in said else f"{said} abs").value_pa
    if "ambient_pressure_pa" in curves.attrs:
        return float(curves.attrs["ambient_pressure_pa"])
    typer.echo("- the map lacks the ambient pressure: 1.01325 bar is assumed; --ambient gives another one", err=True)
    return STANDARD_ATMOSPHERE_PA


def _groups(curves: xr.Dataset, by: str) -> list[tuple[str, xr.Dataset]]:
    import numpy as np

    from pneudrive.identify.static.survey import row_labels

    if not by:
        return [("", curves)]
    labels = row_labels(curves, by)
    return [(name, curves.isel(row=np.flatnonzero(labels == name))) for name in dict.fromkeys(labels.tolist())]


def _each_fitted(
    curves: xr.Dataset, by: str, names: list[str], pressure: str, hold_out: str, options: dict
) -> Iterator[tuple[str, xr.Dataset, FrictionFit, LawComparison | None]]:
    """Yield each group with its rows, fit and comparison; name the groups that cannot be fitted, unless all fail."""
    from pneudrive.errors import FitError

    groups = _groups(curves, by)
    unfitted = 0
    for group, part in groups:
        if group:
            typer.echo(f"{by} {group}")
        try:
            fitted = _fitted(part, names, pressure, hold_out, options)
        except FitError as problem:
            unfitted += 1
            if unfitted == len(groups):
                raise
            value = "" if problem.value is None else f" ({problem.value})"
            typer.echo(f"! {group} is not fitted: {problem.what}{value}. {problem.remedy or ''}")
        else:
            yield group, part, *fitted


def _fitted(
    curves: xr.Dataset, names: list[str], pressure: str, hold_out: str, options: dict
) -> tuple[FrictionFit, LawComparison | None]:
    """Compare several laws and fit the recommended one; fit a single law directly."""
    from pneudrive.errors import FitError
    from pneudrive.identify.static.fit import fit_friction
    from pneudrive.identify.static.laws import CANDIDATES, select_friction_law

    forms = None if not pressure else () if pressure == "none" else (pressure,)
    comparison: LawComparison | None = None
    chosen, form, loss = names[0], pressure or "linear", options["loss"]
    options = {key: value for key, value in options.items() if key != "loss"}
    shown = on_terminal().tell
    if len(names) > 1 or forms is None or hold_out:
        try:
            comparison = select_friction_law(
                curves, names, pressure=forms, hold_out=hold_out or None, loss=loss, progress=shown, **options
            )
        except FitError as problem:
            if hold_out:
                raise
            typer.echo(f"- laws are not compared: {problem.what}; {chosen} is fitted", err=True)
        else:
            chosen, form = comparison.recommended.name, comparison.recommended.pressure or "none"
    elif pressure == "none":
        form = "none"
    law = CANDIDATES[chosen]
    fitted = fit_friction(
        curves,
        law.law,
        stribeck_exponent=law.exponent,
        stribeck_shape="lorentzian" if law.lorentzian else None,
        any_shape=True,
        pressure_dependence=form != "none",
        pressure=form if form != "none" else "linear",
        viscous=comparison is None or comparison.recommended.viscous,
        robust=loss != "linear",
        loss=loss if loss != "linear" else "huber",
        **options,
    )
    return fitted, comparison

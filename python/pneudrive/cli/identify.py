"""Section "Identify": fits of friction and of drives, their use, validation, and the next measurements."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import pneudrive as pn
from pneudrive.cli.options import Count, names_in, one_of, quantity, sensor_options
from pneudrive.cli.terminal import check_outputs, show_fit, show_paths, show_view, watch, writable_folder, write_text
from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.errors import CommandError, DescriptionError, FitError, PneudriveError
from pneudrive.lazy_names import used_later

with used_later(__name__):
    from pneudrive import units
    from pneudrive.campaign.planning import next_points, plan, protocol
    from pneudrive.campaign.running import live
    from pneudrive.describe.files import load, toml
    from pneudrive.files import content, inputs
    from pneudrive.friction import characterisation, friction_map
    from pneudrive.friction.campaign import characteristics
    from pneudrive.friction.campaign.stops import dwell_models
    from pneudrive.identify import design as law_choice
    from pneudrive.identify import files, volume
    from pneudrive.identify.dynamic import result as drive_fits
    from pneudrive.identify.follow import fit as follow
    from pneudrive.identify.static import model, survey
    from pneudrive.identify.static import result as static_fits
    from pneudrive.rig import rig_file
    from pneudrive.validate import motion as friction_check

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import xarray as xr

    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.identify.design import Design

MOST_NAMED = 6  # largest number of values of a label in a message
MAP_SUFFIXES = (".parquet", ".csv")
#: Largest number of attempts to fit a protocol into the requested time, and time factor of each further attempt.
FITS, FIT_FRACTION = 5, 0.97


def fit(
    source: list[Path],
    *,
    laws: str = "",
    pressure: str = "",
    hold_out: str = "",
    by: str = "",
    layout: Path | None = None,
    report: Path | None = None,
    out: Path = Path("fit.toml"),
) -> None:
    """Fit friction laws to a friction map and recommend one.

    Laws are compared by AICc, BIC and cross-validation over conditions. The cross-validation decides.

    Options
    -------
    source : MAP|RECORDING...
        Friction maps (map.parquet, map.csv) or campaigns, one or several; or recordings.
    laws : LAW,...
        Laws to compare, separated by commas. A single law is fitted without comparison. Laws: coulomb, stribeck, or a
        Stribeck curve of another shape, such as "stribeck lorentzian", "stribeck exponential", "stribeck free".
        Default: all.
    pressure
        Dependence on pressure: none, linear, quadratic, saturating, interaction. Default: all.
    hold_out
        Groups for cross-validation: pressure, speed, recording, or a column of the map.
    by
        Column of the map, such as seal: one fit for each of its values.
    out
        Fit file to write; with --by one file for each value.

    Examples
    --------
    pneudrive fit map.parquet --hold-out pressure --out fit.toml
    """
    names = [one_of("--laws", name, model.NAMES) for name in names_in(laws) or model.CANDIDATES]
    one_of("--pressure", pressure or "none", dict.fromkeys(("none", *model.PRESSURE_FORMS)))
    check_outputs(out, (".toml",))
    curves, campaign = _map_of(source, layout)
    if friction_map.AMBIENT not in curves.attrs:
        typer.echo("- the map lacks the ambient pressure: 1.01325 bar is assumed", err=True)
        curves = curves.assign_attrs({friction_map.AMBIENT: STANDARD_ATMOSPHERE_PA})
    left_out = model.NOT_SLIDING if campaign is None else characteristics.NO_POINTS  # as characterise does
    for note in _averaged(curves, by):
        typer.echo(f"! {note}")
    labels, unfitted = survey.row_labels(curves, by), 0
    groups = dict.fromkeys(labels.tolist())
    for group in groups:
        part = curves.isel(row=(labels == group).nonzero()[0])
        if group:
            typer.echo(f"{by} {group}")
        try:
            result, comparison = _fit_laws(part, names, pressure, hold_out, left_out)
        except FitError as problem:
            unfitted += 1
            if unfitted == len(groups):
                raise
            value = "" if problem.value is None else f" ({problem.value})"
            typer.echo(f"! {group} is not fitted: {problem.what}{value}. {problem.remedy or ''}")
            continue
        if campaign is not None:
            result = characteristics.with_dependences(result, campaign, part)
        if comparison is not None:
            show_view(comparison.view())
        slug = re.sub(r"[^A-Za-z0-9._-]+", "-", group)
        target = out.with_stem(f"{out.stem}-{slug}") if group else out
        show_fit(result, target, report and report / slug)
    if by == "seal" and "seal" in curves and len(set(curves["seal"].to_numpy().tolist())) > 1:
        runs = "run" if "run" in curves else None
        try:
            statements = survey.survey(curves, "seal", runs).statements()
        except FitError as problem:
            statements = [f"the seals are not compared: {problem.what}"]
        typer.echo("".join(f"- {statement}\n" for statement in statements), nl=False)


def _map_of(source: list[Path], layout: Path | None) -> tuple[xr.Dataset, CampaignCharacteristics | None]:
    """Read a friction map, or make it from recordings.

    The second result contains the other measurements of a single campaign.
    """
    missing = next((path for path in source if not path.exists()), None)
    if missing is not None:
        rule = "a friction map, recordings, or the folder of a campaign"
        raise CommandError(f"there is no {missing}", rule=rule, remedy=content.similar(missing))
    finished = [path for path in source if path.is_dir() or path.suffix == ".parquet"]
    if finished and len(finished) < len(source):
        raise CommandError.of("cli.not-together", value=" ".join(map(str, source)))
    if finished:
        campaigns = [pn.campaign_friction(path) if path.is_dir() else None for path in finished]
        pairs = list(zip(finished, campaigns, strict=True))
        maps = [friction_map.read_map(path) if found is None else found.friction_map for path, found in pairs]
        if len(maps) == 1:
            return maps[0], campaigns[0]
        if any(campaigns):
            typer.echo("- the fit of several campaigns contains only the curve over speed and pressure", err=True)
        return joined_maps(finished, maps), None
    if len(source) == 1 and source[0].suffix in MAP_SUFFIXES and layout is None:
        with suppress(PneudriveError):
            return friction_map.read_map(source[0]), None
    return characterisation.characterise_recordings(source, layout, progress=watch().tell).friction_map, None


def joined_maps(paths: list[Path], maps: list[xr.Dataset]) -> xr.Dataset:
    """Join the rows of several maps. Gauge pressures are kept if the ambient pressures of the maps differ."""
    import xarray as xr

    ambient = [float(each.attrs.get("ambient_pressure_pa", STANDARD_ATMOSPHERE_PA)) for each in maps]
    common = [str(name) for name in maps[0] if name != "ambient_pressure_pa" and all(name in each for each in maps)]
    parts = []
    for path, rows, air in zip(paths, maps, ambient, strict=True):
        changed = {name: rows[name] + (ambient[0] - air) for name in ("pressure_a_pa", "pressure_b_pa")}
        changed["recording"] = f"{path}: " + rows["recording"].astype(object)
        parts.append(rows[common].assign(changed))
    is_stated = "ambient_pressure_pa" in maps[0].attrs
    joined = xr.concat(parts, "row", combine_attrs="drop")
    return joined.assign_attrs({"ambient_pressure_pa": ambient[0]} if is_stated else {})


def _averaged(curves: xr.Dataset, by: str) -> Iterator[str]:
    """Yield notes on labels with several values, over which the fit averages."""
    for name, column in curves.data_vars.items():
        # A label of pressure repeats a measured column; "kind" is the purpose of a campaign's cycle.
        if column.dtype.kind not in "OUS" or name in (*friction_map.COLUMNS, by, "pressure", "kind"):
            continue
        values = sorted(set(column.to_numpy().astype(str)))
        if len(values) > 1:
            shown = ", ".join(v or "none" for v in values[:MOST_NAMED]) + (", ..." if len(values) > MOST_NAMED else "")
            yield (
                f"the map has {len(values)} values of {name} ({shown}) and the fit averages over them; "
                f"--by {name} fits each value"
            )


def _fit_laws(
    curves: xr.Dataset,
    names: list[str],
    pressure: str,
    hold_out: str,
    left_out: Sequence[str],
) -> tuple[static_fits.FrictionFit, law_choice.LawComparison | None]:
    """Compare several laws and fit the recommended one; fit a single law directly."""
    forms = None if not pressure else () if pressure == "none" else (pressure,)
    if len(names) > 1 or forms is None or hold_out:
        held = {"pressure": forms, "hold_out": hold_out or None, "exclude_flags": left_out}
        try:
            comparison = pn.select_friction_law(curves, names, **held, progress=watch().tell)
        except FitError as problem:
            if hold_out:
                raise
            typer.echo(f"- laws are not compared: {problem.what}; {names[0]} is fitted", err=True)
        else:
            return comparison.recommended.fit, comparison
    how: Any = {} if pressure == "none" else {"pressure_dependence": True, "pressure": pressure or "linear"}
    return pn.fit_friction(curves, names[0], **how, exclude_flags=left_out), None


def identify(
    drive: str,
    recordings: list[Path],
    *,
    free: str = "",
    sensor: list[str] | None = None,
    follow: str | None = None,
    report: Path | None = None,
    layout: Path | None = None,
    out: Path | None = None,
) -> None:
    r"""Identify the numbers of a drive or a circuit from recordings of its motion.

    Ctrl-C keeps the best values so far. A file with a table [volume] describes a tank: line, heat
    transfer and leak are identified from its pressure. A file with a table [regulator] describes a
    pressure regulator: gain and lag are identified from command and pressure.

    Options
    -------
    drive : DRIVE
        Drive or circuit file (TOML), catalogue:NAME, or tank file, with the start values.
    recordings : RECORDING...
        Recordings: time, command, position, pressures; for a tank, time and pressure.
    free : NAMES
        Free numbers, separated by commas. Default for a tank: all.
    sensor : CHANNEL:KEY=VALUE
        Sensor: "position: noise = 2 um, offset = free", with noise, offset, offset_uncertainty, gain, lag,
        resolution. "command: delay = free".
    follow : motion
        The circuit follows the recorded position. --free may then be: volumes, heat, wall, leak, leak_a, leak_b,
        barrel, or names such as upper.volume.
    out
        Fit file to write (TOML).

    Examples
    --------
    pneudrive identify drive.toml run.parquet --out fit.toml \
        --free friction.coulomb,friction.viscous
    """
    check_outputs(out, (".toml",))
    names, tell = names_in(free), watch().tell
    if follow is not None:
        one_of("--follow", follow, {"motion": None})
        result: Any = pn.identify_motion(drive, recordings, names or ["volumes", "heat"], layout=layout, progress=tell)
    elif isinstance((tables := toml.read(drive)[0] if content.exists(drive) else {}).get("regulator"), dict):
        result = pn.identify_regulator(drive, recordings, layout)
    elif "volume" in tables:
        if sensor:
            raise CommandError.of("cli.tank", where=drive, name="sensor")
        result = pn.identify_volume(pn.Tank.load(drive), recordings, names or None, layout=layout, progress=tell)
    else:
        described: Any = load.load_described(drive)
        result = pn.identify(described, recordings, names, sensors=sensor_options(sensor), layout=layout, progress=tell)
    show_fit(result, out, report)


def apply(fit: Path, drive: str | None = None, *, out: Path | None = None) -> None:
    """Put the determined values of a fit into a drive or a tank.

    The output states the interval and the recordings of each value.

    Options
    -------
    drive : [DRIVE]
        Drive file, catalogue:NAME, or tank file; default: the one with which `pneudrive identify` started.
    out
        Drive file to write; default: standard output.

    Examples
    --------
    pneudrive apply fit.toml drive.toml --out measured.toml
    """
    check_outputs(out, (".toml",))
    found = files.read_fit(fit)
    if out is not None:
        found = replace(found, file=inputs.path_from(str(fit.resolve()), out.parent))
    if isinstance(found, follow.FollowFit) and drive is None:
        described = found.apply()
    elif isinstance(found, follow.FollowFit | volume.RegulatorFit):
        raise CommandError(f"the values of a {found.TITLE} cannot be written into a drive", where=fit)
    elif drive is not None:
        target: Any = pn.Tank.load(drive) if isinstance(found, volume.VolumeFit) else load.load_described(drive)
        described = found.apply(target)
    elif isinstance(found, volume.VolumeFit | drive_fits.DriveFit):
        described = found.apply()
    else:
        raise CommandError.of("cli.no-drive")
    write_text(described.to_toml(), out)


def validate(
    drive: str,
    recordings: list[Path],
    *,
    layout: Path | None = None,
    sensor: list[str] | None = None,
    window: str = "0.5 s",
    out: Path = Path("validation"),
) -> None:
    """Compare a drive with recordings, and diagnose differences.

    A friction map (map.parquet, map.csv) or a campaign folder is compared with the drive's friction law.

    Options
    -------
    drive : DRIVE|FIT
        Drive file (TOML), catalogue:NAME, or fit of `pneudrive identify --out`, whose sensor zeros are then used.
        Fits along motions and of regulators are allowed. Verdicts use the recordings that were held out of the fit.
    recordings : RECORDING...|MAP|CAMPAIGN
        Recordings of the drive (time, command, position, both pressures), or one friction map or campaign.
    sensor : CHANNEL: KEY = VALUE, ...
        Known error of a sensor: "pressure_a: offset = 0.02 bar"; gain; "command: delay = 3 ms".
    window
        Length of the runs that start from measured states.

    Examples
    --------
    pneudrive validate measured.toml other.parquet --out check
    """
    options = {"layout": layout, "progress": watch().tell}
    tables = toml.tables_in(drive, DescriptionError, "`pneudrive apply --out` writes TOML.")
    if volume.RegulatorFit.is_file(drive):
        found: Any = pn.validate(volume.RegulatorFit.from_toml(drive), recordings, layout=layout)
    elif follow.FollowFit.is_file(drive) or ("components" in tables and "valve" not in tables):
        found = pn.validate_motion(drive, recordings, **options)
    else:
        described = drive_fits.DriveFit.from_toml(drive) if drive_fits.DriveFit.is_file(drive) else pn.Drive.load(drive)
        if any(friction_check.is_friction(path) for path in recordings):
            if len(recordings) > 1:
                raise CommandError.of("cli.one-map")
            law = described.apply() if isinstance(described, drive_fits.DriveFit) else described
            found = friction_check.validate_friction(law, recordings[0])
        else:
            options |= {"window_s": quantity("--window", window, "s"), "sensors": sensor_options(sensor) or None}
            found = pn.validate(described, recordings, **options)
    folder = writable_folder(out)
    written = [*found.write(folder), found.report(folder)]
    show_view(found.view())
    show_paths(*written)


def design(
    fit: Path,
    *,
    rig: str = "default",
    points: Count = 0,
    time: str = "",
    criterion: str = "D",
    stops: str = "",
    out: Path | None = None,
) -> None:
    """Propose the next measurements for a fit.

    The file is a protocol for pneudrive campaign plan. The expected intervals are printed.

    Options
    -------
    fit : FIT
        Fit of `pneudrive fit` or `characterise`.
    rig
        Ready rig, rig file, or own code as own_rig.py:make_rig.
    points
        Number of points, including repeats; 0: twice the number of parameters.
    time
        Time on the rig instead of a number of points, such as '1 h'.
    criterion
        D: all parameters; I: prediction over the range.
    stops
        Measure stops instead of speeds, for a dwell law such as log or hyperbolic.
    out
        Protocol file to write.

    Examples
    --------
    pneudrive design fit.toml --rig my-rig.toml --out next.toml
    """
    if out is not None and (out.exists() or out.suffix != ".toml" or not out.parent.is_dir()):
        raise CommandError.of("cli.protocol", out=out)
    if points and time:
        raise CommandError("--points and --time cannot be given together", remedy="Keep one of them.")
    found, machine = static_fits.FrictionFit.from_toml(fit), rig_file.load_rig(rig)
    identity, envelope = machine.identity(), machine.limits()

    def seconds_of(text: str) -> float:
        return plan.lay_out(protocol.parse_protocol(text), identity, envelope).time_s

    if stops:
        stop_plan = dwell_models.design_stops(stops, 1.0, stops=points or 12, noise_n=found.statistics["rms_n"])
        text = stop_plan.protocol()
        typer.echo(str(stop_plan))
    else:
        limits = next_points.limits_of(found, identity, envelope)
        longest_s = quantity("--time", time, "s") if time else None
        propose = partial(pn.next_measurements, found, limits, criterion=criterion)
        proposal = propose(points=points or None, seconds=longest_s)
        text = proposal.protocol()
        for _ in range(FITS):  # a cycle takes longer than its strokes
            if longest_s is None or (ratio := seconds_of(text) / longest_s) <= 1.0:
                break
            proposal = propose(seconds=FIT_FRACTION * proposal.seconds / ratio)
            text = proposal.protocol()
        show_view(replace(proposal.view(), notes=_shared_errors(found, proposal)))
    typer.echo(f'the protocol takes {live.duration(seconds_of(text))} on "{identity.name}"')
    if out is None:
        typer.echo("\n" + text.rstrip())
    else:
        write_text(text, out)


def _shared_errors(fit: static_fits.FrictionFit, plan: Design) -> tuple[str, ...]:
    """Return a note if errors common to all points exceed the errors that more points reduce."""
    errors = []
    for name, then in plan.half_widths_then.items():
        factor, unit = units.readable(model.unit_of(name))
        if (both := 2.0 * fit.systematic[name]) > then:
            errors.append(f"{name} ± {both / factor:.2g} {unit}")
    what = "errors that all values share (sensors, area) are larger; more points do not reduce them"
    return (f"{what}: {', '.join(errors)}",) if errors else ()


def report(fit: Path, *, map: Path | None = None, out: Path = Path("report")) -> None:  # noqa: A002 - the option
    """Write a report of a fit, with intervals and undetermined values.

    Residuals need the data: use --map for the fit of a friction map, and `pneudrive identify --report` for the fit of a
    drive.

    Options
    -------
    map : MAP
        The fitted friction map, for the residuals.

    Examples
    --------
    pneudrive report fit.toml --map map.parquet --out page
    """
    found = files.read_fit(fit)
    if map is not None:
        if not isinstance(found, static_fits.SlidingFit):
            raise CommandError(f"--map: the {found.TITLE} was not fitted to a friction map")
        found = static_fits.with_map(found, friction_map.read_map(map))
    show_paths(found.report(out))

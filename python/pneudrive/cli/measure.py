"""Section "Measure": layouts, friction of recordings and campaigns, comparisons, the source paper, and served rigs."""

from __future__ import annotations

import shutil
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

import pneudrive as pn
from pneudrive.cli import terminal
from pneudrive.cli.commands import group
from pneudrive.cli.options import Port, one_of
from pneudrive.cli.terminal import show_lines, show_paths, show_table, show_view, watch, writable_folder, write_outputs
from pneudrive.errors import Cancelled, CommandError, RecordingError
from pneudrive.lazy_names import used_later

with used_later(__name__):
    from pneudrive import report
    from pneudrive.campaign.storage import folder as folders
    from pneudrive.friction import characterisation, friction_map, strokes
    from pneudrive.friction.campaign import characteristics
    from pneudrive.friction.campaign import compare as comparisons
    from pneudrive.friction.campaign import result as campaign_result
    from pneudrive.identify.static import fit as static_fits
    from pneudrive.identify.static import result as fit_results
    from pneudrive.report import campaign as campaign_page
    from pneudrive.report import recordings as recordings_page
    from pneudrive.report import render
    from pneudrive.rig import rig_file
    from pneudrive.rig.opcua import access, nodes, server
    from pneudrive.signals import layout as layouts
    from pneudrive.signals import load, proposal
    from pneudrive.simulation import trajectory
    from pneudrive.studies.bracha import reproduction
    from pneudrive.validate import motion


campaign = group(
    dict.fromkeys(("plan", "run", "resume", "status", "pause", "abort"), "pneudrive.cli.campaign"),
    "Plan, run, watch and resume friction campaigns.",
)
rig = group(
    dict.fromkeys(("serve", "certificate"), __name__),
    "Serve a rig over OPC UA, with certificates.",
)


def layout(file: Path, *, out: Path | None = None) -> None:
    """Propose how to read a foreign recording.

    A picture is written next to the layout, or as FILE.layout.png into this folder.

    Options
    -------
    file : FILE
        Recording in any supported format.
    out
        Layout file to write; default: standard output.

    Examples
    --------
    pneudrive layout bench.csv --out layout.toml
    """
    found = proposal.propose_layout(file)
    if out is None:
        typer.echo(found.text)
    else:
        trajectory.write_whole(out, found.text)
    picture = out.with_suffix(".png") if out is not None else Path(f"{layouts.stem(file)}.layout.png")
    recordings_page.write_layout_figure(found, picture)
    if not found.problem:
        what = "a fixed volume" if found.kind == "fixed-volume" else f"a {found.kind}"
        strokes = f": {len(found.strokes)} strokes" if found.strokes else ""
        sys.stderr.write(f"A recording of {what}{strokes}; check the lines marked guess.\n")
    if found.unused:
        sys.stderr.write(f"Not used: {', '.join(proposal.families(found.unused))}.\n")
    sys.stderr.write("".join(f"{path}\n" for path in (out, picture) if path is not None))
    if found.problem:
        before = "" if found.asks else "the proposed layout does not read the file yet: "
        raise RecordingError.of("signals.open-layout", where=file, problem=f"{before}{found.problem}")


def characterise(
    recordings: list[Path],
    *,
    layout: Path | None = None,
    out: Path = Path("characterisation"),
    protocol: str = "settled",
) -> None:
    """Determine friction with its uncertainty from recordings or a campaign.

    The output files are map.parquet, map.csv, fit.toml and report.html.

    If curves can be determined, curves.parquet and effects.toml are also written, and statements are printed.
    Each seal and mounting has its own curves and fit.

    Options
    -------
    recordings : RECORDING...|FOLDER|CAMPAIGN
        Recordings, also compressed (.gz, .xz, .bz2); their folder with layout.toml; or a campaign folder.
    protocol
        Selection of samples: settled, or source-paper (without the first 5 %).

    Examples
    --------
    pneudrive characterise bench/*.csv --layout layout.toml --out results
    pneudrive characterise my-campaign --out results
    """
    choice = one_of("--protocol", protocol, strokes.SAMPLE_CHOICES)()
    recordings = [file for path in recordings for file in (path.is_dir() and load.recordings_in(path)) or [path]]
    if any(path.is_dir() for path in recordings):
        if len(recordings) > 1 or layout is not None:
            names = " ".join(str(path) for path in recordings) + (f" --layout {layout}" if layout else "")
            raise CommandError.of("cli.one-campaign", value=names)
        with _output(out) as folder:
            run = characteristics.campaign_friction(recordings[0], choice, progress=watch().tell)
            written = campaign_result.write_characteristics(run, folder)
            fits, problems = characteristics.fit_campaign(run)
            written += _write_fits(fits, folder, next(iter(fits)) if len(fits) == 1 else characteristics.ALL)
            written.append(campaign_page.write_campaign_report(run, folder))
        _show_problems(problems)
        show_view(run.view())
        show_paths(*written)
        return
    with _output(out) as folder:
        found = characterisation.characterise_recordings(recordings, layout, choice, progress=watch().tell)
        written, fits, problems = write_map_and_fits(found, folder)
        curves = characteristics.recorded_characteristics(found)
        written += [] if curves is None else campaign_result.write_curves_and_effects(curves, folder)
        written.append(Path(report.write_report(found, fits, folder, curves)))
    _show_problems(problems)
    show_view(recordings_page.characterisation_view(found, fits))
    balances = [motion.close_balance(recording) for recording in found.recordings if recording.force_n.any()]
    show_lines(*(f"- {balance}." for balance in balances if balance.gains))
    if curves is not None:
        show_view(replace(curves.view(), rows=(), leading=()))  # the view above has the friction at each speed
    show_paths(*written)


def _show_problems(problems: list[str]) -> None:
    sys.stderr.write("".join(f"Note: no fit of {problem}\n" for problem in problems))


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


def write_map_and_fits(
    found: characterisation.Characterisation, folder: Path
) -> tuple[list[Path], static_fits.GroupFits, list[str]]:
    """Write the friction map of recordings in both formats, then its fits. Each fit names the map file."""
    written = [friction_map.write_map(found.friction_map, folder / f"map.{end}") for end in ("parquet", "csv")]
    fits, problems = static_fits.fit_characterisation(found)
    return written + _write_fits(fits, folder, whole=friction_map.ALL_RECORDINGS), fits, problems


def _write_fits(fits: static_fits.GroupFits, folder: Path, whole: str) -> list[Path]:
    """Write fit.toml for all data, and fit-GROUP.toml for each group."""
    written = []
    for group_name, by_law in fits.items():
        if "stribeck" in by_law:
            written.append(folder / ("fit.toml" if group_name == whole else static_fits.fit_file(group_name)))
            by_law["stribeck"].to_toml(written[-1])
    return written


def compare(
    first: Path,
    second: Path,
    *,
    out: Path | None = None,
    protocol: str = "settled",
    plot: Path | None = None,
) -> None:
    """Compare two campaigns, drives, circuits, fits, maps, runs, sizings or validations.

    For two campaigns (such as new and worn seals), report.html and comparison.toml are written.
    Two other results of one kind are compared value by value, in common units, and curve by curve.

    Options
    -------
    first : A
        Folder of campaign A; or any other result or description.
    second : B
        Result of the same kind; differences are B minus A.
    out : DIR
        Folder for the report of two campaigns; the default is "comparison". Other results are only printed.
    protocol
        Selection of samples: settled, or source-paper (without the first 5 %).
    plot
        Picture of both curves and their difference: .png, .svg or .pdf.

    Examples
    --------
    pneudrive compare before after --out compared
    pneudrive compare old.toml new.toml
    pneudrive compare before.parquet after.parquet --plot difference.svg
    """
    choice = one_of("--protocol", protocol, strokes.SAMPLE_CHOICES)
    if not all((path / folders.RIG).is_file() for path in (first, second)):
        _compare_results(str(first), str(second), out, plot)
        return
    if first.resolve() == second.resolve():
        raise CommandError("a campaign cannot be compared with itself", value=str(first), remedy="Give two folders.")
    tell = watch().tell
    sides = [characteristics.campaign_friction(folder, choice(), progress=tell) for folder in (first, second)]
    compared = pn.compare_campaigns(*sides)
    folder = writable_folder(out or Path("comparison"))
    written = comparisons.write_comparison(compared, folder / "comparison.toml")
    page = campaign_page.write_comparison_report(compared, folder)
    named = zip("AB", sides, strict=True)
    show_lines(*(f"{letter}: {side.folder} ({side.name}, {len(side.cycles)} cycles)" for letter, side in named))
    show_view(compared.view())
    show_paths(written, page)


def _compare_results(first: str, second: str, out: Path | None, plot: Path | None) -> None:
    """Print the values that differ between two results, and the differences of their curves."""
    terminal.check_outputs(None, plot=plot)
    compared = pn.compare_results(first, second, (first, second))
    if out is not None:
        what = f"--out writes the report of two campaigns; these are results of the kind {compared.kind}"
        raise CommandError(what, value=str(out), remedy="Leave it out; --plot FILE writes a picture of the curves.")
    is_fit = compared.kind == fit_results.FrictionFit.TITLE
    show_lines(compared.sentence)
    if compared.values:
        names = [Path(path).name for path in (first, second)]  # a long path would be cut in the head of a column
        before, after = names if len({*names}) > 1 else (first, second)
        show_table(("value", f"<{before}", "<95 %", f"<{after}", "<95 %", "change %"), compared.rows())
    if rows := compared.curve_rows()[: terminal.MOST_ROWS]:
        show_table(("curve", "at", "B minus A", "95 %, statistical" if is_fit else "95 %"), rows)
    elif not compared.curves and is_fit:
        show_lines("The fits have no speeds and pressures in common, so their curves are not compared.")
    write_outputs((plot, lambda path: render.draw_figure(compared.figure(), path)))


def reproduce(*, out: Path = Path("reproduction")) -> None:
    """Reproduce figures 1 to 9 of the source paper on simulated rigs.

    Options
    -------
    out
        Folder for the report and its figures.

    Examples
    --------
    pneudrive reproduce --out figures
    """
    folder = writable_folder(out)
    made = reproduction.reproduce(folder / reproduction.FOLDER)
    page = made.report().write(folder)
    for claim in made.claims:
        typer.echo(f'{claim.place}: "{claim.said}"')
        typer.echo(f"    {claim.verdict}: {claim.found}")
    typer.echo(f"\nOf the paper, {reproduction.count_verdicts(made.claims)}.\n{page}")


# --- The group `rig`.

#: Addresses that only this machine can reach.
LOOPBACK = ("127.0.0.1", "localhost", "::1")


def serve(
    rig: str = "default",
    *,
    port: Port = 4840,
    bind: str = "127.0.0.1",
    speed: float = 1.0,
    seed: int = 0,
    map: Path | None = None,  # noqa: A002 - the name of the option
    certificate: Path | None = None,
    trust: list[Path] | None = None,
    unprotected: bool = False,
) -> None:
    """Serve a rig over OPC UA, with the nodes of a map, until Ctrl-C.

    Options
    -------
    rig
        Ready rig, rig file, or own code as own_rig.py:make_rig.
    port
        Port; 0: a free one.
    bind
        Address to listen on.
    speed
        1: real time; 10: ten times faster; 0: as fast as possible.
    seed
        Seed of all noise of a simulated rig.
    map
        Node map; default: the one of the package.
    certificate
        Certificate of this server, with its private key next to it (.key); all messages are signed and encrypted.
    trust
        Certificate of a client that may connect; repeatable.
    unprotected
        Allow anyone on the network to command the axis.

    Examples
    --------
    pneudrive rig serve default
    """
    protection = access.Protection.of(certificate, trust)
    if bind not in LOOPBACK and certificate is None and not unprotected:
        raise CommandError.of("cli.bind", address=bind)
    if speed < 0.0 or 0.0 < speed < 1.0:
        raise CommandError(f"--speed {speed:g} is out of bounds", rule="0, or at least 1")
    bench = rig_file.load_rig(rig, seed, speed or None)
    ended = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ended.set())
    with server.RigServer(bench, nodes.load_map(map), bind, port, protection) as running:
        about = f"{bench.identity().name} at {running.url} with seed {seed}"
        typer.echo(f"{about}; heartbeat {running.heartbeat_s:g} s. Ctrl-C ends the server.")
        sys.stdout.flush()
        while not ended.wait(0.5):  # an endless wait would block Ctrl-C on some systems
            pass


def certificate(
    name: str,
    *,
    out: Path = Path(),
    host: list[str] | None = None,
    days: Annotated[int, typer.Option(min=1)] = 365,
) -> None:
    """Make a self-signed certificate and its key for an OPC UA client or server.

    Options
    -------
    name
        Name of the files and of the application: NAME.pem, NAME.key.
    out
        Folder for both files.
    host
        Name of the computer; repeatable; default: this computer.
    days
        Days of validity.

    Examples
    --------
    pneudrive rig certificate server --out certificates
    """
    show_paths(*access.make_certificate(out, name, host, days))

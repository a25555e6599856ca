"""``pneudrive control``: tune controllers from a drive's description, run and compare them, check references."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from pneudrive.cli.groups import group
from pneudrive.cli.options import CatalogueFolders, Described, Plot, Rtol, check_used, names_in
from pneudrive.cli.output import check_outputs, show_events, show_table, tell, write_outputs
from pneudrive.repr_tables import aligned

if TYPE_CHECKING:
    from pneudrive.control.results.comparison import ControlComparison
    from pneudrive.control.results.measures import Score
    from pneudrive.control.tuning import Tuning
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.simulation.simulate import Run

control = group(
    dict.fromkeys(("tune", "run", "benchmark", "reference", "export"), "pneudrive.cli.control.control"),
)

SetupOption = Annotated[
    str,
    typer.Option(
        "--setup",
        help="Instrumentation: ideal, real, cheap (assumed values), or a TOML file.",
    ),
]
Along = Annotated[
    str,
    typer.Option(
        help='Reference: "sine 60 mm 0.5 Hz around 250 mm", "220 mm; 1 s: 280 mm in 0.3 s", R1 to R6, or a file.',
        metavar="REF",
    ),
]
AllowCode = Annotated[
    str | None,
    typer.Option(help="Allow the code that a controller file names, by its SHA-256.", metavar="SHA256"),
]
MismatchOption = Annotated[
    str | None,
    typer.Option(
        help="Deviation of the true drive: all, mass+30, sag, load-step, ... (assumed values), or a TOML file."
    ),
]
#: Reference along which a tuned law is tried, and share of its way by which that may miss it (assumed).
TRIED_ALONG, MOST_TRIED = "R3", 0.1
TOLD = ("max_error_m", "rmse_m", "settling_100_um_s", "rest_error_m", "hunting_m")


@control.callback()
def _control() -> None:
    """Tune, run, compare and export controllers, and check references; all runs are simulated."""


def tune(
    drive: Described,
    law: str = "nmpc",
    setup: SetupOption = "real",
    out: Path | None = None,
    catalogue: CatalogueFolders = None,
) -> None:
    """Tune a controller from the description of a drive.

    Print the rule and limits of each gain, and a simulated result.

    Options
    -------
    law
        Controller: pid, fuzzy, sliding-mode, super-twisting, inversion or nmpc.
    out
        Controller file (TOML) with all gains.
    """
    from pneudrive.control.tuning import tune as tuned
    from pneudrive.describe.files.load import load_described

    check_outputs(out, (".toml",))
    described = load_described(drive)
    found = tuned(described, law, setup=setup)
    _show_tuning(found)
    _try_out(described, found, setup)
    _show_suitability(described, setup)
    write_outputs((out, replace(found, source=drive).save))


def _show_tuning(found: Tuning) -> None:
    typer.echo(f"{found.law} for {found.belief.name}, every {1e3 * found.period_s:g} ms\n")
    rows = [(gain.key, str(gain), gain.meaning, gain.rule) for gain in found.numbers]
    show_table(("gain", "<value", "<meaning", "<follows from"), rows)
    typer.echo(f"\n{aligned(found.plant.rows())}\n")
    typer.echo("\n".join(found.limits))


def _try_out(drive: Drive | Circuit, found: Tuning, setup: str) -> None:
    """Run the tuned controller on its assumed drive, and warn if it does not follow."""
    from pneudrive.control.loop import prepare, run_prepared
    from pneudrive.errors import PneudriveError, warn

    try:
        prepared = prepare(drive, None, TRIED_ALONG, setup=setup, controller=found)
        tried = run_prepared(prepared, seed=1)
    except PneudriveError as error:
        warn(f"the law was not tried on this drive: {error.what}")
        return
    typer.echo(f"\nSimulated on this drive as described, along {prepared.reference.text}:")
    score = _show_run(tried)
    reach = prepared.reference.reach()
    way_m = reach.highest_m - reach.lowest_m
    if score.lost or score.max_error_m > MOST_TRIED * way_m:
        missed = f"{found.law} misses by up to {1e3 * score.max_error_m:.3g} mm where it was tried"
        warn(f"{missed}: take another law or drive")


def _show_suitability(drive: Drive | Circuit, setup: str) -> None:
    """Show for each controller whether it suits the drive."""
    from pneudrive.control.suited import suitability

    rows = [(one.law, "suits" if one.suits else "does not suit", one.reason) for one in suitability(drive, setup)]
    typer.echo("\nEach controller along R3, as described and with half of the mass, simulated; best first:")
    show_table(("<controller", "<suits", "<because"), rows)


def _show_run(found: Run) -> Score:
    from pneudrive.control.results.measures import Score

    score = Score(**found.provenance["score"])
    typer.echo(aligned(score.rows()))
    show_events(found.provenance["events"])
    return score


def run(
    drive: Described,
    reference: Along,
    controller: str | None = None,
    law: str | None = None,
    setup: SetupOption = "real",
    duration: str | None = None,
    seed: Annotated[int, typer.Option(min=0)] = 1,
    mismatch: MismatchOption = None,
    initial: str | None = None,
    payload: str | None = None,
    dynamics: Literal["full", "constant"] = "full",
    rtol: Rtol = 1e-5,
    out: Path | None = None,
    plot: Plot = None,
    allow_code: AllowCode = None,
    catalogue: CatalogueFolders = None,
) -> None:
    """Run a drive or a platform under control along a reference, and score it.

    Options
    -------
    controller : FILE|LAW
        TOML file or name; default: nmpc.
    law : LAW
        Controller or own code: mine.py:Law.
    duration
        Duration, "12 s"; default: of the reference.
    seed
        Seed of all noise.
    initial
        Start state, e.g. "pressure_a = 3 bar abs"; default: on the reference.
    payload
        Platform: mass that no controller knows, "2 kg"; the spread of several: "0 kg, 2 kg".
    dynamics
        Platform: mass and load of the legs along the path, or those at its start.
    out
        File .parquet, .csv, .nc; platform: folder.
    """
    from pneudrive.cli.progress import on_terminal
    from pneudrive.control.loop import prepare, run_prepared
    from pneudrive.describe.files.load import load_described
    from pneudrive.errors import CommandError
    from pneudrive.platforms import is_platform
    from pneudrive.report.control.figures import plot_control
    from pneudrive.simulation.trajectory import save

    is_file = controller is not None and controller.endswith(".toml")
    if law and controller and not is_file and law != controller:
        raise CommandError(f"--law {law} and --controller {controller} are given", remedy="Give one.")
    law, file = (law, controller) if is_file else (law or controller, None)
    options: dict[str, Any] = {"setup": setup, "duration": duration, "controller": file, "mismatch": mismatch}
    described = load_described(drive)
    if is_platform(described.circuit):
        from pneudrive.cli.control.pose import run_platform

        if initial is not None or allow_code:
            what = "a platform starts on its path, and takes no code of users: --initial and --allow-code do not act"
            raise CommandError(what, remedy="Leave them out.")
        options |= {"law": law, "seed": seed, "dynamics": dynamics, "rtol": rtol}
        run_platform(described.circuit, reference, payload, out, plot, options)
        return
    if payload is not None:
        raise CommandError(f"--payload {payload}", rule="for a platform", remedy="Give a mismatch, such as mass+30.")
    check_outputs(out, plot=plot)
    prepared = prepare(described, law, reference, initial=initial, rtol=rtol, allow_code=allow_code, **options)
    found = run_prepared(prepared, seed, on_terminal())
    belief, drive_name = prepared.tuning.belief.name, prepared.circuit.name
    of = "" if belief == drive_name else f", told of {belief},"
    title = f"{prepared.tuning.law}{of} on {drive_name} along {prepared.reference.text}"
    typer.echo(f"{title}, setup {prepared.setup_name}, seed {seed}, simulated:")
    _show_run(found)
    if "law_failure" in found.provenance:
        typer.echo(f"\n{found.provenance['law_failure']}\nAnother law took over.", err=True)
    write_outputs(
        (out, lambda path: save(found.dataset(), path)), (plot, lambda path: plot_control(found.dataset(), path))
    )


def benchmark(
    drive: Described,
    out: Annotated[Path, typer.Option()],
    laws: str = "all",
    references: str = "standard",
    seeds: int = 5,
    setup: SetupOption = "real",
    allow_code: AllowCode = None,
    mismatch: MismatchOption = None,
    spread: str | None = None,
    members: int | None = None,
    threads: int | None = None,
    keep_runs: Annotated[bool | None, typer.Option("--keep-runs/--scores-only")] = None,
    catalogue: CatalogueFolders = None,
) -> None:
    """Compare controllers along references, with several seeds or a spread of drives.

    Options
    -------
    out
        Folder for scores, runs and report; a started one is resumed.
    laws : all|A,B
        all, or names, controller files and your own code (mine.py:Law), with commas.
    references : standard|REF,...
        standard (R1, R2, R3, R5, R6), or references with commas.
    seeds
        Number of seeds.
    spread
        Different drives instead of seeds: standard, or a TOML file with ranges.
    members
        Number of members of the spread; default 200.
    threads
        Simultaneous runs; default: one per processor.
    keep_runs
        Keep samples of each run; default: without a spread.
    """
    from pneudrive.cli.progress import on_terminal
    from pneudrive.control.results.card import SCORES
    from pneudrive.control.results.comparison import compare_watched
    from pneudrive.describe.files.load import load_described
    from pneudrive.report.control.page import write_control_report

    described = load_described(drive)
    words = laws if laws == "all" else names_in(laws)
    along = references if references == "standard" else names_in(references)
    of: dict[str, Any] = {"mismatch": mismatch, "spread": spread, "members": members, "threads": threads}
    of |= {"out": out, "seeds": seeds, "setup": setup, "keep_runs": keep_runs, "allow_code": allow_code}
    found = compare_watched(described, words, along, **of, named=drive, watch=on_terminal())
    _show_comparison(found)
    _show_failures(found)
    tell([out / SCORES, write_control_report(found, out)])


def _show_comparison(found: ControlComparison) -> None:
    for name, one in found.references.items():
        called = name if name == one.text else f"{name}, {one.text}"
        of = f"spread {found.spread}: 50 / 95 / 100 % of {_members(found)} stay below"
        typer.echo(f"\n{called}, simulated, {of if found.spread else 'median of the seeds'}")
        show_table(*found.table(name, spread=bool(found.spread), only=TOLD))


def _show_failures(found: ControlComparison) -> None:
    """Print each reason why runs ended early once, with the number of runs."""
    reasons = Counter((run.law, run.reason) for run in found.runs if run.reason)
    for (law, reason), count in reasons.items():
        typer.echo(f"{count} {'run' if count == 1 else 'runs'} of {law} ended early: {reason}", err=True)


def _members(found: ControlComparison) -> int:
    return len({run.seed for run in found.runs})


def reference(
    along: str,
    drive: Annotated[str, typer.Option()],
    plot: Plot = None,
    catalogue: CatalogueFolders = None,
) -> None:
    """Check a reference against a drive: stroke, load of valve, force and speed, and the necessary slowdown.

    Options
    -------
    along : REF
        Reference, as for run.
    drive
        Drive or circuit file (TOML), or catalogue:NAME.
    """
    from pneudrive.control.demand import feasibility
    from pneudrive.control.references import check_reach, named_or_read
    from pneudrive.control.tuning import tune as tuned
    from pneudrive.describe.files.load import load_described
    from pneudrive.report.control.figures import plot_reference

    check_outputs(None, plot=plot)
    tuning = tuned(load_described(drive))
    found = named_or_read(along, tuning.plant.stroke_m, tuning.plant.speed_m_s)
    typer.echo(f"{found.text}\n{aligned(feasibility(tuning, found).rows())}")
    write_outputs((plot, partial(plot_reference, found, tuning.plant)))
    check_reach(found, tuning.plant.stroke_m, tuning.plant.speed_m_s)


def export(
    context: typer.Context,
    controller: str,
    to: Annotated[Literal["c", "st", "fmu"], typer.Option()],
    out: Annotated[Path, typer.Option()],
    reference: str | None = None,
    fmi: str = "2.0",
    drive: str | None = None,
    setup: SetupOption = "real",
    catalogue: CatalogueFolders = None,
) -> None:
    """Write a controller as source code, or as an FMU with its source code (nmpc: as a library).

    Options
    -------
    controller : FILE|LAW
        Controller file (TOML), or a name.
    to : c|st|fmu
        c; st, structured text of IEC 61131-3; or fmu, for other tools.
    out
        Folder of the files, or an .fmu file.
    reference : REF
        Reference of an FMU of nmpc: "220 mm; 1 s: 280 mm in 0.3 s", R1 to R6, or a file.
    fmi
        Version of an FMU: 2.0 or 3.0.
    drive
        Drive or circuit file (TOML), or catalogue:NAME; not needed if the file names it.
    """
    from pneudrive.control.source_code import export as exported
    from pneudrive.control.tuning import believed_by
    from pneudrive.control.tuning import tune as tuned
    from pneudrive.describe.files.load import load_described

    check_used(context, to, {"fmi": (("fmu",), "Remove it, or write --to fmu.")})
    file = controller if controller.endswith(".toml") else None
    described = believed_by(file) if drive is None else load_described(drive)
    believes = None if drive is None else described  # it goes before the drive that the file names
    found = tuned(described, None if file else controller, setup=setup, controller=file, believes=believes)
    written = exported(found, to, out, setup=setup, along=reference, version=fmi)
    if found.adaptation and (to != "fmu" or found.law != "nmpc"):
        typer.echo("The exported controller does not adapt: friction and valve are those of the description.")
    tell(written)

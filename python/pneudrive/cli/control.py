"""``pneudrive control``: tune controllers from a drive's description, run and compare them, check references.

Options
-------
setup
    Instrumentation: ideal, real, cheap (assumed values), or a TOML file; default: as in the controller file, or real.
reference : REF
    Reference: "sine 60 mm 0.5 Hz around 250 mm", "220 mm; 1 s: 280 mm in 0.3 s", R1 to R6, or a file. For a platform: a
    TOML file.
allow_code : SHA256
    Allow the code that a controller file names, by its SHA-256.
mismatch
    Deviation of the true drive: all, mass+30, sag, load-step, ... (assumed values), or a TOML file.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import typer

import pneudrive as pn
from pneudrive.cli.commands import group
from pneudrive.cli.options import Count, check_used, names_in
from pneudrive.cli.terminal import check_outputs, show_lines, show_paths, show_view, watch, write_outputs
from pneudrive.errors import CommandError, PneudriveError, warn
from pneudrive.lazy_names import used_later

with used_later(__name__):
    from pneudrive import platforms
    from pneudrive.control import benchmarks, loop, motion, scores, source_code, tuning
    from pneudrive.describe.files import load
    from pneudrive.report import trajectory as control_page
    from pneudrive.simulation import trajectory

SHOWN = ("max_error_m", "rmse_m", "settling_100_um_s", "rest_error_m", "hunting_m")
#: Files in the folder of a platform's run.
RUN, SCORE, PICTURE = "run.parquet", "score.csv", "pose.png"

control = group(
    dict.fromkeys(("tune", "run", "benchmark", "reference", "export"), __name__),
    "Tune, run, compare and export controllers, and check references; all runs are simulated.",
)


def tune(drive: str, *, law: str = "nmpc", setup: str = "real", out: Path | None = None) -> None:
    """Tune a controller from the description of a drive.

    Print the rule of each gain, the limits of the controller, and a simulated result.

    Options
    -------
    law
        Controller: pid, fuzzy, sliding-mode, super-twisting, inversion or nmpc.
    out
        Controller file (TOML) with all gains.

    Examples
    --------
    pneudrive control tune axis.toml --law super-twisting --out controller.toml
    """
    check_outputs(out, (".toml",))
    described = load.load_described(drive)
    found = tuning.tune(described, law, setup=setup)
    show_view(found.view())
    # Run the controller on its assumed drive, and warn if the drive does not follow the reference.
    try:
        prepared = loop.prepare(described, None, loop.ALONG, setup=setup, controller=found)
        run = loop.run_prepared(prepared, seed=1)
    except PneudriveError as error:
        warn(f"the controller was not tested on this drive: {error.what}")
    else:
        title = f"Simulated on this drive as described, along {prepared.reference.text}"
        show_view(replace(scores.view_of_score(run.provenance), title=title))
        score, reach = run.provenance["score"], prepared.reference.reach()
        if score["lost"] or score["max_error_m"] > loop.MOST * (reach.highest_m - reach.lowest_m):
            missed = f"{found.law} has an error of up to {1e3 * score['max_error_m']:.3g} mm in this test"
            warn(f"{missed}: choose another controller or drive")
    show_view(loop.suitability(described, setup))
    if (lag := loop.view_of_lag(described, found, setup)) is not None:
        show_view(lag)
    write_outputs((out, replace(found, source=drive).save))


def run(
    drive: str,
    *,
    reference: str,
    controller: str | None = None,
    law: str | None = None,
    setup: str | None = None,
    duration: str | None = None,
    seed: Count = 1,
    mismatch: str | None = None,
    initial: str | None = None,
    payload: str | None = None,
    dynamics: Literal["full", "constant"] = "full",
    out: Path | None = None,
    plot: Path | None = None,
    allow_code: str | None = None,
) -> None:
    r"""Run a drive or a platform under control along a reference, and score it.

    Options
    -------
    controller : FILE|LAW
        TOML file or name; default: nmpc, or inversion for strongly coupled legs.
    law : LAW
        Controller or own code: mine.py:Law.
    duration
        Duration, "12 s"; default: the duration of the reference.
    seed
        Seed of all noise.
    initial
        Start state, e.g. "pressure_a = 3 bar abs"; default: on the reference.
    payload
        Platform: mass that no controller knows, "2 kg"; or several masses: "0 kg, 2 kg".
    dynamics
        Platform: mass and load of the legs along the path (full), or at its start (constant).
    out
        File .parquet, .csv, .nc; platform: folder.

    Examples
    --------
    pneudrive control run axis.toml --controller controller.toml \
        --reference '220 mm; 0.5 s: 280 mm in 0.3 s' --plot move.png
    """
    is_file = controller is not None and controller.endswith(".toml")
    if law and controller and not is_file and law != controller:
        raise CommandError(f"--law {law} and --controller {controller} are both given", remedy="Keep one.")
    law, file = (law, controller) if is_file else (law or controller, None)
    options: dict[str, Any] = {"setup": setup, "duration": duration, "controller": file, "mismatch": mismatch}
    described = load.load_described(drive)
    if platforms.is_platform(described.circuit):
        if initial is not None or allow_code:
            raise CommandError.of("cli.platform")
        check_outputs(None, plot=plot)
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
        options |= {"payload": None if payload is None else names_in(payload), "seed": seed, "dynamics": dynamics}
        run = pn.control.run_pose(described.circuit, law, reference=reference, progress=watch().tell, **options)
        score = pn.control.PoseScore.read(run.attrs["score"])
        show_view(score.view(run.attrs))
        draw = partial(control_page.plot_control, run)
        of_folder = (
            (RUN, partial(trajectory.save, run)),
            (SCORE, lambda path: trajectory.write_whole(path, score.to_csv())),
            (PICTURE, draw),
        )
        write_outputs((plot, draw), *((out and out / name, write) for name, write in of_folder))
        if score.lost:
            raise typer.Exit(1)  # the view says which leg is lost
        return
    if payload is not None:
        raise CommandError(f"--payload {payload} is only for platforms", remedy="Use --mismatch, such as mass+30.")
    check_outputs(out, plot=plot)
    prepared = loop.prepare(described, law, reference, initial=initial, allow_code=allow_code, **options)
    found = loop.run_prepared(prepared, seed, watch())
    show_view(scores.view_of_score(found.provenance))
    write_outputs(
        (out, lambda path: trajectory.save(found.dataset(), path)),
        (plot, lambda path: control_page.plot_control(found.dataset(), path)),
    )


def benchmark(
    drive: str,
    *,
    out: Path,
    laws: str = "all",
    references: str = "standard",
    seeds: int = 5,
    setup: str = "real",
    allow_code: str | None = None,
    mismatch: str | None = None,
    spread: str | None = None,
    members: int | None = None,
    threads: int | None = None,
) -> None:
    """Compare controllers along references, with several seeds or a spread of drives.

    Options
    -------
    out
        Folder for scores, runs and report; an unfinished comparison in this folder is resumed.
    laws : all|A,B
        all, or names, controller files and your own code (mine.py:Law), separated by commas.
    references : standard|REF,...
        standard (R1, R2, R3, R5, R6), or references separated by commas.
    seeds
        Number of seeds.
    spread
        Different drives instead of seeds: standard, or a TOML file with ranges.
    members
        Number of members of the spread; default 200.
    threads
        Simultaneous runs; default: one per processor.

    Examples
    --------
    pneudrive control benchmark axis.toml --laws pid,nmpc --out compared
    """
    found = benchmarks.benchmark(
        load.load_described(drive),
        laws if laws == "all" else names_in(laws),
        references if references == "standard" else names_in(references),
        mismatch=mismatch,
        spread=spread,
        members=members,
        seeds=seeds,
        named=drive,
        setup=setup,
        threads=threads,
        out=out,
        progress=watch().tell,
        allow_code=allow_code,
    )
    show_view(control_page.controllers_view(found, SHOWN))
    show_paths(out / benchmarks.SCORES, control_page.write_control_report(found, out))


def reference(along: str, *, drive: str, plot: Path | None = None) -> None:
    """Check a reference against a drive: stroke, used fractions of opening, force and speed, necessary slowdown.

    Options
    -------
    along : REF
        Reference, as for run.
    drive
        Drive or circuit file (TOML), or catalogue:NAME.

    Examples
    --------
    pneudrive control reference R1 --drive axis.toml
    """
    check_outputs(None, plot=plot)
    tuned = tuning.tune(load.load_described(drive))
    path = motion.named_or_read(along, *tuned.reach)
    show_view(loop.feasibility(tuned, path).view())
    write_outputs((plot, partial(control_page.plot_reference, path, tuned)))
    motion.check_reach(path, *tuned.reach)


def export(
    context: typer.Context,
    controller: str,
    *,
    to: Literal["c", "st", "fmu"],
    out: Path,
    reference: str | None = None,
    fmi: str = "2.0",
    drive: str | None = None,
    setup: str | None = None,
    name: str | None = None,
    precision: Literal["double", "single"] = "double",
) -> None:
    r"""Write a controller as source code, or as an FMU with its source code (nmpc: as a library).

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

    name : NAME
        Name of the source files, and prefix of the names in them. Axes in one program need different names.
    precision
        Precision of the C code. Use single for a processor that computes only float in hardware.

    Examples
    --------
    pneudrive control export controller.toml --to c --out source --name left
    pneudrive control export nmpc --drive axis.toml --to fmu --reference R1 \
        --out law.fmu
    """
    uses = {
        "fmi": (("fmu",), "Remove it, or write --to fmu."),
        "name": (("c", "st"), "Remove it."),
        "precision": (("c",), "Remove it, or write --to c."),
    }
    check_used(context, to, uses)
    file = controller if controller.endswith(".toml") else None
    described = None if drive is None else load.load_described(drive)  # it goes before the drive that the file names
    found = tuning.tune(None, None if file else controller, setup=setup, controller=file, believes=described)
    written = source_code.export(found, to, out, along=reference, version=fmi, name=name, precision=precision)
    show_lines(f"setup {found.setup}")
    show_paths(*written)

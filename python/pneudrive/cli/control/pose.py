"""``pneudrive control run`` of a platform on several cylinders."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import typer

from pneudrive.cli.options import names_in
from pneudrive.cli.output import check_outputs, show_events, write_outputs
from pneudrive.repr_tables import aligned

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.describe.circuit import Circuit

#: Files of a run in its folder.
RUN, SCORE, PICTURE = "run.parquet", "score.csv", "pose.png"


def run_platform(
    circuit: Circuit, reference: str, payload: str | None, out: Path | None, plot: Path | None, options: dict[str, Any]
) -> None:
    """Run a platform along a path, print its score, and write run, score and picture into a folder."""
    from pneudrive.cli.progress import on_terminal
    from pneudrive.control.pose import PoseScore, run_pose
    from pneudrive.report.control.pose import plot_pose
    from pneudrive.simulation.trajectory import save, whole

    def write_score(path: Path) -> None:
        with whole(path) as temporary:
            temporary.write_text(score.to_csv(), encoding="utf-8")

    check_outputs(None, plot=plot)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
    payloads = None if payload is None else names_in(payload)
    run = run_pose(circuit, reference=reference, payload=payloads, progress=on_terminal().tell, **options)
    said, score = run.attrs, PoseScore.read(run.attrs["score"])
    loaded = f", payload {said['payload']}" if said["payload"] else ""
    title = f"{said['law']} on {circuit.name} along {reference}, setup {said['setup']}, seed {said['seed']}{loaded}"
    typer.echo(f"{title}, simulated:")
    typer.echo(aligned(score.table(), right_from=1))
    typer.echo("\n".join(score.notes()))
    if score.spread():
        typer.echo(f"\n{aligned(score.spread(), right_from=1)}")
    show_events(said["events"])
    draw = partial(plot_pose, run)
    of_folder = ((RUN, partial(save, run)), (SCORE, write_score), (PICTURE, draw))
    write_outputs((plot, draw), *((out and out / name, write) for name, write in of_folder))

"""``pneudrive platform``: ranges, loads and limits of a platform on legs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, cast

import typer

from pneudrive.cli.options import CatalogueFolders
from pneudrive.repr_tables import aligned

if TYPE_CHECKING:
    from pneudrive.describe import Circuit


def platform(
    circuit: Annotated[str, typer.Argument(help="Circuit file (TOML) with a platform.", metavar="CIRCUIT")],
    name: Annotated[str | None, typer.Option(help="Platform, if the circuit has several.")] = None,
    catalogue: CatalogueFolders = None,
) -> None:
    """Show ranges, singular values and loads of a platform on legs, and the limits of its workspace."""
    from pneudrive.describe.files.load import load_described
    from pneudrive.platforms import platform as platform_of

    own = platform_of(cast("Circuit", load_described(circuit)), name)
    typer.echo(f"{own.name}: {own.text(own.home)}, with every leg at half of its stroke")
    forces = own.load(own.home)
    rows = [("leg", "position mm", "stroke mm", "load N")]
    for leg, x, force in zip(own.legs, own.inverse(own.home), forces, strict=True):
        rows.append((leg.name, f"{1e3 * x:.4g}", f"{1e3 * leg.stroke_m:.4g}", f"{force:.4g}"))
    typer.echo(aligned(rows, right_from=1))
    values = ", ".join(f"{value:.4g}" for value in own.singular_values(own.home))
    typer.echo(f"singular values, without unit: {values}\n")
    space = own.workspace()
    table = [("coordinate", "from", "limited by", "to", "limited by", "singular value", "largest load N")]
    for k, (key, limits) in enumerate(space.limits.items()):
        poses = [own.home.copy(), own.home.copy()]
        ends = []
        for pose, limit in zip(poses, limits, strict=True):
            pose[k] = limit.value
            ends += [own.text(pose).split(", ")[k].partition(" = ")[2], limit.reason]
        least = min(float(own.singular_values(pose)[-1]) for pose in poses)
        most = max(float(abs(own.load(pose)).max()) for pose in poses)
        table.append((key, *ends, f"{least:.3g}", f"{most:.4g}"))
    typer.echo(aligned(table, right_from=5))
    typer.echo("One coordinate moves at a time, the others stay at half strokes. Loads hold the platform at rest.")

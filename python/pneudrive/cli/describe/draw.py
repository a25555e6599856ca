"""``pneudrive draw``: draw a drive or a circuit."""

from __future__ import annotations

from pathlib import Path

import typer

from pneudrive.cli.options import CatalogueFolders, Described
from pneudrive.cli.output import check_outputs


def draw(
    drive: Described,
    out: Path = Path("circuit.svg"),
    catalogue: CatalogueFolders = None,
) -> None:
    """Draw a drive or a circuit with symbols after ISO 1219.

    Options
    -------
    out
        Picture: .svg, .png or .pdf.
    """
    from pneudrive.describe.files import toml
    from pneudrive.describe.files.load import load_described
    from pneudrive.errors import DescriptionError
    from pneudrive.files.content import read_text
    from pneudrive.report.circuit.drawing import draw_circuit

    check_outputs(None, plot=out)
    circuit = load_described(drive).circuit
    try:
        draw_circuit(circuit, out)
    except DescriptionError as error:
        raise toml.located(error, drive, read_text(Path(drive), DescriptionError, folder="")) from None
    typer.echo(str(out))
    for name, volume in circuit.joint_volumes:
        typer.echo(f"joint of {name}: {1e6 * volume:.3g} cm3")

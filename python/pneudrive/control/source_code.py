"""A law with its observer as source code: C, or structured text of IEC 61131-3 for a PLC."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pneudrive import __version__, _core
from pneudrive.control.setup import Setup, read_setup
from pneudrive.errors import CommandError, nearest
from pneudrive.trajectory import whole

if TYPE_CHECKING:
    from pneudrive.control.tuning import Tuning

#: Languages: word of an option -> what it is.
LANGUAGES = {"c": "C99, a header and a source file", "st": "structured text, a function block"}


def export(
    tuning: Tuning, to: Literal["c", "st"], out: str | Path, *, setup: Setup | str | Path = "real"
) -> list[Path]:
    """Write the source code of a law and of its observer, made from the equations that `pneudrive.control.run` runs.

    The code takes samples and where the drive is to be, and gives the command. It learns nothing: friction and valve
    are those of the description. It supervises nothing.

    Parameters
    ----------
    tuning : Tuning
        What `pneudrive.control.tune` returned. Every law but ``nmpc`` and one's own.
    to : str
        ``"c"`` or ``"st"``.
    out : path-like
        Folder; it is made where it is not there.
    setup : Setup, str or path-like
        Its position sensor decides the gain of the observer; without pressure sensors the code asks for none.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    CommandError
        The law cannot be exported, or a file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import pneudrive as pn
    >>> tuning = pn.control.tune(pn.Drive.load("catalogue:reference"), "super-twisting")
    >>> [path.name for path in pn.control.export(tuning, "c", tempfile.mkdtemp())]
    ['pneudrive_super_twisting.h', 'pneudrive_super_twisting.c']
    """
    if to not in LANGUAGES:
        raise CommandError(f'there is no language "{to}"', remedy=nearest(to, LANGUAGES))
    read, _ = read_setup(setup)
    belief = tuning.belief
    form = read.core(0, belief.ambient.pressure_pa)
    about = f"For {belief.name}, description {belief.description_hash}; pneudrive {__version__}."
    about = about.replace("*", "").encode("ascii", "replace").decode()
    try:
        files = _core.control_export(json.dumps(tuning.core()), json.dumps(form), to, about)
    except ValueError as error:
        raise CommandError(str(error)) from None
    folder = Path(out)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommandError(f"the folder {folder} cannot be made", value=error.strerror) from None
    for name, text in files:
        with whole(folder / name) as temporary:
            temporary.write_text(text, encoding="ascii")
    return [folder / name for name, _ in files]

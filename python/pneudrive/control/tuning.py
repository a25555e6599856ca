"""Tuning: a law's gains from the description of the drive."""

from __future__ import annotations

import json
import os
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive import _core
from pneudrive.control.axis import check_axis, check_valves, limitations, unknown_numbers
from pneudrive.control.controller import Controller, gain_quantity
from pneudrive.control.own_law import OWN, OwnLaw, is_own, own_law
from pneudrive.control.setup import Setup, law_remedy, read_setup
from pneudrive.control.tuned import LawModel, Plant, TunedGain, Tuning, core_form, factors_form, is_code_file
from pneudrive.describe.files import toml
from pneudrive.describe.files.catalogue import PREFIX
from pneudrive.describe.keys import wrong
from pneudrive.errors import CommandError, DescriptionError, nearest
from pneudrive.own_code import split
from pneudrive.simulation.simulate import require

if TYPE_CHECKING:
    from collections.abc import Callable

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive

__all__ = ["LawModel", "Plant", "TunedGain", "Tuning", "alone", "believed_by", "laws", "tune"]

DEFAULT_LAW = "nmpc"
#: Key, unit, value, meaning and rule of a number, as the core lists it.
_Ruled = tuple[str, str, float, str, str]


def laws() -> list[str]:
    """Return the keys of all laws.

    Examples
    --------
    >>> "nmpc" in laws()
    True
    """
    return list(_core.control_laws())


def tune(
    drive: Drive | Circuit,
    law: str | object | None = None,
    *,
    setup: Setup | str | Path = "real",
    controller: Controller | str | Path | None = None,
    believes: Drive | Circuit | None = None,
    allow_code: str | None = None,
) -> Tuning:
    """Return a law with gains that follow from the description of a drive.

    Parameters
    ----------
    drive : Drive or Circuit
        With one cylinder and one reservoir, on one proportional 5/3 valve, two proportional 3/2 valves, four 2/2
        switching valves, or one 5/3 switching valve.
    law : str or object, optional
        Of `laws`; the default is that of the controller, or ``"nmpc"``. One's own: see `pneudrive.control.run`.
    setup : Setup, str or path-like
        What the law is run in; it decides what is said about limits, not the gains.
    controller : Controller, str or path-like, optional
        A controller, or its TOML file: period, gains that are given and not tuned, standing still, and the drive that
        the law believes in.
    believes : Drive or Circuit, optional
        What the law believes of the drive, in place of `drive` and of the controller's.
    allow_code : str, optional
        SHA-256 of the file of a law of one's own that only the controller's file names.

    Raises
    ------
    DescriptionError
        A file is not valid, a gain is unknown or out of bounds, or the drive is none that a law can command.
    CommandError
        The law is unknown, or both `law` and a controller with another law are given.

    Examples
    --------
    >>> import pneudrive as pn
    >>> tuning = pn.control.tune(pn.Drive.load("catalogue:reference"), "nmpc")
    >>> [gain.key for gain in tuning.gains]
    ['bandwidth', 'move_penalty']
    """
    read, _ = read_setup(setup)
    own = own_law(law) if is_own(law) else None
    table, folder, path, text = _table(law if own is None else own, controller)
    if own is None and is_own(table.law):
        own = own_law(_beside(table.law, folder), allow_code=allow_code, found_in=path)
    with toml.locating(path, text) if path else nullcontext():
        word = table.law if own is None else OWN
        believed = drive if believes is None else believes
        tuning = _tuned(table, word, believed, folder, is_told=believes is not None)
    if own is not None:
        tuning = replace(tuning, own=own, law=own.name)
    return replace(tuning, limits=limitations(tuning, read))


def alone(tuning: Tuning, **others: object) -> Tuning:
    """Return a tuning, and reject arguments that the tuning already has."""
    for name in (name for name, one in others.items() if one is not None):
        what = f"{name} and a tuning of {tuning.law} for {tuning.belief.name} are given"
        raise CommandError(what, remedy="Give the tuning alone: it has a law and what that believes.")
    return tuning


def _table(law: object, controller: Controller | str | Path | None) -> tuple[Controller, Path, str, str]:
    """Return a controller, its folder, and path and text of its file."""
    if controller is None:
        word = OWN if isinstance(law, OwnLaw) else law or DEFAULT_LAW
        if word != OWN and word not in laws():
            raise CommandError(f'there is no law "{word}"', remedy=law_remedy(str(word)))
        return Controller(law=str(word)), Path(), "", ""
    if isinstance(controller, Controller):
        table, path, text = controller, "", ""
    else:
        path = str(controller)
        tables, text = toml.read(path, start=f'For instance: schema = 1, then law = "{DEFAULT_LAW}".')
        with toml.locating(path, text):
            table = Controller.model_validate(tables)
    assert isinstance(table, Controller)
    folder, where = Path(path).parent, path or None
    named = law.name if isinstance(law, OwnLaw) else law
    fits = {table.law, _beside(table.law, folder)} | (
        {named} if table.law == OWN and isinstance(law, OwnLaw) else set()
    )
    if named is not None and not {named, _beside(str(named), Path())} & fits:
        what = f'law "{named}" and a controller of law "{table.law}" are given'
        raise CommandError(what, where=where, remedy="Give one.")
    if table.law == OWN and named is None:
        raise CommandError(f'law = "{OWN}" is a law that is not given', where=where, remedy="Give it as law.")
    return table, folder, path, text


def _beside(law: str, folder: Path) -> str:
    """Return the name of code in the folder of a controller file; leave other names unchanged."""
    module, name = split(law) or ("", "")
    return f"{os.path.normpath(folder / module)}:{name}" if is_code_file(module) else law


def _tuned(table: Controller, word: str, drive: Drive | Circuit, folder: Path, *, is_told: bool) -> Tuning:
    """Read the gains of a controller and derive the others from the law's model."""
    source = ""
    if table.drive is not None and not is_told:
        drive, source = _believed(table.drive, folder)
    require(drive, "core_json", "drive", 'pn.Drive.load("drive.toml")')
    belief = drive.circuit
    check_valves(belief)

    def asked(
        gains: dict[str, float] | None = None,
        valves: dict[str, float] | None = None,
        more: dict[str, Any] | None = None,
    ) -> tuple[dict[str, Any], list[list[_Ruled]]]:
        numbers = {"gains": gains or {}, "valves": valves or {}}
        form = core_form(word, table.period_s, table.hold, table.adaptation, belief, numbers)
        return _core.control_tune(json.dumps(form | (more or {})), 0.0)

    try:
        plant, ruled = asked()
    except ValueError as error:
        if str(error).startswith("period"):
            raise wrong("period", str(error)) from None
        raise DescriptionError(str(error), where=belief.name) from None
    check_axis(belief, plant)
    plant["left_out"] += unknown_numbers(belief)
    gains = _numbers_of("gains", table.law, table.gains, ruled[0], lambda given: asked(gains=given))
    if table.valves and not ruled[1]:
        what = "the controller has a table [valves], and the drive one proportional 5/3 valve"
        raise wrong("valves", what, rule="it is for several or switching valves", remedy="Leave it out.")
    valves = _numbers_of("valves", "these valves", table.valves, ruled[1], lambda given: asked(valves=given))
    chosen = factors_form(table.factors)
    if chosen:
        try:
            asked(more=chosen)
        except ValueError as error:
            raise wrong(str(error).split(" ")[0], str(error)) from None
    made = Tuning(table.law, table.period_s, table.hold, table.adaptation, gains, Plant(**plant), belief, source)
    return replace(made, supervision=table.supervision, valves=valves, factors=table.factors)


def _numbers_of(
    table: str, whose: str, values: dict[str, Any], ruled: list[_Ruled], check: Callable[[dict[str, float]], object]
) -> tuple[TunedGain, ...]:
    """Read the numbers of a table of a controller file; missing ones keep the core's default."""
    known = {key: gain_quantity(unit) for key, unit, *_ in ruled}
    given: dict[str, float] = {}
    for key, value in values.items():
        if key not in known:
            remedy = nearest(key, known) if known else "There is none: leave the table out."
            raise wrong(f"{table}.{key}", f"{table}.{key} is no gain of {whose}", remedy=remedy)
        given[key] = known[key].read_at(f"{table}.{key}", value)
        try:
            check({key: given[key]})
        except ValueError as error:
            raise wrong(f"{table}.{key}", str(error)) from None
    return tuple(
        TunedGain(key, unit, given.get(key, value), meaning, rule, key in given)
        for key, unit, value, meaning, rule in ruled
    )


def believed_by(controller: str | None) -> Drive | Circuit:
    """Load the drive that a controller file names.

    Raises
    ------
    CommandError
        There is no file, or it names none.
    DescriptionError
        A file is not valid.
    """
    table, folder, path, _ = _table(None, controller)
    if table.drive is None:
        raise CommandError("no drive is named", where=path or None, remedy="Name one: --drive DRIVE.")
    return _believed(table.drive, folder)[0]


def _believed(source: str, folder: Path) -> tuple[Drive | Circuit, str]:
    """Load the drive that a controller file names relative to its folder; return its name from here, too."""
    from pneudrive.describe.files.load import load_described

    path = source if source.startswith(PREFIX) else str(folder / source)
    return load_described(path), path

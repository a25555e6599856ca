"""A controller for other tools: C, structured text of IEC 61131-3 for a PLC, or an FMU."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pneudrive import __version__, _core
from pneudrive.control.motion import Reference, ReferenceOrFile, check_reach, named_or_read
from pneudrive.control.setup import Setup, SetupOrFile, read_setup
from pneudrive.errors import CommandError, nearest, package_table
from pneudrive.files.content import rendered
from pneudrive.files.writing import make_result_folder
from pneudrive.fmu.variables import TIME, FmuPlan, FmuVariable
from pneudrive.simulation.simulate import require
from pneudrive.simulation.trajectory import write_whole

if TYPE_CHECKING:
    from pneudrive.control.tuning import Tuning

LANGUAGES = ("c", "st", "fmu")  # C99; structured text; Functional Mock-up Unit for co-simulation
#: Words that cannot be names in structured text.
RESERVED = frozenset(package_table(__file__, "structured_text.toml")["reserved"].split())
_OF_A_NAME = "a name of source code consists of letters, digits and underscores, and begins with a letter"
#: Inputs and outputs of an FMU of `nmpc`: name, unit, meaning.
VARIABLES: dict[str, list[tuple[str, str, str]]] = package_table(__file__, "fmu_of_nmpc.toml")


def export(
    tuning: Tuning,
    to: Literal["c", "st", "fmu"],
    out: str | Path,
    *,
    setup: SetupOrFile | None = None,
    along: ReferenceOrFile | None = None,
    version: str = "2.0",
    name: str | None = None,
    precision: Literal["double", "single"] = "double",
) -> list[Path]:
    """Write a controller for other tools, from the equations of `pneudrive.control.run`.

    The code receives samples and the reference, and returns the command. The code checks sensors and reference, stops
    by ramps, and adapts if the controller does so. It does not brake before an end stop. An FMU has the same C code in
    ``sources/``, and a library if this machine has a C compiler. ``nmpc`` cannot be written as source code: its FMU is
    a library with the whole controller and its reference.

    Parameters
    ----------
    tuning : Tuning
        Result of `pneudrive.control.tune` for any law that is not custom; ``nmpc`` as an FMU only.
    to : str
        ``"c"``, ``"st"`` or ``"fmu"``.
    out : path-like
        Folder, which is made if it does not exist; for an FMU, a file ending in ``.fmu``.
    setup : Setup, str or path-like, optional
        The position sensor decides the gain of the observer. Without pressure sensors, the code has no inputs for them.
        Default: the setup of the tuning.
    along : Reference, str or path-like, optional
        Reference of an FMU of ``nmpc``, as for `pneudrive.control.run`. Other controllers get the reference as inputs.
    version : str
        ``"2.0"`` or ``"3.0"``, of the Functional Mock-up Interface.
    name : str, optional
        Name of the source files, and prefix of the names in them, such as ``"left_axis"``; not for FMUs. By default
        ``"pneudrive_<law>"``. Axes in one program need different names.
    precision : str
        ``"double"``, with results that are bit-identical to the simulation, or ``"single"``: C with ``float``, for
        processors whose floating-point unit has single precision only, such as Cortex-M4F.

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
    ['pneudrive_super_twisting.h', 'pneudrive_super_twisting.c', 'pneudrive_math.h', 'conformance.txt', 'example.c']
    """
    if to not in LANGUAGES:
        raise CommandError(f'there is no language "{to}"', remedy=nearest(to, LANGUAGES))
    require(tuning, "plant", "tuning", "pn.control.tune(drive)")
    read, called = read_setup(tuning.setup if setup is None else setup)
    if name is not None and to == "fmu":
        raise CommandError("the files in an FMU have fixed names", remedy="Leave the name out.")
    if name is not None:
        is_reserved = to == "st" and name.upper() in RESERVED
        if is_reserved or not (name.isidentifier() and name.isascii()):
            rule = "structured text reserves this word" if is_reserved else _OF_A_NAME
            raise CommandError.of("control.name_of_code", name=name, rule=rule)
    if precision != "double" and (to, precision) != ("c", "single"):
        raise CommandError.of("control.precision", to=to, precision=precision)
    is_nmpc = to == "fmu" and tuning.law == "nmpc" and tuning.own is None
    if is_nmpc and along is None:
        raise CommandError.of("control.nmpc_alone")
    if not is_nmpc and along is not None:
        raise CommandError(f"{tuning.law} as {to} gets the reference as an input", remedy="Leave the reference out.")
    if to == "fmu":
        from pneudrive.fmu.package import check_fmu, write_fmu

        target = check_fmu(out, version)
        if along is None:
            plan = code_plan(tuning, *_written(tuning, read, called, "c"))
        else:
            to_follow = named_or_read(along, *tuning.reach)
            check_reach(to_follow, *tuning.reach)
            plan = law_plan(tuning, to_follow, read)
        return [write_fmu(plan, target, version).path]
    files, _ = _written(tuning, read, called, "c-single" if precision == "single" else to, name)
    if to == "c" and name != "example":
        places = {"name": files[0][0].removesuffix(".h"), "real": "float" if precision == "single" else "double"}
        example = rendered(Path(__file__).with_name("example.c.jinja"), {}, tuning=tuning, setup=read, **places)
        files.append(("example.c", example))
    folder = Path(out)
    make_result_folder(folder)
    return [write_whole(folder / name, text, "ascii") for name, text in files]


def _written(
    tuning: Tuning, setup: Setup, called: str, to: Literal["c", "c-single", "st"], name: str | None = None
) -> tuple[list[tuple[str, str]], list[tuple[str, str, str, str, float]]]:
    """Return the files of a controller, and the variables of its code."""
    if tuning.law == "nmpc":
        raise CommandError.of("control.nmpc_source")
    belief = tuning.belief
    form = setup.core(0, belief.ambient.pressure_pa)
    without = f" It does not model {', '.join(tuning.plant.left_out)}." if tuning.plant.left_out else ""
    made = f"description {belief.description_hash}, setup {called}; pneudrive {__version__}"
    about = f"For {belief.name}, {made}.{without}"
    about = about.replace("*", "").encode("ascii", "replace").decode()
    try:
        return _core.control_export(json.dumps(tuning.core()), json.dumps(form), to, about, name)
    except ValueError as error:
        raise CommandError(str(error)) from None


def code_plan(
    tuning: Tuning, files: list[tuple[str, str]], variables: list[tuple[str, str, str, str, float]]
) -> FmuPlan:
    """Return the plan of the FMU that contains a controller as C code.

    Parameters
    ----------
    tuning : Tuning
    files, variables : list
        Result of `pneudrive._core.control_export`.
    """
    given = []
    for causality, name, unit, meaning, value in variables:
        # FMI supports only integer exponents of units.
        si, what = ("1", f"{meaning}, {unit}") if "^0." in unit else (unit, meaning)
        si = si.replace("/s2", "/s^2").replace("/s3", "/s^3")
        start = None if causality == "output" else value
        given.append(FmuVariable(name, si, what, causality, {"role": causality}, start))
    identifier = next(name for name, _ in files if name.endswith(".c")).removesuffix(".c")
    return FmuPlan(
        title=f"{tuning.law} for {tuning.belief.name}",
        variables=(TIME, *given),
        period_s=tuning.core()["period_s"],
        code=tuple(files),
        identifier=identifier,
    )


def law_plan(tuning: Tuning, reference: Reference, setup: Setup) -> FmuPlan:
    """Return the plan of the FMU of a law.

    Parameters
    ----------
    tuning : Tuning
        Tuning of a law that is not custom.
    reference : Reference
        Reference that begins at the start position of the run in the other tool.
    setup : Setup
        The position sensor decides the gain of the observer. Without pressure sensors, the law has no inputs for them.

    Raises
    ------
    CommandError
        The law commands several valves or a switching valve.
    """
    if tuning.valves:
        raise CommandError.of("control.fmu_of_valves")
    rest_pa = tuning.belief.ambient.pressure_pa
    form = setup.core(0, rest_pa)
    starts = {"position": float(reference.at([0.0])[0, 0]), "enabled": 1.0, "emergency_stop": 0.0}
    if form["pressures"] is not None:
        starts |= {"pressure_a": rest_pa, "pressure_b": rest_pa}
    inputs = [
        FmuVariable(*row, "input", {"role": "input", "of": row[0], "discrete": False}, starts[row[0]])
        for row in VARIABLES["inputs"]
        if row[0] in starts
    ]
    outputs = [FmuVariable(*row, "output", {"role": "output", "of": row[0]}) for row in VARIABLES["outputs"]]
    law = {"controller": tuning.core(), "motion": reference.core(), "position": form["position"]}
    return FmuPlan(
        title=f"{tuning.law} for {tuning.belief.name}",
        variables=(TIME, *inputs, *outputs),
        law=law,
        period_s=law["controller"]["period_s"],
    )

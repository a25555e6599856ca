"""A law with its observer, supervisor and reference as a Functional Mock-up Unit.

Inputs are samples, the output is the command.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pneudrive.errors import CommandError
from pneudrive.fmu.variables import FmuCode, FmuPlan, FmuVariable

if TYPE_CHECKING:
    from pneudrive.control.motion import Reference
    from pneudrive.control.setup import Setup
    from pneudrive.control.tuning import Tuning

#: Name, unit, meaning.
_OUTPUTS = (
    ("command", "1", "command to the valve, -1 .. 1, of the last sample"),
    ("reference", "m", "where the piston was to be at the last sample"),
    ("reference_velocity", "m/s", "how fast it was to be there"),
    ("estimated_velocity", "m/s", "velocity of the piston as the observer has it"),
    ("disturbance", "N", "force on the piston that the model does not explain"),
    ("holds", "1", "1 where the law stands still on purpose, else 0"),
    ("events", "1", "how many events the supervisor has told so far"),
)


def code_plan(
    tuning: Tuning, files: list[tuple[str, str]], variables: list[tuple[str, str, str, str, float]]
) -> FmuPlan:
    """Return the plan of the FMU that contains a controller as C code.

    Parameters
    ----------
    tuning : Tuning
    files, variables : list
        Of `pneudrive._core.control_export`.
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
        form={},
        start={},
        rtol=1e-6,
        variables=(FmuVariable("time", "s", "time", "independent", {"role": "time"}), *given),
        code=FmuCode(identifier, tuple(files), tuning.core()["period_s"]),
    )


def law_plan(tuning: Tuning, reference: Reference, setup: Setup) -> FmuPlan:
    """Return the plan of the FMU of a law.

    Parameters
    ----------
    tuning : Tuning
        Of every law but one's own.
    reference : Reference
        It begins where the run of the other tool does.
    setup : Setup
        Its position sensor decides the gain of the observer; without pressure sensors the law has no inputs for them.

    Raises
    ------
    CommandError
        The law is one's own, or it commands several or switching valves.
    """
    if tuning.own is not None:
        raise CommandError("a law of one's own cannot be part of an FMU", remedy="Choose a law of pneudrive.")
    if tuning.valves:
        what = "the FMU of a law has one command, and this drive several or switching valves"
        raise CommandError(what, remedy="Tune the law for one proportional 5/3 valve.")
    form = setup.core(0, tuning.belief.ambient.pressure_pa)
    rest_pa = tuning.belief.ambient.pressure_pa
    given = [
        (
            "position",
            "m",
            "measured position of the piston, from the end of chamber a",
            float(reference.at([0.0])[0, 0]),
        )
    ]
    if form["pressures"] is not None:
        given += [
            (f"pressure_{side}", "Pa", f"measured pressure in chamber {side}, absolute", rest_pa) for side in "ab"
        ]
    given += [
        ("enabled", "1", "above 0.5: the drive may move", 1.0),
        ("emergency_stop", "1", "above 0.5: the drive has to stop", 0.0),
    ]
    inputs = [FmuVariable(name, unit, what, "input", _role("input", name), start) for name, unit, what, start in given]
    outputs = [FmuVariable(name, unit, what, "output", _role("output", name)) for name, unit, what in _OUTPUTS]
    time = FmuVariable("time", "s", "time", "independent", {"role": "time"})
    law = {"controller": tuning.core(), "motion": reference.core(), "position": form["position"]}
    return FmuPlan(
        title=f"{tuning.law} for {tuning.belief.name}",
        form={},
        start={},
        rtol=1e-6,
        variables=(time, *inputs, *outputs),
        law=law,
    )


def _role(word: str, name: str) -> dict[str, Any]:
    return {"role": word, "of": name} | ({"discrete": False} if word == "input" else {})

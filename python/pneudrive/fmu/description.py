"""modelDescription.xml of FMI 2.0 and 3.0."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from pneudrive import __version__
from pneudrive.fmu.dimensions import DISPLAYED, exponents

if TYPE_CHECKING:
    from pneudrive.fmu.variables import FmuCode, FmuPlan, FmuVariable

#: Name of the library without its suffix, in every FMU.
IDENTIFIER = "pneudrive"
_STRUCTURED = re.compile(r"(der\()?[A-Za-z_]\w*(\.[A-Za-z_]\w*)*(\[\d+\])?\)?")
#: Characters that XML cannot hold, in whatever way they are written.
_FOREIGN = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_ABOUT = (
    "Pressures are absolute. Positions and velocities grow towards the end of chamber b. In model exchange a step of "
    "the command has to be an event of the input: a steep ramp in its place gives wrong results without a message."
)
_ABOUT_LAW = (
    "Pressures are absolute. Samples are taken at each multiple of {period} s, with the inputs at the beginning of a "
    "step: step the controller before its drive, with that period or a part of it."
)


def description(plan: FmuPlan, version: str) -> bytes:
    """Return modelDescription.xml.

    Parameters
    ----------
    plan : FmuPlan
    version : str
        ``"2.0"`` or ``"3.0"``.
    """
    is_two = version == "2.0"
    states = [variable for variable in plan.variables if variable.rate_of]
    indicators = [variable for variable in plan.variables if variable.role["role"] == "event"]
    structured = all(_STRUCTURED.fullmatch(variable.name) for variable in plan.variables)
    root = ElementTree.Element(
        "fmiModelDescription",
        {
            "fmiVersion": version,
            "modelName": plan.title,
            "guid" if is_two else "instantiationToken": plan.token,
            "description": _ABOUT if plan.period_s is None else _ABOUT_LAW.format(period=plan.period_s),
            "generationTool": f"pneudrive {__version__}",
            "variableNamingConvention": "structured" if structured else "flat",
            **({"numberOfEventIndicators": str(len(indicators))} if is_two else {}),
        },
    )
    _interfaces(root, plan, is_two)
    _units(root, plan)
    categories = ElementTree.SubElement(root, "LogCategories")
    ElementTree.SubElement(categories, "Category", name="logStatusError", description="Errors with remedies")
    experiment = {"startTime": "0", "stopTime": "1", "tolerance": repr(plan.rtol)}
    if plan.period_s is not None:
        experiment["stepSize"] = repr(plan.period_s)
    ElementTree.SubElement(root, "DefaultExperiment", experiment)
    variables = ElementTree.SubElement(root, "ModelVariables")
    places = {one.name: i for i, one in enumerate(plan.variables)}
    for one in plan.variables:
        (_variable_two if is_two else _variable_three)(variables, one, places)
    structure = ElementTree.SubElement(root, "ModelStructure")
    outputs = [places[variable.name] for variable in plan.variables if variable.causality == "output"]
    rates = [places[state.name] for state in states]
    unknown = sorted({*outputs, *rates, *(places[state.rate_of] for state in states)})
    if is_two:
        for tag, each in (("Outputs", outputs), ("Derivatives", rates), ("InitialUnknowns", unknown)):
            within = ElementTree.SubElement(structure, tag) if each else structure
            for place in each:
                ElementTree.SubElement(within, "Unknown", index=str(place + 1))
    else:
        events = [places[indicator.name] for indicator in indicators]
        each_kind = (
            ("Output", outputs),
            ("ContinuousStateDerivative", rates),
            ("InitialUnknown", unknown),
            ("EventIndicator", events),
        )
        for tag, each in each_kind:
            for place in each:
                ElementTree.SubElement(structure, tag, valueReference=str(place))
    ElementTree.indent(root)
    text = _FOREIGN.sub("\ufffd", ElementTree.tostring(root, encoding="unicode"))
    return f"<?xml version='1.0' encoding='utf-8'?>\n{text}".encode()


def compiled_files(code: FmuCode, version: str) -> tuple[str, ...]:
    """Return the names of the C files that a tool compiles."""
    return (f"fmi{version[0]}.c", *(name for name, _ in code.files if name.endswith(".c")))


def build_description(code: FmuCode) -> bytes:
    """Return sources/buildDescription.xml of FMI 3.0."""
    root = ElementTree.Element("fmiBuildDescription", fmiVersion="3.0")
    build = ElementTree.SubElement(root, "BuildConfiguration", modelIdentifier=code.identifier)
    files = ElementTree.SubElement(build, "SourceFileSet", language="C99")
    for name in compiled_files(code, "3.0"):
        ElementTree.SubElement(files, "SourceFile", name=name)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


def _interfaces(root: ElementTree.Element, plan: FmuPlan, is_two: bool) -> None:
    steps = {"canHandleVariableCommunicationStepSize": "true"}
    if plan.code is not None:
        own = ElementTree.SubElement(root, "CoSimulation", {"modelIdentifier": plan.code.identifier} | steps)
        if is_two:
            files = ElementTree.SubElement(own, "SourceFiles")
            for name in compiled_files(plan.code, "2.0"):
                ElementTree.SubElement(files, "File", name=name)
        return
    state = "FMUstate" if is_two else "FMUState"
    common = {"modelIdentifier": IDENTIFIER, f"canGetAndSet{state}": "true"}
    if plan.law is not None:
        ElementTree.SubElement(root, "CoSimulation", common | steps)
        return
    common |= {f"canSerialize{state}": "true"}
    derivatives = not plan.is_actuator  # the force has no limits
    if derivatives:
        names = ("providesDirectionalDerivative",)
        if not is_two:
            names = ("providesDirectionalDerivatives", "providesAdjointDerivatives")
        common |= dict.fromkeys(names, "true")
    step = {} if is_two else {"needsCompletedIntegratorStep": "true"}
    ElementTree.SubElement(root, "ModelExchange", common | step)
    if not plan.is_actuator:
        ElementTree.SubElement(root, "CoSimulation", common | steps)


def _units(root: ElementTree.Element, plan: FmuPlan) -> None:
    units = ElementTree.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(variable.unit for variable in plan.variables):
        own = ElementTree.SubElement(units, "Unit", name=unit)
        ElementTree.SubElement(own, "BaseUnit", {base: str(power) for base, power in exponents(unit).items()})
        if unit in DISPLAYED:
            name, factor, offset = DISPLAYED[unit]
            shown = {"name": name, "factor": repr(factor), **({"offset": repr(offset)} if offset else {})}
            ElementTree.SubElement(own, "DisplayUnit", shown)


def _kind(one: FmuVariable) -> dict[str, str]:
    """Return causality, variability and, for a value that follows from other variables, its initial attribute."""
    if one.causality == "parameter":
        return {"causality": "parameter", "variability": "fixed"}
    variability = "discrete" if one.is_discrete else "continuous"
    begins = {"initial": "calculated"} if one.causality in ("output", "local") else {}
    return {"causality": one.causality, "variability": variability, **begins}


def _shown(one: FmuVariable) -> dict[str, str]:
    shown = {"displayUnit": DISPLAYED[one.unit][0]} if one.unit in DISPLAYED else {}
    numbers = {"start": one.start, "nominal": one.nominal}
    return {"unit": one.unit, **shown, **{name: repr(float(own)) for name, own in numbers.items() if own is not None}}


def _variable_two(variables: ElementTree.Element, one: FmuVariable, places: dict[str, int]) -> None:
    about = {"name": one.name, "valueReference": str(places[one.name]), "description": one.meaning}
    own = ElementTree.SubElement(variables, "ScalarVariable", about | _kind(one))
    rate = {"derivative": str(places[one.rate_of] + 1)} if one.rate_of else {}
    ElementTree.SubElement(own, "Real", _shown(one) | rate)


def _variable_three(variables: ElementTree.Element, one: FmuVariable, places: dict[str, int]) -> None:
    about = {"name": one.name, "valueReference": str(places[one.name]), "description": one.meaning}
    rate = {"derivative": str(places[one.rate_of])} if one.rate_of else {}
    ElementTree.SubElement(variables, "Float64", about | _kind(one) | _shown(one) | rate)

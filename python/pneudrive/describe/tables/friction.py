"""Friction table of a drive; the laws and their parameters come from the core."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal, get_args

from pydantic import ModelWrapValidatorHandler, model_validator

from pneudrive import _core, units
from pneudrive.arrays import Keyed, NamedNumbers, Plain
from pneudrive.describe import marks
from pneudrive.describe.base import Described
from pneudrive.describe.files import sourced
from pneudrive.describe.formulas import FILE_PREFIX, FrictionLaw, law_of
from pneudrive.describe.marks import Quantity, StatedPressure, Stiffness, parameter_quantities, parameter_quantity
from pneudrive.describe.tables import dependences
from pneudrive.describe.tables.dependences import DEPENDENCES, Acting
from pneudrive.errors import DescriptionError, invalid, nearest, warn, wrong


@lru_cache(maxsize=1)
def friction_laws() -> MappingProxyType[str, Plain]:
    """Return the core's friction laws by name.

    Each law is a dict with title, source, states and parameters (key, unit, bounds, default, meaning).
    """
    return MappingProxyType({law["name"]: law for law in _core.friction_laws()})


def options_of(entry: Keyed) -> dict[str, bool]:
    """Return, for each option that only some laws have, whether this law has the option.

    `entry` is the law in the form of `friction_laws`. The options are ``stribeck_shape``, ``elements``, ``evolution``,
    and ``relaxation`` for laws with bristles.
    """
    is_built_in, keys = entry["name"] in friction_laws(), {p["key"] for p in entry["parameters"]}
    own = {"stribeck_shape": is_built_in and "stribeck_exponent" in keys, "elements": entry["elements"]}
    return own | {"evolution": entry["evolves"], "relaxation": entry["bristles"]}


def laws_with(key: str) -> list[str]:
    """Return the names of the core's laws that have a parameter or an option with this key."""
    takes = {name: {p["key"] for p in law["parameters"]} for name, law in friction_laws().items()}
    return [name for name, law in friction_laws().items() if key in takes[name] or options_of(law).get(key)]


#: Shapes of the Stribeck curve: exp(-(v/vs)^2), exp(-|v/vs|), 1/(1 + (v/vs)^2), exp(-|v/vs|^n) with the exponent n.
StribeckShape = Literal["gaussian", "exponential", "lorentzian", "free"]


#: Evolution of the state in rate-and-state friction: with time and slip, or only with slip.
Evolution = Literal["ageing", "slip"]

#: largest number of elements of law gms
MOST_ELEMENTS = 10
#: tolerance of the sum of the elements' fractions: rounding to four digits
SHARES_WITHIN = 1e-3

#: Options of a law, in addition to its parameters and modifiers.
CHOICES = ("stribeck_shape", "evolution", "elements")


class SlipElement(Acting):
    """Spring-slider element of law ``gms``: stiffness, and fraction of the friction force."""

    table_name: ClassVar[str] = "friction.elements"
    stiffness_n_m: Stiffness
    share: Annotated[float, Quantity("", bounds=marks.Bounds(above=0.0, at_most=1.0))]


#: Law of a friction table without a law: presliding, breakaway and stick-slip without drift.
DEFAULT_LAW = "elasto-plastic"
#: Assumed for a table without a law: breakaway displacement 0.1 mm, and bristle damping of 1 ms times the stiffness.
#: The damping fades at half of the velocity up to which the law is proven passive.
_BREAKAWAY_DISPLACEMENT_M = 1e-4
_DAMPING_TIME_S = 1e-3
_STRIBECK_VELOCITY_M_S = 0.02
_PASSIVE_SHARE = 0.5


#: Assumed parameter of a table without a law -> keys of its sources, and function of their values.
_FOLLOWS: dict[str, tuple[tuple[str, ...], Callable[..., float]]] = {
    "bristle_stiffness": (("breakaway",), lambda breakaway: breakaway / _BREAKAWAY_DISPLACEMENT_M),
    "bristle_damping": (("bristle_stiffness",), lambda stiffness: stiffness * _DAMPING_TIME_S),
    # sigma1 vd/sqrt(2 e) <= 4 Fc: docs/theory/friction.md
    "damping_fade_velocity": (
        ("coulomb", "bristle_damping"),
        lambda coulomb, damping: _PASSIVE_SHARE * 4.0 * coulomb * math.sqrt(2.0 * math.e) / damping,
    ),
}


#: Digits of an assumed value.
ASSUMED_DIGITS = 2


def _as_assumed(value: float) -> float:
    return float(f"{value:.{ASSUMED_DIGITS}g}")


def _following(known: NamedNumbers) -> NamedNumbers:
    """Return the parameters of `_FOLLOWS`. Those that are not in `known` are derived from other parameters."""
    out = dict(known)
    for key, (sources, value) in _FOLLOWS.items():
        if key not in out and all(out[source] > 0.0 for source in sources):
            out[key] = value(*(out[source] for source in sources))
    return {key: out[key] for key in _FOLLOWS if key in out}


def assumed_from(friction: Friction) -> dict[str, tuple[tuple[str, ...], Callable[..., float]]]:
    """Return the parameters that have their assumed values, each with the keys of its sources and its formula.

    A parameter counts as assumed if its value agrees with this formula, even if the file states the value.
    """
    if friction.law != DEFAULT_LAW:
        return {}
    out, exact = {}, dict(friction.parameters)  # exact: without rounding
    for key, (sources, value) in _FOLLOWS.items():
        if key in exact and all(exact[source] > 0.0 for source in sources):
            would = value(*(exact[source] for source in sources))
            if exact[key] == _as_assumed(would) or math.isclose(exact[key], would):
                out[key], exact[key] = (sources, value), would
    return out


def assumed_with(friction: Friction, changed: NamedNumbers) -> NamedNumbers:
    """Return the new values of assumed parameters after a change of other parameters."""
    rules = assumed_from(friction)
    if not rules:  # includes laws with other parameters
        return {}
    given = {key: value for key, value in friction.parameters.items() if key not in rules} | dict(changed)
    return {key: _as_assumed(value) for key, value in _following(given).items() if key in rules and key not in changed}


def by_default(data: Plain) -> tuple[Plain, Plain]:
    """Add `DEFAULT_LAW` and assumed parameters to a friction table that names no law.

    Parameters
    ----------
    data : dict
        Table as users write it, with at least `coulomb` and `breakaway`.

    Returns
    -------
    tuple of dict
        The table with the keys law, stribeck_velocity, viscous, bristle_stiffness, bristle_damping and
        damping_fade_velocity, and a table of the assumed entries only.

    Warns
    -----
    PneudriveWarning
        Lists the assumed values.
    """
    quantities = parameter_quantities(friction_laws()[DEFAULT_LAW])
    law: Plain = {"law": DEFAULT_LAW}
    out = law | data
    stated = filter(data.__contains__, _FOLLOWS)
    try:
        known = {key: quantities[key].read(data[key]) for key in ("coulomb", "breakaway", *stated)}
    except (KeyError, DescriptionError):  # missing keys and wrong values are reported as for any law
        return out, law
    assumed = {"stribeck_velocity": _STRIBECK_VELOCITY_M_S, "viscous": 0.0} | _following(known)
    rounded = {key: _as_assumed(value) for key, value in assumed.items() if key not in data}
    shown = {key: quantities[key].show(value) for key, value in rounded.items()}
    listed = ", ".join(f'{key} = "{value}"' for key, value in shown.items())
    with_these = f" with assumed values: {listed}. Replace important ones by measured values" if listed else ""
    warn(f'the friction table names no law, so law = "{DEFAULT_LAW}" is used{with_these}.')
    return out | shown, law | shown


class Friction(Described):
    """Friction law with its parameters and modifiers.

    Each parameter is an argument, ``Friction(law="stribeck", coulomb="30 N", ...)``, and an attribute:
    ``friction.coulomb`` shows ``30 N``. `parameters` holds their plain SI values, including defaults of the law. `law`
    is a law of the core, a `FrictionLaw`, or ``file:my_law.toml``. For a custom law, `formula` is the `FrictionLaw`. If
    the table names no law, it gets `DEFAULT_LAW`. Missing parameters other than Coulomb and breakaway force are then
    assumed. A `PneudriveWarning` states them, and `assumed` lists them.
    """

    table_name: ClassVar[str] = "friction"
    law: str
    formula: FrictionLaw | None = None
    values: tuple[tuple[str, float], ...] = ()
    given: frozenset[str] = frozenset()
    stribeck_shape: StribeckShape | None = None
    elements: tuple[SlipElement, ...] = ()
    evolution: Evolution | None = None
    pressure: dependences.SealPressure | None = None
    dwell: dependences.Dwell | None = None
    relaxation: dependences.Relaxation | None = None
    position: dependences.PositionDependence | None = None
    direction: dependences.DirectionDependence | None = None
    side_load: dependences.SideLoad | None = None
    temperature: dependences.TemperatureDependence | None = None
    wear: dependences.Wear | None = None

    @property
    def parameters(self) -> Mapping[str, float]:
        """Parameters of the law in SI by key, including defaults."""
        return MappingProxyType(dict(self.values))

    @model_validator(mode="wrap")
    @classmethod
    def _by_law(cls, data: Any, handler: ModelWrapValidatorHandler[Friction]) -> Friction:  # noqa: ANN401
        if not isinstance(data, dict):
            return handler(data)
        laws, assumed = friction_laws(), Plain()
        optional = ("law", *CHOICES, *DEPENDENCES)
        data = {key: value for key, value in data.items() if value is not None or key not in optional}
        if "law" not in data:
            data, assumed = by_default(data)
        name, own = data["law"], None
        if isinstance(name, str) and name in laws:
            entry = laws[name]
        elif (own := law_of(name)) is not None:
            name, entry = own.name, own.entry
        else:
            remedy = f'{nearest(str(name), laws)} For a custom law, write "{FILE_PREFIX}NAME.toml".'
            raise wrong("friction.law", f'friction.law = "{name}" is not known', remedy=remedy)
        parameters = {p["key"]: p for p in entry["parameters"]}
        takes = options_of(entry)
        options = [key for key in (*CHOICES, *DEPENDENCES) if takes.get(key, True)]
        values: NamedNumbers = {}
        for key in (key for key in data if key not in ("law", *options)):
            full = f"friction.{key}"
            if key not in parameters:
                owners = laws_with(key)
                known = f"Laws with this key: {', '.join(owners)}."
                remedy = known if owners else nearest(key, ["law", *parameters, *options])
                raise wrong(full, f'{full} is not a known key of law "{name}"', remedy=remedy)
            values[key] = parameter_quantity(parameters[key]).read_at(full, data[key])
        given = frozenset(values)
        for key, parameter in parameters.items():
            default = parameter["default"]
            if key in values or (default is not None and math.isinf(default)):
                continue  # an infinite default means that the effect is absent, and so is the value
            if default is None:
                remedy = ": ".join(filter(None, (parameter["meaning"], parameter_quantity(parameter).rule)))
                remedy = f"{remedy[0].upper()}{remedy[1:]}."
                raise wrong(f"friction.{key}", f'friction.{key} is missing; law "{name}" needs it', remedy=remedy)
            values[key] = default
        out = {"law": name, "formula": own, "values": tuple(values.items()), "given": given}
        friction = handler(out | {key: data[key] for key in options if key in data})
        if assumed:
            vars(friction)["assumed"] = tuple((key, str(value)) for key, value in assumed.items())
        return friction

    @cached_property
    def assumed(self) -> tuple[tuple[str, str], ...]:
        """Assumed entries of a table without a law, as (key, value). Comparisons ignore them."""
        return ()

    @property
    def origins(self) -> dict[str, sourced.Value]:
        """Origins of the assumed entries, by key in the drive file."""
        assumed = ((f"friction.{key}", value) for key, value in self.assumed)
        return {key: sourced.Value(key, value, None, "no law was named") for key, value in assumed}

    @property
    def note(self) -> str:
        """Warning that the table names no law; the caller puts the table's name before it. Empty if a law is named."""
        listed = ", ".join(f"{key} = {value}" for key, value in self.assumed)
        return f"names no law; assumed: {listed}" if listed else ""

    @model_validator(mode="after")
    def _fits_the_law(self) -> Friction:
        coulomb, breakaway = self.parameters.get("coulomb"), self.parameters.get("breakaway")
        if coulomb is not None and breakaway is not None and breakaway < coulomb:
            lower, upper = units.write(breakaway, "N", "N"), units.write(coulomb, "N", "N")
            raise invalid("friction.breakaway", "describe.breakaway-below-coulomb", lower=lower, upper=upper)
        if self.stribeck_shape not in (None, "free") and "stribeck_exponent" in self.given:
            raise invalid("friction.stribeck_exponent", "describe.idle-exponent", shape=self.stribeck_shape)
        key, stiffness = "friction.elements", "friction.bristle_stiffness"
        total = sum(element.share for element in self.elements)
        if not self.elements:
            if self.entry["elements"] and "bristle_stiffness" not in self.parameters:
                raise invalid(stiffness, "describe.no-stiffness", law=self.law, needed=units.needed("N/m"))
        elif "bristle_stiffness" in self.given:
            raise wrong(stiffness, f"{stiffness} already follows from {key}", remedy="Keep one of the two.")
        elif not 2 <= len(self.elements) <= MOST_ELEMENTS:
            raise wrong(key, f"{key} has {len(self.elements)} entries", rule=f"2 to {MOST_ELEMENTS}")
        elif abs(total - 1.0) > SHARES_WITHIN:
            raise wrong(key, f"the shares in {key} add up to {total:g}", rule="the sum of the shares must be 1")
        return self

    def __getattr__(self, name: str) -> units.UnitFloat | float:
        """Return a parameter of the law by its key, as a quantity that shows its unit."""
        parameters = dict(self.__dict__.get("values", ()))
        if name in parameters:
            return parameter_quantities(self.entry)[name].named(parameters[name])
        if name.startswith("_") or not parameters:
            raise AttributeError(name)
        msg = f'friction law "{self.law}" has no parameter "{name}". {nearest(name, [*parameters, *DEPENDENCES])}'
        raise AttributeError(msg)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self.parameters]

    @property
    def entry(self) -> Plain:
        """Entry of the law in the form of `friction_laws`, also for a custom law: title, source, states, parameters."""
        return friction_laws()[self.law] if self.formula is None else self.formula.entry

    def _given(self, keys: Iterable[str]) -> Plain:
        """Return the choices or modifiers in `keys` that the table gives, by key."""
        return {key: value for key in keys if (value := getattr(self, key)) not in (None, ())}

    def core(self) -> Plain:
        """Return the table in the core's form, in SI: law, parameters, pressure and other modifiers."""
        tables = {key: value.core() for key, value in self._given(DEPENDENCES).items()}
        law = {"law": self.law, "parameters": dict(self.parameters), "pressure": None}
        formula = {} if self.formula is None else {"formula": self.formula.core()}
        elements = {"elements": [element.core() for element in self.elements]} if self.elements else {}
        return law | formula | self._given(CHOICES[:2]) | elements | tables

    def to_dict(self) -> Plain:
        """Return the table in the form that users write."""
        out = super().to_dict()
        return out if self.formula is None else out | {"law": self.formula.to_dict()}

    def entries(self, *, given: bool = False) -> Iterator[tuple[str, Any, Quantity | StatedPressure | None]]:
        """Yield key, value and annotation of the law, then of its choices, parameters and modifiers."""
        yield "law", self.law, None
        yield from ((key, value, None) for key, value in self._given(CHOICES).items())
        shown = self.given if given else self.parameters
        marks = parameter_quantities(self.entry)
        yield from ((key, self.parameters[key], mark) for key, mark in marks.items() if key in shown)
        yield from ((key, value, None) for key, value in self._given(DEPENDENCES).items())

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> Plain:  # noqa: ANN401 - pydantic's own
        """Return the JSON schema: one alternative for each law of the core."""
        tables = {key: about.model_json_schema(by_alias=True) for key, about in DEPENDENCES.items()}
        element = SlipElement.model_json_schema(by_alias=True)
        options = tables | {
            "stribeck_shape": {"enum": list(get_args(StribeckShape))},
            "evolution": {"enum": list(get_args(Evolution))},
            "elements": {"type": "array", "items": element, "minItems": 2, "maxItems": MOST_ELEMENTS},
        }
        alternatives = []
        for name, law in friction_laws().items():
            takes = options_of(law)
            properties: Plain = {"law": {"const": name}}
            properties |= {key: form for key, form in options.items() if takes.get(key, True)}
            for p in law["parameters"]:
                properties[p["key"]] = parameter_quantity(p).schema() | {"title": p["meaning"]}
            required = ["law", *(p["key"] for p in law["parameters"] if p["default"] is None)]
            alternatives.append({"type": "object", "title": law["title"], **marks.table_schema(properties, required)})
        (usual,) = (one for one in alternatives if one["properties"]["law"]["const"] == DEFAULT_LAW)
        keys = {key: value for key, value in usual["properties"].items() if key != "law"}
        title = f'Without law: "{DEFAULT_LAW}" with assumed values for missing keys'
        default = usual | {"title": title, "properties": keys, "required": ["coulomb", "breakaway"]}
        # Only the file of a custom law lists its parameters.
        law = {"anyOf": [{"type": "string", "pattern": f"^{FILE_PREFIX}"}, {"type": "object", "required": ["name"]}]}
        properties = {"law": law, **tables}
        own = {"type": "object", "title": "A custom law, as formulas", "properties": properties, "required": ["law"]}
        return {"oneOf": [*alternatives, default, own]}

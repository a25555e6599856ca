"""Components of circuits as the core lists them, and the tables in which users describe them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal, cast

from pydantic import BeforeValidator, ConfigDict, Field, create_model, model_validator

from pneudrive.arrays import Interval, Keyed, NamedNumbers, Plain
from pneudrive.describe import marks
from pneudrive.describe.base import Described, inline
from pneudrive.describe.files import sourced
from pneudrive.describe.formulas import ComponentFormula, formula_of, law_of
from pneudrive.describe.kinds import COMMAND, FLOW, RATIO, STATED, acts, component_kinds, flow_keys, is_bare, is_needed
from pneudrive.describe.marks import Positions, Quantity, Signal, StatedPressure, parameter_quantity
from pneudrive.describe.tables import valve_flow
from pneudrive.describe.tables.dependences import DEPENDENCES
from pneudrive.describe.tables.friction import Friction, friction_laws
from pneudrive.errors import DescriptionError, invalid, nearest, package_table, within, wrong
from pneudrive.units import Pressure, UnitFloat, column_name

#: Key of a size -> lowest and highest usual value, SI (assumed).
USUAL = {"bore": (2e-3, 0.4), "stroke": (1e-3, 12.0), "moving_mass": (1e-3, 1e4), "conductance": (1e-12, 1e-6)}


class Component(Described):
    """Component of a circuit.

    The class is generated from the core's entry of the kind. A number is stored in SI under a name with its unit. The
    key without the unit returns the number as a quantity with a unit.
    """

    model_config = ConfigDict(alias_generator=None)
    entry: ClassVar[Mapping[str, Any]] = MappingProxyType({})
    fields: ClassVar[Mapping[str, str]] = MappingProxyType({})  # key of a number -> name of its field
    renamed: ClassVar[Mapping[str, str]] = MappingProxyType({})  # key in older files -> key
    kind: str
    at: Annotated[tuple[float, float] | None, marks.ON_PAPER] = Field(
        default=None, description="Place in a drawing, [x, y] in modules"
    )

    @model_validator(mode="wrap")
    @classmethod
    def _with_origins(cls, data: Any, handler: Any) -> Any:  # noqa: ANN401
        """Validate the values, and keep their origins."""
        if not isinstance(data, dict):
            return handler(data)
        plain, origins = sourced.parted(cls.flat(data))
        parameters, ratio = cls.entry["parameters"], valve_flow.USUAL_RATIO
        if RATIO not in plain and any(p["key"] == RATIO and is_needed(p) for p in parameters):
            sizes = {key for p in parameters for key in flow_keys(cls.entry, p["key"])[1:]}
            if not sizes.isdisjoint(plain):  # a flow or a flow coefficient
                plain[RATIO] = ratio
                origins |= {RATIO: sourced.Value(RATIO, ratio, None, valve_flow.USUAL_RATIO_SAID)}
        made = handler(plain)
        vars(made)["origins"] = origins | getattr(getattr(made, "friction", None), "origins", {})
        return made

    @cached_property
    def origins(self) -> Mapping[str, sourced.Value]:
        """Values with their origin. Comparisons of components ignore origins."""
        return {}

    @classmethod
    def flat(cls, table: Keyed) -> Plain:
        """Convert ``end_stop = { stiffness = ... }`` to ``end_stop_stiffness = ...``. Values retain their origins."""
        out: Plain = {}
        for written, given in table.items():
            key = cls.renamed.get(written, written)
            origin = given if sourced.has_origin(given) else None
            value = given if origin is None else origin["value"]
            inner = isinstance(value, dict) and key not in cls.keys()  # noqa: SIM118 - a class method
            if inner and any(name.startswith(f"{key}_") for name in cls.fields):
                each = value if origin is None else {sub: origin | {"value": one} for sub, one in value.items()}
                found = {f"{key}_{sub}": one for sub, one in each.items()}
            else:
                found = {key: given}
            for twice in filter(out.__contains__, found):
                rule = "each number once: as a key, in an inner table, or under its older name"
                raise wrong(twice, f"{twice} is given twice", rule=rule, remedy="Keep one of them.")
            out |= found
        return out if out.keys() == table.keys() else cls.flat(out)  # cushion = { b = { length = ... } }

    @classmethod
    def over(cls, base: Keyed, own: Keyed) -> Plain:
        """Replace values of a catalogue part by the user's values; see `merge`."""
        return merge(cls.flat(base), cls.flat(own))

    @model_validator(mode="after")
    def _complete(self) -> Component:
        numbers = {k: getattr(self, field) for k, field in self.fields.items() if field in self.model_fields_set}
        beside = self._choices() | self._points()
        for parameter in self.entry["parameters"]:
            key, table = parameter["key"], parameter["within"]
            keys = flow_keys(self.entry, key)
            given = [numbers.get(key) for key in keys]
            needed, is_given = is_needed(parameter, numbers | beside), any(one is not None for one in given)
            if len(keys) > 1 and (needed or is_given):
                valve_flow.size_given(given, keys, "")
            elif needed and not is_given:
                raise wrong(key, f"{key} is missing", rule=f"{key} is {_unless(parameter)}")
            elif table and is_bare(parameter) and self._has(parameter) and not is_given:
                raise wrong(key, f"{key} is missing", rule=f"give all keys of {table}, or none")
        return self

    def _has(self, parameter: Keyed) -> bool:
        """Return whether the inner table of a parameter is given; True for a parameter outside an inner table."""
        table = parameter["within"]
        own = (p["key"] for p in self.entry["parameters"] if p["within"] == table)
        return not table or any(self.fields[key] in self.model_fields_set for key in own)

    def _choices(self) -> dict[str, str]:
        return {choice["name"]: getattr(self, choice["name"]) for choice in self.entry["choices"]}

    def _points(self) -> Plain:
        key = self.entry["points"]["key"] if self.entry["points"] else None
        return {} if key is None else {key: getattr(self, key)}

    def _acting(self) -> Iterator[tuple[Keyed, bool]]:
        """Yield each parameter of the given tables, and whether it has an effect."""
        beside = {key: getattr(self, field) for key, field in self.fields.items()} | self._choices()
        for parameter in filter(self._has, self.entry["parameters"]):
            yield parameter, acts(parameter, beside)

    def numbers(self, ambient_pa: float) -> NamedNumbers:
        """Return the parameters that have a value, by key, in SI with absolute pressures."""
        out = {}
        for parameter, has_effect in self._acting():
            if not has_effect and parameter["only"].startswith("no "):
                continue
            key = parameter["key"]
            value, *sizes = (getattr(self, self.fields[size]) for size in flow_keys(self.entry, key))
            if any(sizes):
                shape = (getattr(self, self.fields[name]) for name in FLOW)
                value = valve_flow.conductance_of([None, *sizes], *shape)
            if isinstance(value, Pressure):
                value = marks.absolute_above_vacuum(value, ambient_pa, key)
            if value is not None:
                out[key] = value
        return out

    def pressures(self) -> list[Pressure]:
        """Return the pressures, absolute or gauge as stated."""
        return [value for field in self.fields.values() if isinstance(value := getattr(self, field), Pressure)]

    def core(self, ambient_pa: float) -> Plain:
        """Return the component in the core's form, in SI."""
        friction = getattr(self, "friction", None)
        formula = getattr(self, "formula", None)
        points = next(iter(self._points().values()), None)
        return {
            "kind": self.kind,
            "numbers": self.numbers(ambient_pa),
            "choices": self._choices(),
            "friction": None if friction is None else friction.core(),
            **({} if formula is None else {"formula": formula.core()}),
            **({} if points is None else {"points": points}),
        }

    @property
    def command_input(self) -> Signal | Positions | None:
        """Commands of a switching component, or the electrical input of any other component (None if not given)."""
        if self.kind in SWITCHED and _PULSES not in self.plain():
            return Positions(tuple(SWITCHED[self.kind]), getattr(self, COMMAND))
        return getattr(self, COMMAND)

    def to_dict(self) -> Plain:
        """Return the table, with the origin of each value if it is known."""
        return sourced.put_back(self.plain(), self.origins)

    def plain(self) -> Plain:
        """Return the table with its values only."""
        return super().to_dict()

    @property
    def has_heat_law(self) -> bool:
        """Whether the heat transfer follows from a law, because no coefficient is stated."""
        return "heat_transfer" in self.fields and getattr(self, self.fields["heat_transfer"]) is None

    def assumed(self) -> Iterator[str]:
        """Yield the assumed values, which have no source, as ``key = value``."""
        for key, value in self.origins.items():
            if value.assumed is not None:
                yield f"{key} = {inline(value.value)}, {value.assumed}"
        for parameter in (parameter for parameter, has_effect in self._acting() if has_effect):
            field = self.fields[parameter["key"]]
            if parameter["assumed"] and field not in self.model_fields_set:
                yield f"{parameter['key']} = {self.default(field)}, {parameter['assumed']}"
            if parameter["follows"] and field not in self.model_fields_set:
                yield f"{parameter['key']} follows {parameter['follows']}"

    @property
    def idle(self) -> Iterator[str]:
        """Given keys without an effect, each with the reason."""
        for parameter, has_effect in self._acting():
            if not has_effect and self.fields[parameter["key"]] in self.model_fields_set:
                key, _, option = parameter["only"].partition(" = ")
                needed = f"without {f'{key} = {option!r}' if option else key}"
                yield f"{parameter['key']} has no effect {needed.replace('without no', 'with')}"

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the component as its table, because its class is generated again on loading."""
        return component, (self.to_dict(),)


def merge(base: Keyed, changes: Keyed, optional: str = "") -> Plain:
    """Merge changes into a description, table by table. Values retain their origins.

    A new flow size replaces the old size of the same flow path, even under another key, such as `kv`. A new friction
    law removes the parameters of the old law. The kind `rodless` removes the rod diameter. Sizes with and without the
    prefix `optional` belong to the same flow path.
    """
    out = valve_flow.without_other_sizes(base, changes, optional)
    old, new = (sourced.plain(table.get("law")) for table in (base, changes))
    if "law" in changes and new != old and (old is not None or optional):
        own = None if new is None else law_of(new)
        entry = own.entry if own else friction_laws().get(new) if isinstance(new, str) else None
        stays = DEPENDENCES.keys() - ({"relaxation"} if entry and not entry["bristles"] else ())
        out = {key: value for key, value in out.items() if key in stays}
    if changes.get("kind") == "rodless":
        out.pop("rod_diameter", None)
    for key, value in changes.items():
        before = out.get(key)
        if sourced.is_inner(before) and sourced.is_inner(value):
            out[key] = merge(before, value, optional)
        else:
            out[key] = value
    return out


def unusual_sizes(description: Described, usual: Mapping[str, Interval]) -> Iterator[tuple[str, UnitFloat, float, str]]:
    """Yield each size outside its usual range: key, size, the end of the range that it exceeds (SI), and the rule."""
    for key, (low, high) in usual.items():
        size = getattr(description, key, None)
        if size is not None and not low <= size <= high:
            least, most = (UnitFloat(end, size.si_unit, size.unit) for end in (low, high))
            yield key, size, low if size < low else high, f"check the unit: usual sizes are {least} to {most} (assumed)"


def unusual(name: str, description: Described) -> list[str]:
    """Return each size of a table outside its usual range, with the name of the table and the range."""
    return [f"{name}.{key} = {size}; {rule}" for key, size, _, rule in unusual_sizes(description, USUAL)]


def component(table: Keyed) -> Component:
    """Read the table of a component.

    Raises
    ------
    DescriptionError
        The kind is unknown, or the table is not valid.

    Examples
    --------
    >>> component({"kind": "tank", "volume": "5 l"}).volume
    5000 cm3
    """
    kinds = component_kinds()
    if "kind" not in table:
        raise wrong("kind", "kind is missing", remedy=f"Known: {', '.join(kinds)}.")
    kind = table["kind"]
    if not isinstance(kind, str) or kind not in kinds:
        raise wrong("kind", f"kind = {kind!r} is not known", remedy=nearest(str(kind), kinds))
    if kinds[kind]["formula"]:
        formula = formula_of(table.get("formula"), entry=kinds[kind])
        taken = next((key for key in formula.parameters if hasattr(Component, key)), None)
        if taken:
            raise invalid(f"formula.parameters.{taken}", "describe.name-in-use", taken=taken, name=formula.name)
        return cast("Component", component_class(kind, formula).model_validate({**table, "formula": formula}))
    return cast("Component", component_class(kind).model_validate(dict(table)))


@contextmanager
def within_component(name: str, table: Keyed, above: str = "components.") -> Iterator[None]:
    """Give the errors of a component's table their full keys in the file. Errors in another file stay unchanged."""
    try:
        yield
    except DescriptionError as error:
        raise error if error.where else within(error, name, above, lambda key: _nested(key, table)) from None


def _nested(key: str, table: Keyed) -> str:
    """Return the key as the user wrote it: nested in inner tables, or under its older name."""
    kind = table.get("kind")
    before = component_class(kind).renamed if isinstance(kind, str) and kind in component_kinds() else {}
    key = next((old for old, new in before.items() if new == key and old in table), key)
    if key not in table:
        for inner, value in table.items():
            if isinstance(value, dict) and key.startswith(f"{inner}_"):
                return f"{inner}.{_nested(key.removeprefix(f'{inner}_'), value)}"
    return key


def rows(entry: Keyed) -> list[tuple[str, str, str, str]]:
    """Return the keys of a kind of component as rows of text: key, unit or form, default with its origin, meaning."""
    kind = component_class(entry["kind"])
    out = []
    for parameter in entry["parameters"]:
        key, rule = parameter["key"], parameter["rule"]
        keys = flow_keys(entry, key)
        mark = _mark(parameter)
        unit = (mark.written or "") if isinstance(mark, Quantity) else "bar abs, bar gauge"
        if isinstance(mark, Quantity) and mark.si_unit:
            for limit in filter(None, vars(mark.bounds).values()):
                rule = rule.replace(f"{limit:.17g}", f"{UnitFloat(limit, mark.si_unit, mark.written):g}")
        takes = ", ".join(filter(None, (unit, "" if rule == "finite" else rule)))
        follows = parameter["follows"] and f"follows {parameter['follows']}"
        needed = f"needed in {parameter['within']}" if parameter["within"] else _unless(parameter) or "needed"
        default = follows or (needed if is_bare(parameter) else str(kind.default(kind.fields[key])))
        assumed = f" (assumed: {parameter['assumed']})" if parameter["assumed"] else ""
        only, was = parameter["only"], parameter["was"]
        meaning = parameter["meaning"] + (f"; acts only with {only}".replace("with no", "without") if only else "")
        out.append((key, takes, default + assumed, meaning + (f"; in older files `{was}`" if was else "")))
        out += [(other, _size(other).written or "", "", f"Alternative to {key}") for other in keys[1:]]
    for choice in entry["choices"]:
        out.append((choice["name"], " | ".join(choice["options"]), choice["options"][0], choice["meaning"]))
    if entry["formula"]:
        meaning = f"Formula of {entry['formula']['output']}; its parameters are further keys of the component"
        out.append(("formula", '"file:NAME.toml" or a table', "needed", meaning))
    if entry["points"]:
        columns = entry["points"]["columns"]
        point = ", ".join(f"{column['key']} = ..." for column in columns)
        each = ((column, parameter_quantity(column).written) for column in columns)
        meaning = "; ".join(f"{column['meaning']}{f', {unit}' if unit else ''}" for column, unit in each)
        meaning += f": 2 to {entry['points']['most']} points, {columns[0]['key']} rising"
        needed = "" if entry["points"]["optional"] else "needed"
        out.append((entry["points"]["key"], f"[{{ {point} }}, ...]", needed, meaning))
    if entry["friction"]:
        needed = "needed" if entry["friction"] == "needed" else "none"
        out.append(("friction", "a table", needed, "As [friction] of a drive file"))
    if COMMAND in kind.keys():  # noqa: SIM118 - a class method
        out.append((COMMAND, "V or mA", "", 'Range of the electrical input, "0 V .. 10 V"'))
    return out


def _unless(parameter: Keyed) -> str:
    """Return the condition of a required parameter, "needed unless ..."; empty without a condition."""
    unless = parameter["unless"]
    return unless and f"needed unless {unless}{'' if ' = ' in unless else ' is given'}"


def _mark(parameter: Keyed) -> Quantity | StatedPressure:
    """Return the annotation of a parameter."""
    if parameter["unit"] == STATED:
        return StatedPressure()
    mark = parameter_quantity(parameter)
    return mark if mark.si_unit else marks.PureNumber("", bounds=mark.bounds)


def _size(key: str) -> Quantity:
    return next(mark for size, mark in marks.SIZES.items() if key.endswith(size))


@lru_cache(maxsize=512)
def component_class(kind: str, formula: ComponentFormula | None = None) -> type[Component]:
    """Return the class of a kind of component. The parameters of a formula become additional fields."""
    entry = component_kinds()[kind] if formula is None else formula.entry
    points = entry["points"]
    fields: Plain = {"kind": (Literal[kind], ...)}  # type: ignore[valid-type]
    names: dict[str, str] = {}
    for parameter in entry["parameters"]:
        key, mark, default = parameter["key"], _mark(parameter), parameter["default"]
        sizes = flow_keys(entry, key)[1:]
        if default is not None and isinstance(mark, StatedPressure):
            default = Pressure(default, gauge=False)
        if is_needed(parameter) and not sizes:
            default = ...
        others = ((size, _size(size), None, f"Alternative to {key}") for size in sizes)
        for name, form, usual, meaning in ((key, mark, default, parameter["meaning"]), *others):
            number = float if isinstance(form, Quantity) else Pressure
            names[name] = column_name(name, getattr(form, "si_unit", ""))
            about = Field(default=usual, alias=name, description=meaning)
            fields[names[name]] = (Annotated[number if usual is ... else number | None, form], about)
    for choice in entry["choices"]:
        options = Literal[tuple(choice["options"])]  # type: ignore[valid-type]
        if set(choice["options"]) == {"yes", "no"}:
            options = Annotated[options, _TRUE_OR_FALSE]
        fields[choice["name"]] = (options, Field(default=choice["options"][0], description=choice["meaning"]))
    if entry["friction"]:
        fields["friction"] = (Friction | None, None)
    if entry["formula"]:
        fields["formula"] = (ComponentFormula, ...)
    if points:
        columns = tuple((column["key"], parameter_quantity(column), column["default"]) for column in points["columns"])
        mark = marks.PointRows("", columns=columns, most=points["most"])
        rows_of = tuple[tuple[float, ...], ...]
        form, usual = (rows_of | None, None) if points["optional"] else (rows_of, ...)
        about = Field(default=usual, description=f"Points over the {columns[0][0]}")
        fields[points["key"]] = (Annotated[form, mark], about)
    if any(one["name"] == COMMAND for one in entry["inputs"]):
        meaning = "Range of the electrical input, for commands in V or mA"
        fields[COMMAND] = (Annotated[Signal | None, marks.SIGNAL_RANGE], Field(default=None, description=meaning))
    name = re.sub(r"\W+", " ", kind).title().replace(" ", "")
    made = create_model(name, __base__=Component, __doc__=entry["doc"], __module__=__name__, **fields)
    made.entry, made.fields = MappingProxyType(entry), MappingProxyType(names)
    old = (
        zip(flow_keys(entry, p["was"]), flow_keys(entry, p["key"]), strict=True)
        for p in entry["parameters"]
        if p["was"]
    )
    made.renamed = MappingProxyType({before: key for pairs in old for before, key in pairs})
    made.elsewhere = dict.fromkeys(_SPOOL if kind in SWITCHED else (), _SWITCHES)
    return made


#: Conversion of the TOML values true and false to yes and no.
_TRUE_OR_FALSE = BeforeValidator(lambda given: ("no", "yes")[given] if isinstance(given, bool) else given)
#: Kind of switching component -> its commands. Some kinds also accept pulses: their command can be any fraction.
SWITCHED: dict[str, list[float]] = package_table(__file__, "switched.toml")
_PULSES = "pwm_frequency"
#: Keys of a spool.
_SPOOL = ("frequency", "damping_ratio", "stroke_time", "delay", "hysteresis", "overlap", "leakage")
_SWITCHES = 'A switching valve has time_on and time_off. For a spool, write kind = "valve/proportional-5/3".'

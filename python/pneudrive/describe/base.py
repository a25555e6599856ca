"""Base class of all tables of a description, with typed quantities and one message for each error."""

from __future__ import annotations

import re
from difflib import get_close_matches
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from pneudrive import units
from pneudrive.describe.files import toml
from pneudrive.describe.marks import Mark, Quantity, StatedPressure
from pneudrive.errors import DescriptionError, nearest, together, wrong
from pneudrive.repr_tables import Card, Shown

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    from pydantic.fields import FieldInfo
    from typing_extensions import Self

    from pneudrive.arrays import Plain


_SUFFIXES = {units.suffix(unit) for unit in units.KINDS} - {"a", "v"} | {"hz", "m_s3"}
_STORED_IN = sorted(_SUFFIXES, key=len, reverse=True)
_SUFFIX = re.compile(rf"_(?:{'|'.join(_STORED_IN)})$")


def key_of(name: str) -> str:
    """Return the key of a field in files: its name without the suffix of its unit.

    Examples
    --------
    >>> key_of("heat_transfer_w_m2_k"), key_of("pressure_a")
    ('heat_transfer', 'pressure_a')
    """
    return _SUFFIX.sub("", name)


_NO_TABLE, _NO_LIST = " is not a table", " is not a list"
#: pydantic's type error -> description of the problem.
_TYPES = {
    "string_type": " must be a text in quotes",
    "bool_type": " must be true or false",
    "int_type": " must be a whole number",
    "tuple_type": _NO_LIST,
    "list_type": _NO_LIST,
    "model_type": _NO_TABLE,
    "model_attributes_type": _NO_TABLE,
    "dict_type": _NO_TABLE,
}


class Described(Shown, BaseModel):
    """Base class of all description tables. Tables are frozen, reject unknown keys and give one message for each error.

    A field is stored in SI under a name with its unit (``bore_m``). The attribute with the key of the file
    (``bore``) returns the same value as a quantity with a unit.
    """

    #: pydantic builds the validator of a table when the table is first used: a description uses few kinds of tables.
    model_config = ConfigDict(
        frozen=True, extra="forbid", arbitrary_types_allowed=True, alias_generator=key_of, defer_build=True
    )
    table_name: ClassVar[str] = ""
    elsewhere: ClassVar[Mapping[str, str]] = {}  # key of another table -> remedy

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:  # noqa: ANN401 - pydantic's own
        """Add an attribute for each field, named as its key in files: ``bore`` for the field ``bore_m``."""
        for name, field in cls.model_fields.items():
            if field.alias and field.alias != name and not hasattr(cls, field.alias):
                setattr(cls, field.alias, _by_key(name, mark_of(field)))

    @model_validator(mode="wrap")
    @classmethod
    def _one_message(cls, data: Any, handler: Any) -> Any:  # noqa: ANN401 - input of any type is checked
        try:
            return handler(data)
        except ValidationError as error:
            raise cls.explain(error) from None

    if not TYPE_CHECKING:  # type checkers see the fields as the arguments

        def __init__(self, /, **given: object) -> None:
            """Check all values, then raise one error that lists all problems."""
            try:
                super().__init__(**given)
            except ValidationError as error:
                raise type(self).explain(error) from None

        __init__.__pydantic_base_init__ = True  # tables inside tables do not call `__init__`

        def __setattr__(self, name: str, value: object) -> None:
            """Refuse to change a value of the description."""
            is_derived = isinstance(getattr(type(self), name, None), property)
            if is_derived or name in {*type(self).keys(), *type(self).model_fields}:
                key = f"{self.table_name}.{name}" if self.table_name else name
                raise DescriptionError.of("describe.frozen", key=key, given=value)
            super().__setattr__(name, value)

        @classmethod
        def model_validate(cls, *given: object, **options: object) -> Described:
            """Check the values as `__init__` does."""
            try:
                return super().model_validate(*given, **options)
            except ValidationError as error:
                raise cls.explain(error) from None

    @classmethod
    def keys(cls) -> list[str]:
        """Return the keys in the form that users write."""
        return [field.alias or name for name, field in cls.model_fields.items()]

    @classmethod
    def marks(cls) -> dict[str, Quantity | StatedPressure]:
        """Return the annotation of each quantity and pressure, by key."""
        marked = zip(cls.keys(), map(mark_of, cls.model_fields.values()), strict=True)
        return {key: mark for key, mark in marked if isinstance(mark, Quantity | StatedPressure)}

    @classmethod
    def explain(cls, error: ValidationError) -> DescriptionError:
        """Convert pydantic's errors to one error with a message for each field.

        Unknown keys come first. A misspelt key therefore gives one message, without a second one for the missing key.
        """
        complaints = error.errors(include_url=False)
        complaints.sort(key=lambda c: c["type"] != "extra_forbidden")
        unknown = [str(c["loc"][-1]) for c in complaints if c["type"] == "extra_forbidden"]
        out: list[DescriptionError] = []
        seen: set[object] = set()
        for complaint in complaints:
            place = complaint["loc"]
            field = place[:2] if place[1:] and isinstance(place[1], int) else place[:1]  # an entry of a list
            is_misspelt = complaint["type"] == "missing" and get_close_matches(str(field[0]), unknown, cutoff=0.5)
            if field in seen or is_misspelt:
                continue
            seen.add(field)
            cause = complaint.get("ctx", {}).get("error")
            errors = cause.each() if isinstance(cause, DescriptionError) else [cls._explained(complaint)]
            out += [_placed(one, cls._key(place)) for one in errors]
        return together(out)

    @classmethod
    def _key(cls, place: Sequence[object]) -> str:
        """Return the dotted key of a location in the table."""
        return ".".join([*([cls.table_name] if cls.table_name else []), *map(str, place)])

    @classmethod
    def _explained(cls, first: Any) -> DescriptionError:  # noqa: ANN401 - pydantic's dictionary
        """Convert one of pydantic's errors to a message."""
        key = cls._key(first["loc"])
        if first["type"] == "extra_forbidden":
            name = str(first["loc"][-1])
            inner = [one.removeprefix(f"{name}_") for one in cls.keys() if one.startswith(f"{name}_")]  # noqa: SIM118 - a class method
            if len(inner) > 1 and not isinstance(first["input"], dict):
                what = f"{key} = {first['input']!r} is not a table"
                return wrong(key, what, remedy=f"Write {{ {', '.join(f'{one} = ...' for one in inner)} }}.")
            known = nearest(f"{name}_{inner[0]}" if inner else name, cls.keys())
            return wrong(key, f"{key} is not a known key", remedy=cls.elsewhere.get(name, known))
        if first["type"] == "missing":
            return wrong(key, f"{key} is missing", remedy=cls.example(str(first["loc"][-1])))
        if first["type"] == "literal_error":
            known = first.get("ctx", {})["expected"].replace(" or ", ", ").replace("'", "").split(", ")
            return wrong(key, f"{key} = {first['input']!r} is not known", remedy=nearest(str(first["input"]), known))
        words = _TYPES.get(first["type"], f": {first['msg']}")
        remedy = f"Write {key} = [...]." if words == _NO_LIST else None
        return wrong(key, f"{key} = {first['input']!r}{words}".removeprefix(" = "), remedy=remedy)

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> Plain:  # noqa: ANN401 - pydantic's own
        """Return the JSON schema, with defaults as users would write them."""
        out = handler.resolve_ref_schema(handler(schema))
        for name, field in cls.model_fields.items():
            about = out["properties"].get(field.alias or name, {})
            mark = mark_of(field)
            shown = field.default
            if mark is not None and field.default is not None and "default" in about:
                shown = about["default"] = mark.show(field.default)
            if shown is None or isinstance(shown, Described) or (mark is None and not isinstance(shown, str | int)):
                about.pop("default", None)  # a default that is a table cannot be written
        return out

    @classmethod
    def example(cls, alias: str) -> str | None:
        """Return a remedy that shows how to write a missing key."""
        field = cls._field(alias)
        mark = mark_of(field)
        if field.examples:
            return f'Add {alias} = "{field.examples[0]}".'
        if isinstance(mark, Quantity | StatedPressure):
            return f"Add {alias} = ...: {mark.rule}."
        if own := getattr(field.annotation, "model_fields", {}).values():
            keys = [f'{one.alias} = "{one.examples[0]}"' for one in own if one.is_required() and one.examples]
            return f"Add a table [{alias}]{' with ' * bool(keys)}{', '.join(keys)}."
        return f"Add {alias} = ..."

    @classmethod
    def _field(cls, key: str) -> FieldInfo:
        """Return the field that has `key` as its name, or as its key in files."""
        return next(field for name, field in cls.model_fields.items() if key in {name, field.alias})

    @classmethod
    def default(cls, key: str) -> Any:  # noqa: ANN401 - any kind of value
        """Return the default of a key in the form that users write."""
        field = cls._field(key)
        mark = mark_of(field)
        return field.default if mark is None else mark.show(field.default)

    @cached_property
    def source_file(self) -> str:
        """File from which the description was read, before values were changed; empty if unknown."""
        return ""

    def read_from(self, file: str | Path) -> Self:
        """Store the file from which the description was read, and return the description."""
        vars(self)["source_file"] = str(file)
        return self

    def stored(self) -> Plain:
        """Return the fields that are not None, by name: values in SI, tables unchanged."""
        return {name: value for name in type(self).model_fields if (value := getattr(self, name)) is not None}

    def to_dict(self) -> Plain:
        """Return the given values of the table in the form that users write. Defaults are left out."""
        return {key: as_tables(value, mark) for key, value, mark in self.entries(given=True)}

    def with_defaults(self) -> Plain:
        """Return the table in the form of `to_dict`, including the defaults."""
        return {key: as_tables(value, mark, defaults=True) for key, value, mark in self.entries()}

    def _card(self) -> Card:
        """Return a card with the value of every key; defaults are marked."""
        given = self.to_dict()
        each = self.with_defaults() | given
        rows = [(key, inline(each[key]), "" if key in given else "default") for key, _, _ in self.entries()]
        title = f"[{self.table_name}]" if self.table_name else type(self).__name__
        return Card(title, rows=rows)

    def entries(self, *, given: bool = False) -> Iterator[tuple[str, Any, Mark | None]]:
        """Yield key, value and annotation of each field that is not None or empty. `given` selects given fields."""
        for name, field in type(self).model_fields.items():
            value = getattr(self, name)
            if value not in (None, (), {}) and (name in self.model_fields_set or not given):
                yield field.alias or name, value, mark_of(field)

    def __dir__(self) -> list[str]:
        return sorted(set(super().__dir__()) - set(dir(BaseModel)))

    def __str__(self) -> str:
        return repr(self)


class DescribedFile(Described):
    """Base of descriptions that have a separate file."""

    schema_version: Literal[1] = Field(default=1, alias="schema")

    def to_toml(self) -> str:
        """Return the description as TOML text, from which `load` reads exactly the same values."""
        return toml.write({"schema": self.schema_version} | self.with_origins())

    def with_origins(self) -> Plain:
        """Return the table in the form of `to_dict`, with the origin of each value if it is known."""
        return self.to_dict()


def mark_of(field: FieldInfo) -> Mark | None:
    """Return the annotation that reads and writes the values of a field."""
    return next((m for m in field.metadata if isinstance(m, Mark)), None)


def as_tables(value: Any, mark: Mark | None = None, *, defaults: bool = False) -> Any:  # noqa: ANN401 - any field
    """Return a value in the form that users write. Tables become dicts, also within lists and dicts."""
    if mark is not None:
        return mark.show(value)
    if isinstance(value, Described):
        return value.with_defaults() if defaults else value.to_dict()
    if isinstance(value, dict):
        return {key: as_tables(one, defaults=defaults) for key, one in value.items()}
    if isinstance(value, tuple) and value and isinstance(value[0], Described):
        return [as_tables(one, defaults=defaults) for one in value]
    return value


def _placed(error: DescriptionError, place: str) -> DescriptionError:
    """Return an error with the full key of its value or table in the file."""
    key = error.key or ""
    if not place or (key and key.partition(".")[0] == place.partition(".")[0]):
        return error
    full = f"{place}.{key}".rstrip(".")
    what = f"{place}.{error.what}" if key and error.what.startswith(key) else f"{full}: {error.what}"
    return wrong(full, what, rule=error.rule, remedy=error.remedy)


def _by_key(name: str, mark: Mark | None) -> property:
    def read(self: Described) -> Any:  # noqa: ANN401 - whatever the field holds
        value = getattr(self, name)
        return value if mark is None else mark.named(value)

    unit = f", stored in {mark.si_unit} as `{name}`" if isinstance(mark, Quantity) and mark.si_unit else ""
    return property(read, doc=f"Value of the key in the file{unit}.")


def inline(value: object) -> str:
    """Write a value on one line, a table as its keys and values."""
    if isinstance(value, dict):
        nested = {key: f"({inline(one)})" if isinstance(one, dict) else inline(one) for key, one in value.items()}
        return ", ".join(f"{key} {one}" for key, one in nested.items())
    if isinstance(value, list | tuple):
        return "; ".join(map(inline, value))
    return f"{value:g}" if isinstance(value, float) and not isinstance(value, units.UnitFloat) else str(value)

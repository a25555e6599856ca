"""A characteristic: its definition, and the labels of its result."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from inspect import signature
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive.arrays import Keyed, Plain
from pneudrive.documented import parts_of
from pneudrive.errors import CommandError
from pneudrive.lazy_names import upper

if TYPE_CHECKING:
    import xarray as xr

    from pneudrive.datasheet.plant import HeldDrive

#: Values by name, or in the order of the docstring. A `ResultValue` is used if the meaning depends on the drive.
Found = Keyed | tuple[Any, ...]
Find = Callable[..., Found]


class ResultValue(NamedTuple):
    """Dimensions, values, unit and meaning of one result."""

    dims: tuple[str, ...]
    values: Any
    unit: str
    meaning: str


#: Axis of results for both strokes.
DIRECTIONS = ResultValue(("direction",), ["out", "back"], "1", "towards the end of chamber b, or of chamber a")


@dataclass(frozen=True)
class Characteristic:
    """A characteristic of a drive.

    Attributes
    ----------
    name : str
        Name for users.
    title : str
    definition : str
        Meaning in one or two sentences.
    algorithm : str
        Method of calculation.
    find : callable
        Function of a `HeldDrive` and of settings by keyword. It returns the values of axes and results by name, or as
        a tuple in the order of its docstring.
    standard : str
        Standard that defines the characteristic, or empty. "form of": definition of the standard, other conditions.
    cites : tuple of str
        Keys of references.bib.
    x, y : str
        Axis and results of the figure. `y` may contain several names, separated by spaces.
    settings : dict
        Name of a setting -> its default and meaning.
    results : dict
        Name of a result or axis -> unit and axes (``"m/s over command"``), and meaning.
    held : bool
        Whether the drive is evaluated without valve lags and cushions (`HeldDrive.static`).
    needs_shares : bool
        Whether the characteristic needs partial valve openings, which switching valves do not have.
    """

    name: str
    title: str
    definition: str
    algorithm: str
    find: Find
    standard: str = ""
    cites: tuple[str, ...] = ()
    x: str = ""
    y: str = ""
    settings: Mapping[str, tuple[Any, str]] = field(default_factory=dict)
    results: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    held: bool = False
    needs_shares: bool = False

    def of(self, plant: HeldDrive, **settings: Any) -> xr.Dataset:  # noqa: ANN401 - of each characteristic its own
        """Return the characteristic for one drive, without intervals.

        Unit and meaning of a result come from the function `find` if it returns them, otherwise from its docstring.
        """
        import xarray as xr

        upper("Pneu")  # registers `found.pneu`
        if plant.actuation.held and self.needs_shares:
            valves = " and ".join(plant.actuation.held)
            raise CommandError.of("datasheet.no_shares", name=plant.name, valves=valves, what=self.name)
        plant = plant.static if self.held else plant
        known = {name: default for name, (default, _) in self.settings.items()} | settings
        found = self.find(plant, **settings)
        named = dict(zip(self.results, found, strict=True)) if isinstance(found, tuple) else found
        values: dict[str, ResultValue] = {}
        for name, value in named.items():
            if isinstance(value, ResultValue):
                values[name] = value
                continue
            form, meaning = self.results[name]
            unit, _, over = form.partition(" over ")
            dims = tuple(over.split(", ")) if over else (name,) if np.ndim(value) else ()
            values[name] = ResultValue(dims, value, unit, meaning.format(**known))
        axes = {dim for value in values.values() for dim in value.dims}
        if "direction" in axes:
            values["direction"] = DIRECTIONS
        labelled = {
            name: (dims, np.asarray(array, None if name in axes else float), {"units": unit, "long_name": meaning})
            for name, (dims, array, unit, meaning) in values.items()
        }
        about = {
            "title": f"{self.title}: {plant.name}",
            "characteristic": self.name,
            "definition": self.definition,
            "algorithm": self.algorithm,
            "standard": self.standard or "none",
            "citations": list(self.cites),
            "description_hash": plant.described.description_hash,
            "assumed": plant.described.assumed(),
        }
        return xr.Dataset(labelled, attrs=about)


def characteristic(name: str, **more: Any) -> Callable[[Find], Characteristic]:  # noqa: ANN401
    """Make a characteristic from a function, whose docstring gives title, definition, settings and results.

    Parameters
    ----------
    name : str
    **more
        Other fields of `Characteristic`: the algorithm, and the definition if it is not in the docstring.
    """

    def made(find: Find) -> Characteristic:
        (text, described), (rest, results) = (parts_of(find, heading) for heading in ("Settings", "Results"))
        text = min(text, rest, key=len)
        title, _, meaning = text.partition("\n\n")
        parameters = signature(find).parameters
        named = [key for key, one in list(parameters.items())[1:] if one.kind is not one.KEYWORD_ONLY]
        settings = {key: (parameters[key].default, described[key][1]) for key in named}
        about: Plain = {"title": title.rstrip("."), "definition": " ".join(meaning.split())} | more
        return Characteristic(name, find=find, settings=settings, results=results, **about)

    return made


def results_of(found: xr.Dataset) -> list[str]:
    """Return the names of results without those of interval bounds; single numbers come first."""
    names = [str(name) for name in found.data_vars]
    plain = [name for name in names if not (name.endswith(("_low", "_high")) and name.rpartition("_")[0] in names)]
    return sorted(plain, key=lambda name: found[name].ndim)


def value_rows(
    found: xr.Dataset, write: Callable[[float, str], str] = lambda value, _: f"{value:.5g}"
) -> Iterator[tuple[str, str, float, float | None, float | None]]:
    """Yield each value with the name of its result, its formatted coordinates, and both bounds of its interval.

    Parameters
    ----------
    found : xarray.Dataset
        From `pneudrive.drive_characteristic`.
    write : callable
        Formats a coordinate with its unit.
    """

    def coordinate(dim: str, index: int) -> str:
        value = found[dim].values[index]
        is_number = found[dim].dtype.kind == "f"
        return f"{dim} {write(float(value), found[dim].attrs['units'])}" if is_number else str(value)

    for name in results_of(found):
        value, dims = found[name].values, found[name].dims
        ends = [found[f"{name}_{end}"].values if f"{name}_{end}" in found else None for end in ("low", "high")]
        for index in np.ndindex(value.shape):
            named = (coordinate(str(dim), k) for dim, k in zip(dims, index, strict=True) if dim in found.coords)
            low, high = (None if end is None else float(end[index]) for end in ends)
            yield name, ", ".join(named), float(value[index]), low, high

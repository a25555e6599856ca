"""A characteristic: its definition, and the labels of its result."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import xarray as xr

    from pneudrive.datasheet.plant import HeldDrive


class ResultValue(NamedTuple):
    """One result: its dimensions, values, unit and meaning."""

    dims: tuple[str, ...]
    values: Any
    unit: str
    meaning: str


def number(value: float, unit: str, meaning: str) -> ResultValue:
    """Return a single number as a result."""
    return ResultValue((), float(value), unit, meaning)


@dataclass(frozen=True)
class Characteristic:
    """A characteristic of a drive.

    Attributes
    ----------
    name : str
        As users write it.
    title : str
    definition : str
        Meaning in one or two sentences.
    algorithm : str
        Method of calculation.
    find : callable
        Gets a `HeldDrive` and settings by keyword; returns axes and results by name.
    standard : str
        Standard that defines it. Empty without a standard. "form" of a standard: its definition with other conditions.
    cites : tuple of str
        Keys of references.bib.
    x, y : str
        Axis and results of the figure; y may be several, separated by spaces.
    settings : dict
        Name of a setting -> its default and meaning.
    slow : bool
        Whether it takes more than about a second.
    held : bool
        Whether it looks at the drive at states that are held: valves without lag, cylinder without cushions.
    needs_shares : bool
        Whether it needs commands between those of full opening, which switching valves do not have.
    """

    name: str
    title: str
    definition: str
    algorithm: str
    find: Callable[..., tuple[dict[str, ResultValue], dict[str, ResultValue]]]
    standard: str = ""
    cites: tuple[str, ...] = ()
    x: str = ""
    y: str = ""
    settings: Mapping[str, tuple[Any, str]] = field(default_factory=dict)
    slow: bool = False
    held: bool = True
    needs_shares: bool = False

    def of(self, plant: HeldDrive, **settings: Any) -> xr.Dataset:  # noqa: ANN401 - of each characteristic its own
        """Return the characteristic for one drive, without intervals."""
        import xarray as xr

        defaults = {name: default for name, (default, _) in self.settings.items()}
        axes, found = self.find(plant, **defaults | settings)
        labelled = {
            name: (one.dims, np.asarray(one.values, dtype=float), {"units": one.unit, "long_name": one.meaning})
            for name, one in found.items()
        }
        coordinates = {
            name: (one.dims, np.asarray(one.values), {"units": one.unit, "long_name": one.meaning})
            for name, one in axes.items()
        }
        return xr.Dataset(labelled, coordinates, self.about(plant))

    def about(self, plant: HeldDrive) -> dict[str, Any]:
        """Return the notes for all results."""
        return {
            "title": f"{self.title}: {plant.name}",
            "characteristic": self.name,
            "definition": self.definition,
            "algorithm": self.algorithm,
            "standard": self.standard or "none",
            "citations": list(self.cites),
            "description_hash": plant.described.description_hash,
            "assumed": plant.described.assumed(),
        }

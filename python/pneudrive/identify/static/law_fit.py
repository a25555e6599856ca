"""Fit of any law: values with intervals, and their application to a drive."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from pneudrive.describe.parameters import parameter_quantities
from pneudrive.describe.tables.dependences import DEPENDENCES
from pneudrive.describe.tables.friction import Friction
from pneudrive.errors import FitError
from pneudrive.identify.identified import Identified, apply_identified
from pneudrive.identify.static.core_law import AnyLaw
from pneudrive.identify.static.friction_curve import CurveEntry, SlidingCurve, curve_of_friction, middle_of, speeds_over
from pneudrive.identify.static.model import at_conditions
from pneudrive.identify.static.sliding_fit import SlidingFit

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from pneudrive.describe.drive import Drive

    Array = NDArray[np.float64]

#: Modifiers that act only at rest, without effect on steady sliding.
AT_REST = ("dwell", "relaxation")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LawFit(SlidingFit):
    """Parameters of any law with their uncertainty.

    Attributes
    ----------
    model : AnyLaw
        Given law with guesses, and the names of its free parameters.
    intervals : dict
        Free parameter that the data determine -> 95 % interval, statistical, first order in the logarithm of positive
        parameters; other parameters have none.
    systematic : dict
        Free parameter -> standard uncertainty from errors shared by all rows (sensor gain, pressure, area).
    covariance : ndarray, shape (p, p)
    undetermined : tuple of str
        Free parameters in directions that the data do not determine.
    unseen : tuple of str
        Parameters of the law without effect on steady sliding.
    statistics : dict
        values, degrees_of_freedom, scale, rms_n, aicc, bic, starts, starts_agreeing.
    provenance : dict
        Version, hash of the values, recordings, options.
    observations : Observations or None
        Fitted values (None if read from a file).
    """

    KIND: ClassVar[str] = "law"
    TITLE: ClassVar[str] = "fit of a law"
    GROUPS: ClassVar[tuple[str, ...]] = ("parameters",)
    HEAD: ClassVar[str] = (
        "# Fit of any law. SI units; intervals are 95 %, statistical; [given] has the start values of the search."
    )

    model: AnyLaw
    unseen: tuple[str, ...]

    @property
    def parameters(self) -> dict[str, float]:
        """Free parameter -> value, SI."""
        return self.values

    @property
    def friction(self) -> Friction:
        """Law with the determined parameters; all others keep the given values."""
        marks = parameter_quantities(self.model.friction.entry)
        fitted = {name: marks[name].show(self.values[name]) for name in self.determined}
        return Friction.model_validate(self.model.friction.to_dict() | fitted)

    def predict(self, speed_m_s: ArrayLike, gauge_a_pa: ArrayLike = 0.0, gauge_b_pa: ArrayLike = 0.0) -> Array:
        """Return the friction at speeds and gauge pressures, N."""
        speed, a, b = np.broadcast_arrays(*(np.asarray(x, float) for x in (speed_m_s, gauge_a_pa, gauge_b_pa)))
        return self.model.value(self.coordinates, at_conditions(speed.ravel(), a.ravel(), b.ravel())).reshape(
            speed.shape
        )

    def apply(self, drive: Drive) -> Drive:
        """Return a drive with this law, each determined value with its interval and its recordings.

        A drive with the same law keeps its undetermined parameters. Any other drive gets the whole law, with unfitted
        parameters at the values of the fit.

        Raises
        ------
        FitError
            A modifier of sliding friction, such as pressure or direction, differs between drive and fit.
        DescriptionError
            The combination of fitted and kept values violates a rule of the law.
        """
        own, theirs = self.model.friction, drive.friction
        sliding = [key for key in DEPENDENCES if key not in AT_REST]
        for key in sliding:
            there = getattr(theirs, key)
            if there is not None and there != getattr(own, key):
                raise FitError(
                    f"[friction.{key}] of the drive differs from that of the fit",
                    rule="fitted values are valid only with the modifiers of the fit",
                    remedy=f"Fit the drive's friction (drive.friction), or remove [friction.{key}] from the drive.",
                )
        tables: dict[str, Any] = {key: value for key in sliding if (value := getattr(own, key)) is not None}
        if (own.law, own.formula) != (theirs.law, theirs.formula):
            tables = {key: value for key, value in self.friction.to_dict().items() if key not in AT_REST}
        with_law = drive.replace({f"friction.{key}": value for key, value in tables.items()}) if tables else drive
        return apply_identified(self.identified(), with_law)

    def identified(self) -> Identified:
        """Return the determined parameters under their names in the drive file, with their whole uncertainty."""
        return self.identified_as({name: f"friction.{name}" for name in self.determined})

    def curve(
        self,
        gauge_a_pa: float | None = None,
        gauge_b_pa: float | None = None,
        speeds_m_s: tuple[float, float] | None = None,
    ) -> SlidingCurve:
        """Return the law's curve with its determined parameters; see `FrictionFit.curve`."""
        said = self.provenance
        speed = speeds_over(speeds_m_s or said.get("speed_m_s"), "fit")
        gauges = tuple(middle_of(p, said.get(f"gauge_{c}_pa")) for c, p in (("a", gauge_a_pa), ("b", gauge_b_pa)))
        entries = [
            CurveEntry(name, value, self.units[name], *self.intervals.get(name, (np.nan, np.nan)), "")
            for name, value in self.values.items()
        ]
        title = f"friction fit, law {self.model.friction.law}"
        return curve_of_friction(self.friction, title, speed, (gauges[0], gauges[1]), entries)

    def statements(self) -> list[str]:
        """Return sentences on undetermined parameters."""
        lost, unseen = ", ".join(self.undetermined), ", ".join(self.unseen)
        said = [f"these values do not determine {lost}"] if lost else []
        return said + ([f"{unseen} have no effect on steady sliding and keep their given values"] if unseen else [])

    def _first(self) -> dict[str, Any]:
        notes = {"notes": list(self.notes)} if self.notes else {}
        return {"kind": self.KIND, "unseen": self.unseen} | notes

    def _last(self) -> dict[str, Any]:
        return {"given": {"friction": self.model.friction.to_dict()}}

    @classmethod
    def _from_content(cls, content: dict[str, Any]) -> dict[str, Any]:
        lost = tuple(name for name, entry in content["parameters"].items() if not entry["determined"])
        found = super()._from_content(content | {"undetermined": []})
        model = AnyLaw(Friction.model_validate(content["given"]["friction"]), found["free"])
        return found | {"model": model, "unseen": tuple(content["unseen"]), "undetermined": lost}

    def _title(self) -> str:
        s = self.statistics
        return (
            f"{self.model.friction.law} friction from {s['values']:.0f} values (rms {s['rms_n']:.3g} N, "
            f"residuals {s['scale']:.2g} times their standard errors, "
            f"{s['starts_agreeing']:.0f} of {s['starts']:.0f} starts agree)"
        )

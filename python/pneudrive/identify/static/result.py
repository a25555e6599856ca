"""Results of fits of steady sliding: prediction, profiles, export, and application to a drive."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from pneudrive.constants import STANDARD_ATMOSPHERE_PA
from pneudrive.describe import Circuit, Drive
from pneudrive.describe.marks import parameter_quantities
from pneudrive.describe.tables.dependences import DEPENDENCES
from pneudrive.describe.tables.friction import Friction, friction_laws
from pneudrive.errors import FitError, warn
from pneudrive.estimate.estimates import CONFIDENCE, student
from pneudrive.friction.friction_map import AMBIENT, SAME_PA
from pneudrive.identify import export
from pneudrive.identify.base import Fit, FitFile
from pneudrive.identify.identified import Dependences, FittedData, apply_identified, sentence, sentences, stated
from pneudrive.identify.static import model as sliding
from pneudrive.identify.static.robust import estimated, interval_over_knees
from pneudrive.repr_tables import Shown
from pneudrive.views import Finding

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

    from pneudrive.arrays import Array, Columns, Keyed, NamedNumbers, Pair, Plain
    from pneudrive.identify.identified import Identified


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SlidingFit(Fit):
    """Fit of a law of steady sliding to a friction map. A fit from a file does not contain `observations`."""

    model: sliding.StaticLaw
    observations: sliding.Observations | None = field(default=None, repr=False)

    @property
    def fits(self) -> bool:
        """Whether the residuals are within `MISFIT` standard errors, or within the fraction `SMALL` of the friction."""
        s = self.statistics
        return s["scale"] <= MISFIT or s["rms_n"] <= SMALL * s.get("mean_n", 0.0)  # older files lack the mean

    def findings(self) -> tuple[Finding, ...]:
        """Return a finding if the law does not follow the values, and undetermined values with their remedies."""
        said = [] if self.fits else [Finding(**stated("application", "misfit", s=self.statistics), state="bad")]
        return (*said, *super().findings())

    def _at(self, *conditions: ArrayLike) -> sliding.Observations:
        """Return the conditions of a prediction as rows of data, and warn if they are outside the measured ranges."""
        at = sliding.at_conditions(*conditions, ambient_pa=self.provenance.get(AMBIENT, STANDARD_ATMOSPHERE_PA))
        if not np.isfinite(at.speed_m_s).all() or not at.speed_m_s.all():
            raise FitError.of("identify.standing", speed=conditions[0])
        for name in RANGES if getattr(self.model, "chambers", ()) else ("speed_m_s",):
            values, (low, high) = getattr(at, name), self.provenance.get(name, (-np.inf, np.inf))
            words, size, unit, least = RANGES[name]
            far = values[np.maximum(low - values, values - high) > np.maximum(EDGE * np.abs(values), least)]
            if far.size:
                ends = {"low": low / size, "high": high / size, "at": far[0] / size}
                warn(sentence("notes", "extrapolated", name=words, unit=unit, **ends))
        return at

    @property
    def parameters(self) -> NamedNumbers:
        """Name in the drive file -> value in SI; NaN for parameters that could not be estimated."""
        return self.values

    @property
    def estimates(self) -> Array:
        """Values of the free parameters, shape (p,)."""
        values = self.free_values()
        return np.array([values[n] for n in self.free])

    @property
    def coordinates(self) -> Array:
        """Internal coordinates of the model at the estimates, shape (p,)."""
        return self.model.internal(self.estimates)

    def compared(self) -> dict[str, FittedData]:
        """Return measured and fitted friction. Empty if the fit was read from a file."""
        data = self.observations
        if data is None:
            return {}
        model, _ = self.model.force_and_slopes(self.estimates, data)
        return {"friction": FittedData("speed_m_s", "friction_n", data.speed_m_s, data.friction_n, model)}


#: Residuals above which a law does not follow its values: in standard errors, and as a fraction of friction (assumed).
MISFIT, SMALL = 5.0, 0.05
#: Condition of a prediction -> its name, the SI value and the text of its usual unit, and the smallest difference.
RANGES = {"speed_m_s": ("a speed", 1e-3, "mm/s", 0.0)}
RANGES |= {f"gauge_{side}_pa": (f"a pressure in chamber {side}", 1e5, "bar gauge", SAME_PA) for side in "ab"}
#: Fraction of a value within which it agrees with the measured range.
EDGE = 0.05
#: Laws of a fit from a file, and required entries of its statistics.
LAWS = ("coulomb", "stribeck")
STATISTICS = ("values", "degrees_of_freedom", "scale", "variance", "rms_n")


#: Values that a drive keeps cause no warning if the curves of drive and fit differ by less than this fraction of
#: friction.
KEPT_SHARE = 0.01
#: Parameters of the steady curve over speed.
STEADY = ("coulomb", "breakaway", "stribeck_velocity", "viscous")
#: Correlation above which two parameters are reported to change together.
TOGETHER = 0.9
#: Factor by which candidate speeds for a remedy extend beyond the measured speeds.
BEYOND = 10.0
CANDIDATES = 60


@dataclass(frozen=True, repr=False)
class Prediction(Shown):
    """Predicted friction at given speeds in N; the arrays have the shape of the speeds.

    Attributes
    ----------
    friction_n : ndarray
        Friction of the law at its estimates.
    lower_n, upper_n : ndarray
        Interval of the given probability (Student's t, first order).
    stderr_n : ndarray
        Standard error.
    """

    friction_n: Array
    lower_n: Array
    upper_n: Array
    stderr_n: Array


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FrictionFit(SlidingFit, kind="friction map"):
    """Parameters of a sliding law with their uncertainty.

    Attributes
    ----------
    law : str
        Requested law. If the data do not determine it, `model` is the smaller fitted law.
    free : tuple of str
        Order of `covariance`.
    covariance : ndarray, shape (p, p)
        Statistical covariance of the free parameters, without directions that the data do not determine.
    intervals : dict
        Determined free parameter -> (lower, upper), statistical, 95 %. Other parameters have no interval.
    systematic : dict
        Free parameter -> standard uncertainty from errors shared by all rows (sensor gain, pressure, area).
    undetermined : tuple of Undetermined
        Undetermined parameters, each with reason and remedy.
    notes : tuple of str
        Notes on omissions and assumptions.
    statistics : dict
        values, degrees_of_freedom, scale (1: the standard errors are right), variance, scatter_n
        (between levels, beyond their standard errors), mean_n, noise_n, rms_n, outlying,
        fit_percent (NaN without degrees of freedom), aicc, bic.
    provenance : dict
        Version, hash of the values, options.
    model : FrictionModel
    observations : Observations or None
        Fitted values (None if read from a file).
    weights : ndarray or None
        Huber weight of each value.
    dependences : Dependences
        Measured friction modifiers: direction, position, stops, temperature. `apply` adds them to the drive.
    """

    law: str
    model: sliding.FrictionModel
    weights: Array | None = field(default=None, repr=False)
    dependences: Dependences = field(default_factory=Dependences)

    def correlated(self) -> list[str]:
        """Return sentences on pairs of parameters with a correlation above 0.9, each with a remedy."""
        names, shares = self.free, self.correlation
        return [
            f"{names[i]} and {names[j]} change together (correlation {shares[i, j]:+.2f}): {_remedy(self, i, j)}"
            for i, j in combinations(range(len(names)), 2)
            if abs(shares[i, j]) > TOGETHER
        ]

    def predict(
        self,
        speed_m_s: ArrayLike,
        gauge_a_pa: ArrayLike = 0.0,
        gauge_b_pa: ArrayLike = 0.0,
        *,
        stderr_n: ArrayLike | None = None,
        probability: float = 0.95,
    ) -> Prediction:
        """Predict friction at given speeds with an interval.

        Parameters
        ----------
        speed_m_s : array_like or str
            Speeds in m/s, or a quantity such as "50 mm/s". The sign is ignored.
        gauge_a_pa, gauge_b_pa : array_like or str
            Gauge pressures in Pa, broadcast with the speeds, or a quantity such as "3 bar gauge". No effect if the fit
            does not depend on pressure.
        stderr_n : array_like, optional
            None: interval of the law itself. Values: interval of a new mean with this standard error, including the
            scatter between levels and the scale of the residuals.
        probability : float
            Probability of the interval.

        Returns
        -------
        Prediction

        Warns
        -----
        PneudriveWarning
            A speed or a pressure is outside the measured range.
        """
        at = self._at(speed_m_s, gauge_a_pa, gauge_b_pa)
        shape = np.broadcast(speed_m_s, gauge_a_pa, gauge_b_pa).shape
        value, slopes = self.model.force_and_slopes(self.estimates, at)
        variance = np.einsum("ij,jk,ik->i", slopes, self.covariance, slopes)
        if stderr_n is not None:
            new = np.broadcast_to(stderr_n, shape).ravel() ** 2 + self.statistics["scatter_n"] ** 2
            variance = variance + self.statistics["variance"] * new
        stderr = np.sqrt(np.maximum(variance, 0.0))
        reach = student(int(self.statistics["degrees_of_freedom"]), probability) * stderr
        if self.model.chambers == ("ab",):
            # Error of equal slopes at pressures that did not occur together: each slope is between zero and the slope
            # that would explain the joint effect alone.
            (low_a, high_a), (low_b, high_b) = (self.provenance.get(f"gauge_{side}_pa", (0.0, 1.0)) for side in "ab")
            a, b = high_a - low_a, high_b - low_b
            off = np.abs((at.gauge_a_pa - low_a) * b - (at.gauge_b_pa - low_b) * a) / min(a, b)
            beyond = sliding.at_conditions(at.speed_m_s, at.gauge_a_pa + off, at.gauge_b_pa + off)
            reach = reach + np.abs(self.model.force_and_slopes(self.estimates, beyond)[0] - value) / 2.0
        value, stderr, reach = (x.reshape(shape) for x in (value, stderr, reach))
        return Prediction(value, value - reach, value + reach, stderr)

    # -- into a drive -----------------------------------------------------------------------------------------

    def apply(self, drive: Drive) -> Drive:
        """Return a new drive whose friction has the determined parameters of this fit.

        The drive keeps its values of undetermined parameters, and of parameters without effect on sliding (bristles).

        Parameters
        ----------
        drive : Drive

        Returns
        -------
        Drive

        Raises
        ------
        FitError
            The fit determines a parameter that the drive's law does not have, or `drive` is a circuit.

        Warns
        -----
        PneudriveWarning
            An undetermined breakaway force below the fitted Coulomb force (or the reverse) is set to the fitted force.
            The values that the drive keeps make its friction differ from the fit. Measured effects of a campaign
            cannot be applied, or were assumed.
        """
        if isinstance(drive, Circuit):
            raise FitError(**stated("application", "to_circuit", name=drive.name))
        known = {p["key"] for p in drive.friction.entry["parameters"]}
        forces = {n for n in self.determined if n not in sliding.PRESSURE_NAMES}
        other_law = not forces <= known
        takes_curve = other_law or (self.model.stribeck and "stribeck_exponent" in known)
        missing = sorted({*STEADY} - forces)
        if other_law and missing:
            raise FitError(**stated("application", "no_stribeck", law=drive.friction.law, missing=", ".join(missing)))
        seals = drive.friction.pressure
        if self.model.chambers and self.model.pressure != "linear":
            raise FitError(**stated("application", "curved", form=self.model.pressure))
        if seals is not None and not self.model.chambers and any((*seals.coulomb_n_pa, *seals.breakaway_n_pa)):
            raise FitError(**stated("application", "pressure"))
        changes: Plain = {"friction.law": self.law} if other_law else {}
        if takes_curve and self.model.lorentzian:
            changes["friction.stribeck_shape"] = "lorentzian"
        found = self.identified(curve=takes_curve and not self.model.lorentzian)
        kept = drive.friction.parameters.get("breakaway", 0.0)
        if "coulomb" in forces and "breakaway" not in forces and not other_law and kept > self.values["coulomb"]:
            warn(sentence("notes", "breakaway", kept=kept, coulomb=self.values["coulomb"]))
        for note in self.dependences.notes:
            warn(note)
        if self.model.chambers == ("ab",):
            warn(sentence("notes", "equal_slopes"))
        law = str(changes.get("friction.law", drive.friction.law))
        modifiers = self.dependences if friction_laws()[law]["bristles"] else self.dependences.without("relaxation")
        after = apply_identified(found, drive, changes, modifiers)
        self._warn_of_kept(after)
        return after

    def _warn_of_kept(self, after: Drive) -> None:
        """Warn if values that the drive keeps make its friction differ from that of the fit."""
        kept = [n for n in STEADY if n not in self.determined and n in after.friction.parameters]
        speeds = self.provenance.get("speed_m_s")
        if not kept or not isinstance(speeds, (list, tuple)) or not speeds[0] < speeds[1]:
            return
        low, high = speeds
        fitted = self.curve()
        friction_n = export.curve_of_drive(after, (low, high), fitted.gauge_a_pa, fitted.gauge_b_pa).friction_n
        k = int(np.argmax(np.abs(friction_n - fitted.friction_n)))
        speed, own, known = 1e3 * fitted.speed_m_s[k], friction_n[k], fitted.friction_n[k]
        if abs(own - known) > KEPT_SHARE * abs(known):
            warn(sentence("notes", "kept", kept=", ".join(kept), speed=speed, own=own, fitted=known))

    def identified(self, *, curve: bool = False) -> Identified:
        """Return the determined parameters under their names in the drive file; `curve` adds the Stribeck exponent.

        The intervals combine statistical (profile likelihood) and systematic uncertainty in quadrature. If the data
        determine only the sum of two slopes, each slope gets half of the sum, without an interval.
        """
        names = [n for n in self.determined if n not in sliding.PRESSURE_NAMES]
        if curve and "stribeck_exponent" not in names:
            names.append("stribeck_exponent")
        half = [n for n in sliding.PRESSURE_NAMES if n in self.values and f"{n[:-1]}ab" in self.free]
        slopes = [n for n in sliding.PRESSURE_NAMES if n in self.determined or n in half]
        return self.identified_as({n: f"friction.{n}" for n in names} | {n: slope_key(n) for n in slopes})

    def _curve(self, speeds_m_s: Any, gauges_pa: Pair) -> export.SlidingCurve:  # noqa: ANN401 - checked
        speed, found = export.speeds_over(speeds_m_s, "fit"), self.identified()
        entries: dict[str, export.Entry] = {}
        for name, value in self.values.items():
            key = slope_key(name) if name in sliding.PRESSURE_NAMES else f"friction.{name}"
            ends = found.intervals.get(key, (np.nan, np.nan))
            note = "" if name in self.determined else "fixed" if name not in self.free else "not determined by the data"
            source = ", ".join(found.recordings) if key in found.intervals else ""
            entries[name] = value, self.units[name], *ends, source, note
        exponent = self.values.get("stribeck_exponent", 2.0)
        shape = "lorentzian" if self.model.lorentzian else f"exp(-(v/vs)^{exponent:g})"
        effects = sentences("not_exported")
        lost = [effects[key].partition(":")[0] for key in self.dependences.friction if key in effects]
        pressure = effects["pressure"].format(a=gauges_pa[0] / 1e5, b=gauges_pa[1] / 1e5)
        return export.SlidingCurve(
            f"friction fit, law {self.law}",
            self.model.law,
            shape if self.model.stribeck else "none",
            speed,
            self.predict(speed, *gauges_pa).friction_n,
            *gauges_pa,
            entries,
            (*([pressure] if self.model.chambers else ()), *lost),
            tuple(lost),
        )

    # -- file and display ----------------------------------------------------------------------------

    def _groups(self) -> tuple[NamedNumbers, ...]:
        """Return the tables of values: parameters, and sums of slopes if only the sum of two is determined."""
        return self.values, {n: self.values[n.removesuffix("b")] for n in self.free if n.endswith("_ab")}

    def _last(self) -> Plain:
        """Return the measured friction modifiers."""
        found = self.dependences
        return {"dependences": dict(vars(found))} if found.friction or found.notes else {}

    def _first(self) -> Plain:
        return {"law": self.law, "notes": list(self.notes), "model": self.model.table()}

    @classmethod
    def _fields(cls, file: FitFile) -> Plain:
        values, shared = file.groups
        for name in file.content["covariance"]["names"]:  # older files: a shared slope stands under each chamber
            if name not in values | shared:
                shared[name] = values[name.replace("_ab", "_a")]
        found = super()._fields(file)
        model = sliding.FrictionModel.of_table(file.content["model"])
        if model.law not in LAWS or model.names != found["free"] or found["covariance"].size == 0:
            raise ValueError(f"law, chambers and parameters do not match: {', '.join(found['free'])}")
        if not all(np.isfinite(found["statistics"][name]) and found["statistics"][name] >= 0.0 for name in STATISTICS):
            raise ValueError(f"statistics: {', '.join(STATISTICS)} are numbers of zero and above")
        if "direction" not in found["provenance"]:
            raise KeyError("direction")
        # older files have intervals of parameters without a value
        known = {name for name, entry in file.entries.items() if entry.standard_error is not None}
        found["intervals"] = {name: ends for name, ends in found["intervals"].items() if name in known}
        found["systematic"] = dict.fromkeys(found["free"], 0.0) | found["systematic"]
        dependences = file.content.get("dependences", {})
        found["dependences"] = Dependences(**dependences | {"notes": tuple(dependences.get("notes", ()))})
        return found | {"law": file.content["law"], "model": model}

    def _shown(self) -> NamedNumbers:
        hidden = {n for n in self.values if n not in self.free and self.units[n].startswith("N/Pa")}
        return {name: value for name, value in self.free_values().items() if name not in hidden}


def slope_key(name: str) -> str:
    """Return the name in a drive file for the slope of a force over a chamber's pressure."""
    force, _, chamber = name.rpartition("_")
    return f"friction.pressure.{force}.{chamber}"


def _remedy(fit: FrictionFit, i: int, j: int) -> str:
    """Return the speed at which a further value reduces the correlation most, or a general remedy for pressures."""
    names = (fit.free[i], fit.free[j])
    if any(sliding.unit_of(name).startswith("N/Pa") for name in names):
        return "pressures that differ more, and are not varied together, would separate them"
    if fit.observations is None:
        return "more speeds would separate them"
    speed = fit.observations.speed_m_s
    low, high = float(speed.min()), float(speed.max())
    tried = np.geomspace(low / BEYOND, high * BEYOND, CANDIDATES)
    at = sliding.at_conditions(tried, *(np.median(gauge) for gauge in fit.observations.gauges_pa))
    _, gradient = fit.model.force_and_slopes(fit.estimates, at)
    noise = fit.statistics["variance"] * float(np.median(fit.observations.stderr_n)) ** 2
    carried = gradient @ fit.covariance  # (c, p)
    added = 1.0 / (noise + np.einsum("cp,cp->c", gradient, carried))
    after = fit.covariance[None] - added[:, None, None] * carried[:, :, None] * carried[:, None, :]
    together = np.abs(after[:, i, j]) / np.sqrt(after[:, i, i] * after[:, j, j])
    best = float(tried[int(np.argmin(together))])
    if best < low:
        return f"speeds below {1e3 * low:.3g} mm/s would separate them"
    if best > high:
        return f"speeds above {1e3 * high:.3g} mm/s would separate them"
    return f"more values near {1e3 * best:.2g} mm/s would separate them"


#: Modifiers that act only at rest, without effect on steady sliding.
AT_REST = ("dwell", "relaxation")


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LawFit(SlidingFit, kind="law"):
    """Parameters of any law with their uncertainty.

    Attributes
    ----------
    model : AnyLaw
        Given law with guesses, and the names of its free parameters.
    intervals : dict
        Determined free parameter -> 95 % interval, statistical, first order in the logarithm of positive parameters.
        Other parameters have no interval.
    systematic : dict
        Free parameter -> standard uncertainty from errors shared by all rows (sensor gain, pressure, area).
    covariance : ndarray, shape (p, p)
    undetermined : tuple of str
        Free parameters that the data do not determine.
    unseen : tuple of str
        Parameters of the law without effect on steady sliding.
    statistics : dict
        values, degrees_of_freedom, scale, rms_n, aicc, bic, starts, starts_agreeing.
    provenance : dict
        Version, hash of the values, recordings, options.
    observations : Observations or None
        Fitted values (None if read from a file).
    """

    model: sliding.AnyLaw
    unseen: tuple[str, ...]

    @property
    def friction(self) -> Friction:
        """Law with the determined parameters. Other parameters keep the given values."""
        marks = parameter_quantities(self.model.friction.entry)
        fitted = {name: marks[name].show(self.values[name]) for name in self.determined}
        return Friction.model_validate(self.model.friction.to_dict() | fitted)

    def predict(
        self,
        speed_m_s: ArrayLike,
        gauge_a_pa: ArrayLike = 0.0,
        gauge_b_pa: ArrayLike = 0.0,
    ) -> Array:
        """Return the friction in N at speeds and gauge pressures, as `FrictionFit.predict` takes them."""
        conditions = speed_m_s, gauge_a_pa, gauge_b_pa
        force, _ = self.model.force_and_slopes(self.estimates, self._at(*conditions))
        return force.reshape(np.broadcast(*conditions).shape)

    def apply(self, drive: Drive) -> Drive:
        """Return a drive with this law. Each determined value states its interval and its recordings.

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
        steady = [key for key in DEPENDENCES if key not in AT_REST]
        for key in steady:
            there = getattr(theirs, key)
            if there is not None and there != getattr(own, key):
                raise FitError(**stated("application", "modifier", key=key))
        tables: Plain = {key: value for key in steady if (value := getattr(own, key)) is not None}
        if (own.law, own.formula) != (theirs.law, theirs.formula):
            tables = {key: value for key, value in self.friction.to_dict().items() if key not in AT_REST}
        with_law = drive.replace({f"friction.{key}": value for key, value in tables.items()}) if tables else drive
        return apply_identified(self.identified(), with_law)

    def identified(self) -> Identified:
        """Return the determined parameters under their names in the drive file, with their total uncertainty."""
        return self.identified_as({name: f"friction.{name}" for name in self.determined})

    def _curve(self, speeds_m_s: Any, gauges_pa: Pair) -> export.SlidingCurve:  # noqa: ANN401 - checked
        speed = export.speeds_over(speeds_m_s, "fit")
        entries: dict[str, export.Entry] = {
            name: (value, self.units[name], *self.intervals.get(name, (np.nan, np.nan)), "", "")
            for name, value in self.values.items()
        }
        title = f"friction fit, law {self.model.friction.law}"
        return export.curve_of_friction(self.friction, title, speed, gauges_pa, entries)

    def findings(self) -> tuple[Finding, ...]:
        """Return findings on residuals, undetermined parameters, and parameters without effect on steady sliding."""
        lost, unseen = ", ".join(self.undetermined), ", ".join(self.unseen)
        found = [Finding(f"these values do not determine {lost}", "open")] if lost else []
        words = "have no effect on steady sliding and keep their given values"
        return (*super().findings(), *found, *([Finding(f"{unseen} {words}")] if unseen else []))

    def _first(self) -> Plain:
        notes = {"notes": list(self.notes)} if self.notes else {}
        return {"kind": self.KIND, "unseen": self.unseen} | notes

    def _last(self) -> Plain:
        return {"given": {"friction": self.model.friction.to_dict()}}

    @classmethod
    def _fields(cls, file: FitFile) -> Plain:
        found = super()._fields(file)
        model = sliding.AnyLaw(Friction.model_validate(file.content["given"]["friction"]), found["free"])
        lost = tuple(name for name, entry in file.content["parameters"].items() if not entry["determined"])
        return found | {"model": model, "unseen": tuple(file.content["unseen"]), "undetermined": lost}


Sliding = TypeVar("Sliding", bound=SlidingFit)

#: Probabilities of the intervals that form a profile.
PROBABILITIES = (0.1, 0.25, 0.4, 0.5, 0.6, 0.7, 0.8, 0.875, 0.925, CONFIDENCE, 0.97, 0.985, 0.99)


def values_of_fit(friction_map: xr.Dataset, provenance: Keyed) -> sliding.Observations | None:
    """Select the values of a map in the same way as the fit with this provenance. None for a map of other recordings.

    Parameters
    ----------
    friction_map : xarray.Dataset
    provenance : mapping
        Provenance of a `SlidingFit`.

    Raises
    ------
    FitError
        No row of the map can be used.
    """
    names = list(provenance.get("recordings", ()))
    of_row = friction_map["recording"].to_numpy().astype(str)
    if names and sliding.recordings_of(friction_map) != names:
        if not set(names) <= set(of_row):
            return None
        friction_map = friction_map.isel(row=np.flatnonzero(np.isin(of_row, names)))
    direction = provenance["direction"]
    return sliding.selected(
        friction_map,
        None if direction == "both" else int(direction),
        provenance.get("exclude_flags", ()),
        ambient_pressure_pa=float(provenance["ambient_pressure_pa"]),
    )[0]


def with_map(fit: Sliding, friction_map: xr.Dataset) -> Sliding:
    """Return a fit with the values of its map, for residuals (`Fit.compared`, `Fit.report`).

    Parameters
    ----------
    fit : FrictionFit or LawFit
        Fit read from a file.
    friction_map : xarray.Dataset
        The fitted map.

    Raises
    ------
    FitError
        The map differs from the fitted map, according to the hash in the fit's provenance.
    """
    return replace(fit, observations=_values(fit, friction_map))


def _values(fit: SlidingFit, friction_map: xr.Dataset) -> sliding.Observations:
    data = values_of_fit(friction_map, fit.provenance)
    if data is None or sliding.fingerprint(data) != fit.provenance["map_sha256"]:
        raise FitError(**stated("application", "other_map"))
    return data


def profiles(fit: FrictionFit, friction_map: xr.Dataset) -> Columns:
    """Return intervals by profile likelihood for the probabilities `PROBABILITIES`.

    The intervals show how well the data determine each value.

    Parameters
    ----------
    fit : FrictionFit
    friction_map : xarray.Dataset
        The fitted map.

    Returns
    -------
    dict
        Free value -> lower and upper ends in SI, shape (n, 2). Infinite if the data do not bound the value.

    Raises
    ------
    FitError
        The map differs from the fitted map, or the fit uses a loss function of an earlier version.
    """
    loss = fit.provenance.get("loss", "huber")
    if loss != "huber":  # older fits
        raise FitError(f"the fit uses the loss function {loss}", rule="huber", remedy="Fit again.")
    found = estimated(fit.model, _values(fit, friction_map))
    each = [interval_over_knees(found, student(found.dof, share)) for share in PROBABILITIES]
    return {name: np.array([one[name] for one in each]) for name in fit.free}


MOST_PAIRS, OUTLINE = 6, 73  # ellipses, and points of the outline of one


def ellipses(fit: Fit) -> list[tuple[tuple[str, str], float, Array]]:
    """Return the first-order 95 % confidence ellipses of the `MOST_PAIRS` pairs with the largest correlations.

    Parameters
    ----------
    fit : Fit
        Fit of any kind, also from a file.

    Returns
    -------
    list of ((str, str), float, ndarray)
        Names of both values, their correlation, and the closed outline of the ellipse in SI, shape (n, 2). The ellipse
        projects to value ± t times standard error.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, OUTLINE)
    circle = np.stack([np.cos(turn), np.sin(turn)])
    values, errors = fit.free_values(), fit.standard_errors
    sure = [k for k, name in enumerate(fit.free) if errors.get(name, 0.0) > 0.0]
    pairs = sorted(combinations(sure, 2), key=lambda pair: -abs(fit.correlation[pair]))
    out = []
    for i, j in pairs[:MOST_PAIRS]:
        names = fit.free[i], fit.free[j]
        centre, size = (np.array([[known[name]] for name in names]) for known in (values, errors))
        rho = float(np.clip(fit.correlation[i, j], -1.0, 1.0))
        root = np.array([[1.0, 0.0], [rho, np.sqrt(1.0 - rho * rho)]])
        out.append((names, rho, (centre + fit.reach * size * (root @ circle)).T))
    return out

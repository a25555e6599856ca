"""The fit of any law: values with intervals, what they give to a drive, and their file."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.describe import Friction, toml
from pneudrive.describe.dependences import DEPENDENCES
from pneudrive.describe.parameters import parameter_quantities
from pneudrive.errors import FitError
from pneudrive.identify.apply import HASH_DIGITS, whole_interval
from pneudrive.identify.identified import Identified, apply_identified
from pneudrive.identify.intervals import WithIntervals
from pneudrive.show import Shown
from pneudrive.trajectory import whole

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from pneudrive.describe import Drive
    from pneudrive.identify.any_law import AnyLaw

    Array = NDArray[np.float64]

SCHEMA, KIND = 1, "law"
#: What acts on a law at rest only: steady sliding does not show it.
AT_REST = ("dwell", "relaxation")


@dataclass(frozen=True, repr=False)
class LawFit(WithIntervals, Shown):
    """Parameters of any law with their uncertainty.

    Attributes
    ----------
    model : AnyLaw
        The law as it was given, with guesses, and the names of its free parameters.
    parameters : dict
        Free parameter -> value, SI.
    intervals : dict
        Free parameter that the data determine -> 95 % interval, statistical, first order in the logarithm of what is
        positive; nothing else has one.
    systematic : dict
        Free parameter -> standard uncertainty from what all rows share (sensor gain, pressure, area).
    covariance : ndarray, shape (p, p)
    undetermined : tuple of str
        Free parameters in directions that the data do not determine.
    unseen : tuple of str
        Parameters of the law that steady sliding does not show.
    statistics : dict
        values, degrees_of_freedom, scale, rms_n, aicc, bic, starts, starts_agreeing.
    provenance : dict
        Version, hash of the values, recordings, options.
    """

    model: AnyLaw
    parameters: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    systematic: dict[str, float]
    covariance: Array
    undetermined: tuple[str, ...]
    unseen: tuple[str, ...]
    statistics: dict[str, float]
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def determined(self) -> tuple[str, ...]:
        """Free parameters that the data determine."""
        return tuple(name for name in self.parameters if name not in self.undetermined)

    @property
    def friction(self) -> Friction:
        """The law with what the data determine of it; all else as it was given."""
        marks = parameter_quantities(self.model.friction.entry)
        fitted = {name: marks[name].show(self.parameters[name]) for name in self.determined}
        return Friction.model_validate(self.model.friction.to_dict() | fitted)

    def predict(self, speed_m_s: ArrayLike, gauge_a_pa: ArrayLike = 0.0, gauge_b_pa: ArrayLike = 0.0) -> Array:
        """Friction at these speeds and gauge pressures, N."""
        from pneudrive.identify.model import at_conditions

        speed, a, b = np.broadcast_arrays(*(np.asarray(x, float) for x in (speed_m_s, gauge_a_pa, gauge_b_pa)))
        q = self.model.internal(np.array([self.parameters[n] for n in self.model.names]))
        return self.model.value(q, at_conditions(speed.ravel(), a.ravel(), b.ravel())).reshape(speed.shape)

    def apply(self, drive: Drive) -> Drive:
        """Return a drive with this law, each determined value with its interval and its recordings.

        A drive that has the law already keeps what the data do not determine. Any other takes the law as a whole, and
        what was not fitted of it as it was given for the fit.

        Raises
        ------
        FitError
            Pressure, direction or what else acts on sliding friction is not the same in drive and fit: the values hold
            with what acted when they were fitted.
        DescriptionError
            The mixture of fitted and kept values breaks a rule of the law.
        """
        own, theirs = self.model.friction, drive.friction
        sliding = [key for key in DEPENDENCES if key not in AT_REST]
        for key in sliding:
            there = getattr(theirs, key)
            if there is not None and there != getattr(own, key):
                raise FitError(
                    f"the drive's [friction.{key}] is not that with which the law was fitted",
                    rule="values hold with what acted on the law when they were fitted",
                    remedy=f"fit the drive's own friction (drive.friction), or take [friction.{key}] out of the drive",
                )
        tables: dict[str, Any] = {key: value for key in sliding if (value := getattr(own, key)) is not None}
        if (own.law, own.formula) != (theirs.law, theirs.formula):
            tables = {key: value for key, value in self.friction.to_dict().items() if key not in AT_REST}
        with_law = drive.replace({f"friction.{key}": value for key, value in tables.items()}) if tables else drive
        return apply_identified(self.identified(), with_law)

    def identified(self) -> Identified:
        """Return the determined parameters under their names in the drive file, with chance and what rows share."""
        names = {name: f"friction.{name}" for name in self.determined}
        ends = {n: whole_interval(self.parameters[n], self.intervals[n], self.systematic[n]) for n in names}
        recordings = tuple(str(name) for name in self.provenance.get("recordings", ()))
        return Identified(
            values={key: self.parameters[n] for n, key in names.items()},
            intervals={key: ends[n] for n, key in names.items()},
            sources=dict.fromkeys(names.values(), recordings),
            fit=hashlib.sha256(self._toml().encode()).hexdigest()[:HASH_DIGITS],
        )

    def to_toml(self, path: str | Path) -> None:
        """Write the fit with its law, covariance and provenance; :meth:`from_toml` reads it back."""
        with whole(Path(path)) as temporary:
            temporary.write_text(self._toml(), encoding="utf-8")

    def _toml(self) -> str:
        entries = {
            name: {
                "value": value,
                "unit": self._unit(name),
                "determined": name in self.determined,
            }
            | (
                {"interval": self.intervals[name], "u_systematic": self.systematic[name]}
                if name in self.intervals
                else {}
            )
            for name, value in self.parameters.items()
        }
        tables = {
            "schema": SCHEMA,
            "kind": KIND,
            "unseen": self.unseen,
            "parameters": entries,
            "covariance": {"names": list(self.parameters), "matrix": self.covariance.tolist()},
            "statistics": self.statistics,
            "provenance": self.provenance,
            "given": {"friction": self.model.friction.to_dict()},
        }
        head = "# Fit of any law. SI units; intervals are 95 %, statistical; [given] is what the search started from.\n"
        return head + toml.write(tables)

    @staticmethod
    def from_toml(path: str | Path) -> LawFit:
        """Read a fit that :meth:`to_toml` wrote.

        Raises
        ------
        FitError
            The file is not there, is no TOML, or lacks what such a fit needs.
        """
        from pneudrive.identify.any_law import AnyLaw

        content, _ = toml.read(path, FitError, "fit_any_law(...).to_toml writes one.")
        if content.get("kind") != KIND or content.get("schema") != SCHEMA:
            raise FitError("this is no fit of any law", where=str(path), rule=f'kind = "{KIND}", schema = {SCHEMA}')
        try:
            entries, matrix = content["parameters"], np.array(content["covariance"]["matrix"], dtype=float)
            names = tuple(content["covariance"]["names"])
            return LawFit(
                model=AnyLaw(Friction.model_validate(content["given"]["friction"]), names),
                parameters={n: float(entries[n]["value"]) for n in names},
                intervals={n: (e["interval"][0], e["interval"][1]) for n, e in entries.items() if "interval" in e},
                systematic={n: float(entries[n].get("u_systematic", 0.0)) for n in names},
                covariance=matrix.reshape(len(names), len(names)),
                undetermined=tuple(n for n in names if not entries[n]["determined"]),
                unseen=tuple(content["unseen"]),
                statistics={n: float(value) for n, value in content["statistics"].items()},
                provenance=dict(content["provenance"]),
            )
        except (KeyError, TypeError, ValueError, IndexError) as error:
            what = f"{type(error).__name__}: {error}"
            raise FitError("the file is no complete fit of a law", where=str(path), value=what) from error

    def _unit(self, name: str) -> str:
        return next(p["unit"] for p in self.model.friction.entry["parameters"] if p["key"] == name)

    def __str__(self) -> str:
        """Return a table of parameters with intervals, then what the data do not show."""
        s = self.statistics
        lines = [
            f"{self.model.friction.law} friction from {s['values']:.0f} values (rms {s['rms_n']:.3g} N, "
            f"residuals {s['scale']:.2g} times their standard errors, "
            f"{s['starts_agreeing']:.0f} of {s['starts']:.0f} starts agree)"
        ]
        width = max(map(len, self.parameters))
        for name, value in self.parameters.items():
            low, high = self.intervals.get(name, (np.nan, np.nan))
            said = f"95 %: {low:.4g} .. {high:.4g}" if name in self.intervals else "not determined"
            lines.append(f"  {name:<{width}} {value:11.4g} {self._unit(name):<8} {said}")
        if self.undetermined:
            lines.append(f"  ! not determined by these values: {', '.join(self.undetermined)}")
        if self.unseen:
            lines.append(f"  ! steady sliding does not show {', '.join(self.unseen)}; kept as given")
        return "\n".join(lines)

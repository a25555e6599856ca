"""Diagnosis of a model: causes that explain the residuals of the balances, with their sizes and uncertainties.

The residuals of the force balance and of both pressure rates are weighted with their standard deviations and stacked.
Each cause is fitted separately by least squares, and its amount is refined on the nonlinear equations (Gauss-Newton).
The cause that explains the most is added to the model, and the search continues with the remaining residual.

    explained fraction = 1 - |e(changed model)|^2 / |e(model)|^2

A search for values, such as `identify`, compensates an unmodelled effect by wrong values. The best causes are therefore
also fitted together with their companions, which are changes of the identified values. The joint fit is used if its
residual is much smaller.

Standard errors come from the scores of blocks of 0.25 s, because neighbouring samples are correlated.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from pneudrive.arrays import Array, Columns, Interval, NamedNumbers, Plain, Row, by_name
from pneudrive.constants import LEAK_CRITICAL_RATIO
from pneudrive.describe.drive import Drive
from pneudrive.errors import DescriptionError, SimulationError, package_table
from pneudrive.estimate.estimates import NORMAL_95
from pneudrive.numbers import plain, with_u
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.repr_tables import Shown
from pneudrive.units import readable, write
from pneudrive.validate.balance import BALANCES, RATES, Scene, Signals, at_samples, openings

# --- Possible causes of model errors. Each cause is a change to one quantity, with an effect on the balances.
#
# A cause changes the scene (drive, sensors, openings of the valve) by an amount, or adds a term to a residual. The
# column of a cause in the regression is the difference quotient of the residuals. causes.toml has units and texts.

Rows = dict[str, Row]
_TEXTS = package_table(__file__, "causes.toml")
#: Change of the scene by an amount; and drive-dependent arguments of `Cause`.
Change = Callable[[Scene, float], Scene]

#: Bounds of a critical pressure ratio.
RATIO = (0.01, 0.95)
#: Lag of the supply pressure behind the flow if a volume is between regulator and valve, s (assumed).
SLOW_SAG_S = 0.5
#: Number of polynomials for friction along the stroke, including the constant.
PROFILE_ORDERS = 5


@dataclass(frozen=True)
class Cause:
    """Possible cause of a model error.

    Attributes
    ----------
    key : str
        Short name, unique.
    words : str
        Text with ``{size}`` for the amount: "{size} Coulomb friction".
    unit : str
        Unit of the amount: an SI unit, or "share" for a fraction of the present value.
    step : float
        Amount for the difference quotient.
    least : float
        Smallest relevant amount.
    remedy : str
    change : callable or None
        (scene, amount) -> changed scene.
    ratio : callable or None
        Scene -> ratio of downstream to upstream pressure of a leak at each sample, and its critical pressure ratio.
    profile : callable or None
        Scene -> columns, for a cause with several coefficients.
    parts : int
        Number of coefficients. A cause with more coefficients explains more of the residual by chance.
    bounds : pair of float
        Smallest and largest amount that a description allows.
    described : bool
        Whether a drive file or the sensor data can describe the cause.
    free : sequence of str
        Values of the drive file that a new identification should fit to correct the error.
    """

    key: str
    words: str
    unit: str
    step: float
    least: float
    remedy: str
    change: Change | None = None
    ratio: Callable[[Scene], tuple[Array, float]] | None = None
    profile: Callable[[Scene], list[Array]] | None = None
    parts: int = 1
    bounds: Interval = (-np.inf, np.inf)
    described: bool = True
    free: Sequence[str] = ()


def causes(drive: Drive) -> list[Cause]:
    """Return all causes that can be tested for a drive."""
    cylinder, valve, load = drive.cylinder, drive.valve, drive.carried
    rows = _of_friction(drive)
    heavier = "load.mass" if load.mass_kg > cylinder.moving_mass_kg else "cylinder.moving_mass"
    rows |= {
        "moving mass": {"change": _drive(_mass), "free": (heavier,)},
        "constant force": {"change": _value("load.force", "N", lambda d, f: d.carried.force_n + f)},
        "spring": {"change": _drive(_spring), "bounds": (-load.spring.stiffness_n_m if load.spring else 0.0, np.inf)},
    }
    ratio, gauge = valve.critical_pressure_ratio, drive.supply_pressure_pa - drive.ambient.pressure_pa
    whole = _value("valve.conductance", "m^3/(s Pa)", lambda d, s: d.valve.conductance_m3_s_pa * (1.0 + s))
    rows |= {
        "conductance": {"change": whole},
        "conductance to exhaust": {"change": _edges(1, 3)},
        "conductance from supply": {"change": _edges(0, 2)},
        "conductance of a": {"change": _edges(0, 1)},
        "conductance of b": {"change": _edges(2, 3)},
        "critical pressure ratio": {"change": _drive(_ratio), "bounds": (RATIO[0] - ratio, RATIO[1] - ratio)},
        "valve delay": {"change": _command(_delayed)},
        "valve zero": {"change": _command(lambda u, zero, _: np.clip(u - zero, -1.0, 1.0))},
        "dead zone": {"change": _overlap, "bounds": (-(valve.overlap or 0.0), 0.9)},
        "supply pressure": {"change": _supply, "bounds": (-0.9 * gauge, np.inf)},
        "supply sag": {"change": _sag(0.0)},
        "slow supply sag": {"change": _sag(SLOW_SAG_S)},
    }
    stated = cylinder.leakage_m3_s_pa / valve.conductance_m3_s_pa
    name, unit = "cylinder.leakage", "m^3/(s Pa)"
    piston = _value(name, unit, lambda d, s: d.cylinder.leakage_m3_s_pa + s * d.valve.conductance_m3_s_pa)
    rows |= {
        "leak from a": {"change": _opened(np.add, 1), "ratio": _to_ambient(0)},
        "leak from b": {"change": _opened(np.add, 3), "ratio": _to_ambient(1)},
        "leak through the valve": {"change": _opened(np.add, 0, 2)},
        "leak past the piston": {"change": piston, "ratio": _past_piston, "bounds": (-stated, np.inf)},
    }
    for key, sides in (("dead volume of a", "a"), ("dead volume of b", "b"), ("dead volumes", "ab")):
        rows[key] = {"change": _dead_volume(sides)}
    key, field, unit = "cylinder.heat_transfer", "heat_transfer_w_m2_k", "W/(m^2 K)"
    if cylinder.heat_transfer_w_m2_k is None:
        key, field, unit = "cylinder.heat_transfer_scale", "heat_transfer_scale", ""
    if getattr(cylinder, field) > 0.0:
        change = _value(key, unit, lambda d, share: getattr(d.cylinder, field) * (1.0 + share))
        remedy = _TEXTS["heat transfer"]["remedy"].format(key=key)
        rows["heat transfer"] = {"change": change, "remedy": remedy, "free": (key,)}
    rows |= _SENSORS
    level, out = drive.friction.parameters.get("coulomb", 1.0), []
    for name, row in rows.items():
        entry = _TEXTS[name] | row
        if entry.pop("relative", False):
            entry.update({size: level * entry[size] for size in ("step", "least")})
        lists = {field: tuple(value) for field, value in entry.items() if isinstance(value, list)}
        out.append(Cause(key=name, **entry | lists))
    return out


def _value(key: str, si_unit: str, value: Callable[[Drive, float], float]) -> Change:
    """Return a change that sets one value of the description; `value` is a function (drive, amount) -> SI value."""
    return _drive(lambda drive, amount: {key: write(value(drive, amount), si_unit)})


def _drive(changes: Callable[[Drive, float], Plain]) -> Change:
    return lambda scene, amount: replace(scene, drive=scene.drive.replace(changes(scene.drive, amount)))


def _of_friction(drive: Drive) -> Rows:
    parameters, seals = drive.friction.parameters, drive.friction.pressure
    if "coulomb" not in parameters:
        return {}
    level, lips = parameters["coulomb"], 0.0 if seals is None else min(seals.coulomb_n_pa)
    rows: Rows = {
        "Coulomb friction": {"change": _drive(_friction_level), "bounds": (-level, np.inf)},
        "pressure-dependent friction": {"change": _drive(_pressure_friction), "bounds": (-lips, np.inf)},
        "direction of friction": {"change": _drive(_direction)},
        "friction along the stroke": {"profile": _along_stroke, "parts": PROFILE_ORDERS},
    }
    if "viscous" in parameters:
        change = _value("friction.viscous", "N s/m", lambda d, b: max(d.friction.parameters["viscous"] + b, 0.0))
        rows["viscous friction"] = {"change": change, "bounds": (-parameters["viscous"], np.inf)}
    if "breakaway" in parameters:
        bounds = (level - parameters["breakaway"], np.inf)
        rows["Stribeck friction"] = {"change": _value("friction.breakaway", "N", _breakaway), "bounds": bounds}
    return rows


def _friction_level(drive: Drive, amount: float) -> Plain:
    """Change Fc and Fs by the same amount."""
    known = drive.friction.parameters
    return {f"friction.{k}": write(max(known[k] + amount, 1e-6), "N") for k in ("coulomb", "breakaway") if k in known}


def _breakaway(drive: Drive, amount: float) -> float:
    known = drive.friction.parameters
    return max(known["breakaway"] + amount, known["coulomb"])


def _pressure_friction(drive: Drive, amount: float) -> Plain:
    """Change the slopes of Coulomb and breakaway force over the pressure of each chamber by an amount in N/Pa."""
    seals = drive.friction.pressure
    pairs = {}
    for name in ("coulomb", "breakaway"):
        old = getattr(seals, name) if seals is not None else (0.0, 0.0)
        pairs[name] = by_name("ab", (write(v + amount, "N/Pa") for v in old))
    return {"friction.pressure": pairs}


def _direction(drive: Drive, amount: float) -> Plain:
    """Increase the friction in motion towards +x, and decrease it in motion towards -x, by the fraction `amount`."""
    old = drive.friction.direction
    positive, negative = (1.0, 1.0) if old is None else (old.positive, old.negative)
    return {"friction.direction": {"positive": positive * (1.0 + amount), "negative": negative * (1.0 - amount)}}


def _along_stroke(scene: Scene) -> list[Array]:
    """Return the effects of friction along the stroke (Legendre polynomials) on the residuals, per N."""
    x, out = scene.position, []
    domain = [x.min(), x.max()]
    for order in range(PROFILE_ORDERS):
        shape = np.polynomial.legendre.Legendre.basis(order, domain=domain)(x)
        force = np.convolve(scene.signals.direction * shape, scene.kernel[0], "valid")
        out.append(np.stack([force, np.zeros_like(force), np.zeros_like(force)]))
    return out


def _mass(drive: Drive, share: float) -> Plain:
    """Change the masses of piston and load by the same fraction, so that both stay positive."""
    masses = {"cylinder.moving_mass": drive.cylinder.moving_mass_kg, "load.mass": drive.carried.mass_kg}
    return {key: write((1.0 + share) * mass, "kg") for key, mass in masses.items() if mass or key != "load.mass"}


def _spring(drive: Drive, amount: float) -> Plain:
    old = drive.carried.spring
    if old is not None:
        return {"load.spring.stiffness": write(old.stiffness_n_m + amount, "N/m")}
    middle = write(0.5 * drive.cylinder.stroke_m, "m")
    return {"load.spring": {"stiffness": write(amount, "N/m"), "rest_position": middle}}


def _ratio(drive: Drive, amount: float) -> Plain:
    return {"valve.critical_pressure_ratio": float(np.clip(drive.valve.critical_pressure_ratio + amount, *RATIO))}


_supply = _drive(lambda drive, amount: {"supply.pressure": f"{drive.supply_pressure_pa + amount!r} Pa abs"})


def _opened(how: Callable[[Array, Array], Array], *edges: int) -> Change:
    """Return a change that applies `how` to the openings of some valve edges.

    `how` is a function (openings, amount at each edge) -> openings.

    With `numpy.add`, it models a leak: each edge passes a further fraction of its full conductance.
    """

    def change(scene: Scene, amount: float) -> Scene:
        amounts = np.zeros(4)
        amounts[list(edges)] = amount
        return replace(scene, opened=how(scene.opened, amounts))

    return change


def _edges(*edges: int) -> Change:
    """Return a change that scales the conductance of some valve edges by 1 + amount."""
    return _opened(lambda opened, share: np.maximum(opened * (1.0 + share), 0.0), *edges)


def _command(how: Callable[[Array, float, float], Array]) -> Change:
    """Return a change of the valve's command; `how` is a function (command, amount, sampling step) -> command."""

    def change(scene: Scene, amount: float) -> Scene:
        return _reopened(scene, scene.drive, how(scene.signals.command, amount, scene.signals.step_s))

    return change


def _overlap(scene: Scene, amount: float) -> Scene:
    """Change the overlap of the valve's edges."""
    drive = scene.drive.replace({"valve.overlap": (scene.drive.valve.overlap or 0.0) + amount})
    return _reopened(scene, drive, scene.signals.command)


def _reopened(scene: Scene, drive: Drive, command: Array) -> Scene:
    """Return the scene with another drive and the changed openings of its valve under this command."""
    before = at_samples(openings(scene.drive, scene.signals.command))
    after = at_samples(openings(drive, command))
    return replace(scene, drive=drive, opened=np.maximum(scene.opened + after - before, 0.0))


def _delayed(command: Array, delay_s: float, step_s: float) -> Array:
    """Delay the command by a time that need not be a whole number of samples."""
    sample = np.arange(command.size)
    return np.interp(sample - delay_s / step_s, sample, command)


def _sag(lag_s: float) -> Change:
    """Return a change that lowers the supply pressure in proportion to the lagged flow, by at most the amount in Pa."""

    def change(scene: Scene, amount: float) -> Scene:
        step = 1e-3 * scene.drive.supply_pressure_pa
        before, after = scene.terms, _supply(scene, -step).terms
        drawn = np.maximum(before["mass_flow_a_kg_s"], 0.0) + np.maximum(before["mass_flow_b_kg_s"], 0.0)
        decay = np.exp(-scene.signals.step_s / lag_s) if lag_s else 0.0
        drawn = np.asarray(lfilter([1.0 - decay], [1.0, -decay], drawn))
        fall, k0 = amount * drawn / max(drawn.max(), 1e-30), scene.kernel[0]
        a, b = (np.convolve(fall * (after[rate] - before[rate]) / step, k0, "valid") for rate in RATES)
        return scene.less(np.stack([np.zeros_like(a), a, b]))

    return change


def _to_ambient(chamber: int) -> Callable[[Scene], tuple[Array, float]]:
    """Return a function: scene -> pressure ratio over a leak to the ambient air, and critical ratio of the leak."""
    return lambda scene: (
        scene.drive.ambient.pressure_pa / scene.pressures[chamber],
        scene.drive.valve.critical_pressure_ratio,
    )


def _past_piston(scene: Scene) -> tuple[Array, float]:
    """Return the pressure ratio of a leak past the piston, and the critical ratio of `cylinder.leakage`."""
    a, b = scene.pressures
    return np.minimum(a, b) / np.maximum(a, b), LEAK_CRITICAL_RATIO


def _dead_volume(sides: str) -> Change:
    def changes(drive: Drive, share: float) -> Plain:
        old = drive.cylinder.dead_volume_m3
        factor = {c: 1.0 + share if c in sides else 1.0 for c in "ab"}
        return {"cylinder.dead_volume": {c: write(getattr(old, c) * factor[c], "m^3", "cm3") for c in "ab"}}

    return _drive(changes)


def _sensor(position: float = 0.0, a: float = 0.0, b: float = 0.0) -> Change:
    """Return a change for sensors that read too high by an amount: the values are lowered by this amount."""

    def change(scene: Scene, amount: float) -> Scene:
        p_a, p_b = scene.pressures
        truth = (p_a - a * amount, p_b - b * amount)
        return replace(scene, position=scene.position - position * amount, pressures=truth)

    return change


def _gain(scene: Scene, share: float) -> Scene:
    a, b = scene.pressures
    return replace(scene, pressures=(a / (1.0 + share), b / (1.0 + share)))


_SENSORS: Rows = {
    "zero of pressure a": {"change": _sensor(a=1.0)},
    "zero of pressure b": {"change": _sensor(b=1.0)},
    "gain of the pressures": {"change": _gain},
    "zero of the position": {"change": _sensor(position=1.0)},
}


# --- Fit of the causes to the residuals.

BLOCK_S = 0.25
#: Largest normalised residual of a balance that closes within sensor noise and irrelevant errors.
CLEAN = 1.0
#: Normalised residual above which causes are tested. It is below 1, because an error common to many samples can be
#: found within the noise.
SOUGHT = 0.7
MOST_CULPRITS = 3
#: Smallest explained fraction of the residual for a cause, and smallest amount in standard errors.
LEAST_SHARE, LEAST_T = 0.15, 4.0
#: Number of causes whose linear fit is refined.
REFINED = 8
#: Ratio of squared residuals up to which a cause is indistinguishable from the best cause.
RIVAL = 2.0
NEWTON_STEPS = 3
#: Possible critical pressure ratios of a leak; smallest flow function by which the effect is divided.
LEAK_RATIOS, LEAST_FLOW = (0.0, 0.2, 0.4, 0.528), 0.05
#: Number of causes that are fitted together with compensating values.
JOINT = 4
#: Values that may compensate an unmodelled effect, if the drive does not state which values were identified.
COMPENSATING = frozenset({"valve.conductance", "friction.coulomb", "friction.viscous"})


@dataclass(frozen=True)
class Culprit:
    """Cause that explains part of the residuals.

    Attributes
    ----------
    cause : Cause
    amount : float
        Change of the model, in the unit of the cause.
    stderr : float
    share : float
        Fraction that this cause explains of the squared residual left by the previous causes.
    rivals : tuple of (str, float)
        Causes that the records cannot distinguish from this cause, each with its explained fraction.
    laws : tuple of float or None
        For a leak, lowest and highest amount over the flow laws that the recordings do not distinguish.
    moved : tuple of str
        Identified values that changed significantly when fitted together with the cause, as text.
    """

    cause: Cause
    amount: float
    stderr: float
    share: float
    rivals: tuple[tuple[str, float], ...]
    laws: Interval | None = None
    moved: tuple[str, ...] = ()

    @property
    def key(self) -> str:
        """Short name of the cause."""
        return self.cause.key

    @property
    def free(self) -> tuple[str, ...]:
        """Values of the drive file that a new identification should fit to correct the error."""
        return tuple(self.cause.free)

    @property
    def interval(self) -> Interval:
        """95 % interval of the amount; for a leak, over all flow laws that the recordings do not distinguish."""
        low, high = self.laws or (self.amount, self.amount)
        return low - NORMAL_95 * self.stderr, high + NORMAL_95 * self.stderr

    @property
    def text(self) -> str:
        """Finding as text: explained fraction, cause and size, indistinguishable causes, remedy."""
        cause = self.cause
        size = _in_words(cause, self.amount, self.stderr)
        text = f"{100.0 * self.share:.0f} % of the residual is explained by {size}"
        if self.laws is not None and self.laws[1] - self.laws[0] > self.stderr:
            low, high = (plain(_SAID[cause.unit][0] * end) for end in self.laws)
            text += f"; {low} to {high} % over the flow laws (b = 0 to 0.53) that the recordings cannot distinguish"
        if self.moved:
            text += f" together with values that differ from the identified ones: {', '.join(self.moved)}"
        if self.rivals:
            text += "; the recordings cannot distinguish this from " + ", ".join(
                f"{key} ({100 * s:.0f} %)" for key, s in self.rivals[:4]
            )
        limit = "" if cause.described else ". A drive file cannot describe this cause yet"
        return f"{text}{limit}. Remedy: {cause.remedy}."


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Shown):
    """Causes that explain the residuals of the balances.

    Attributes
    ----------
    size : dict
        Balance -> root mean square residual, relative to the standard deviation from noise and 1 % of the terms.
    culprits : tuple of Culprit
        Causes, the most important one first.
    left : float
        Fraction of the squared residual that no cause explains.
    """

    size: NamedNumbers
    culprits: tuple[Culprit, ...]
    left: float

    @property
    def is_clean(self) -> bool:
        """Whether the residuals are not larger than noise and the allowed model error."""
        return all(value <= CLEAN for value in self.size.values() if np.isfinite(value))

    def __str__(self) -> str:
        """Return the findings as text."""
        if self.is_clean and not self.culprits:
            return "the balances close: the residuals are sensor noise and less than 1 % of the terms"
        if not self.culprits:
            return "the balances do not close, but none of the known causes explains the residuals"
        lines = [c.text for c in self.culprits]
        if self.left > 0.3:
            lines.append(f"{100 * self.left:.0f} % of the residual remains without an explanation")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Fit of a cause, alone or with others. The tested cause is the last of `causes`.

    Attributes
    ----------
    causes : list of Cause
    amounts, columns : ndarray, shape (causes,), (causes, n)
        Amount of each cause, and effect of a unit of the cause on the stacked residual. The effect does not contain
        the part that the other causes can compensate.
    after, before : ndarray
        Stacked residual with these amounts, and without them.
    """

    causes: list[Cause]
    amounts: Array
    columns: Array
    after: Array
    before: Array

    @functools.cached_property
    def share(self) -> float:
        """Explained fraction of the squared residual."""
        return 1.0 - float(self.after @ self.after / (self.before @ self.before))

    @property
    def cause(self) -> Cause:
        """The tested cause."""
        return self.causes[-1]

    @property
    def amount(self) -> float:
        """Amount of the tested cause."""
        return float(self.amounts[-1])


class _Regression:
    """Stacked, weighted residuals of all recordings. Its methods fit causes to these residuals.

    Attributes
    ----------
    scenes : list of Scene
        Model under test: the drive with the causes found so far.
    left : ndarray
        Stacked residual of this model.
    """

    def __init__(self, drive: Drive, signals: Sequence[Signals], watch: Watch) -> None:
        self.drive, self.watch = drive, watch
        self.first = self.scenes = [Scene.of(drive, s) for s in signals]
        self.causes = {c.key: c for c in causes(drive)}
        #: Masks of the stacked values of each recording; block and balance of each stacked value.
        self.chosen, blocks, places, start = [], [], [], 0
        for scene in self.first:
            number = start + np.floor(scene.time_s / BLOCK_S).astype(np.int64)
            self.chosen.append(scene.used & (np.arange(number.size) % max(scene.half // 2, 1) == 0))
            balance, at = np.nonzero(self.chosen[-1])
            blocks.append(number[at])
            places.append(balance)
            start = int(number[-1]) + 1
        self.blocks, self.places = np.concatenate(blocks), np.concatenate(places)
        self.left = self.stacked(scene.residuals for scene in self.scenes)

    def stacked(self, values: Iterable[Array], *, weighted: bool = True) -> Array:
        """Return the values of all recordings and balances in one vector, relative to their standard deviations."""
        parts = zip(self.first, self.chosen, values, strict=True)
        return np.concatenate([(b / scene.scale if weighted else b)[chosen] for scene, chosen, b in parts])

    def changed(self, every: Sequence[Cause], amounts: Array | Sequence[float]) -> list[Scene]:
        """Return the model changed by these amounts of the causes."""
        scenes = self.scenes
        for cause, amount in zip(every, np.asarray(amounts).tolist(), strict=True):
            if amount:
                assert cause.change is not None
                scenes = [cause.change(scene, amount) for scene in scenes]
        return scenes

    def residual(self, every: Sequence[Cause], amounts: Array | Sequence[float]) -> Array | None:
        """Return the stacked residual with these amounts of causes; None if the changed drive or motion is invalid."""
        try:
            residual = self.stacked(scene.residuals for scene in self.changed(every, amounts))
        except (DescriptionError, SimulationError):
            return None
        return residual if np.isfinite(residual).all() else None

    def sizes(self, e: Array) -> NamedNumbers:
        """Return the root mean square of each balance; NaN for a balance without usable samples."""
        sums = np.bincount(self.places, weights=e * e, minlength=len(BALANCES))
        counts = np.bincount(self.places, minlength=len(BALANCES))
        with np.errstate(invalid="ignore"):
            return by_name(BALANCES, np.sqrt(sums / counts).tolist())

    def is_dirty(self, e: Array) -> bool:
        """Return whether a residual is so large that its causes must be found."""
        return any(value > SOUGHT for value in self.sizes(e).values())

    def stderr(self, fit: _Fit) -> float:
        """Estimate the standard error of an amount with scores summed over blocks."""
        column = fit.columns[-1]
        score, power = np.bincount(self.blocks, weights=column * fit.after), float(column @ column)
        if power == 0.0:
            return np.inf
        blocks = max(int(np.unique(self.blocks).size), 2)
        return max(np.sqrt(score @ score * blocks / (blocks - 1)) / power, 1.0 / np.sqrt(power))

    def is_shown(self, fit: _Fit) -> bool:
        """Return whether a cause is relevant and significant.

        If the residual of a balance is clearly too large, any amount is relevant.
        """
        is_open = any(value > CLEAN for value in self.sizes(self.left).values())
        worth = is_open or abs(fit.amount) >= fit.cause.least
        return worth and fit.share >= LEAST_SHARE and abs(fit.amount) >= LEAST_T * self.stderr(fit)

    def is_rival(self, fit: _Fit, best: _Fit) -> bool:
        """Return whether a cause leaves only noise, or a residual close to that of the best cause."""
        return 1.0 - fit.share <= RIVAL * (1.0 - best.share) or not self.is_dirty(fit.after)

    def fits(self, skipped: set[str], number: int) -> list[_Fit]:
        """Fit each cause alone, then the best causes with their companions. Return the fits, best first."""
        wanted = [cause for key, cause in self.causes.items() if key not in skipped]
        columns, linear = {}, []  # linear effect of a unit of each cause that has an effect on the residual
        for cause in self.watch.each(list(self.causes.values()), f"causes tested after {number} found"):
            after = None if cause.profile is not None else self.residual([cause], [cause.step])
            if after is not None and (after != self.left).any():
                columns[cause.key] = (self.left - after) / cause.step
        for cause in wanted:
            if cause.profile is not None:
                linear += self.profile(cause)
            elif cause.key in columns:
                column = columns[cause.key]
                amount = float(np.clip((column @ self.left) / (column @ column), *cause.bounds))
                linear.append(_Fit([cause], np.array([amount]), column[None], self.left - amount * column, self.left))
        linear.sort(key=lambda fit: -fit.share)
        refined = [fit if fit.cause.profile else self.newton(fit.causes, fit.amounts) for fit in linear[:REFINED]]
        refined = sorted([*refined, *linear[REFINED:]], key=lambda fit: -fit.share)
        # Among indistinguishable causes, the one with the fewest coefficients comes first.
        rivals = [fit for fit in refined if self.is_rival(fit, refined[0])]
        others = [fit for fit in refined if fit not in rivals]
        alone = sorted(rivals, key=lambda fit: (fit.cause.parts, -fit.share)) + others
        joint = self.together(alone[0].share, wanted, columns) if alone and self.is_dirty(alone[0].after) else []
        return [*joint, *alone]

    def together(self, share: float, wanted: list[Cause], columns: Columns) -> list[_Fit]:
        """Fit the best causes, each with its companions: the causes that change identified (or `COMPENSATING`) values.

        Return only fits with a much smaller residual than the fit of any single cause, and than the fit of the
        companions alone. A wrong identified value is therefore not mistaken for another cause.
        """
        values = frozenset(self.scenes[0].drive.provenance) or COMPENSATING
        companions = [c for c in self.causes.values() if c.free and values.issuperset(c.free)]
        if not companions:
            return []
        rests = []
        for cause in wanted:
            if cause.key in columns and cause not in companions:
                matrix = np.column_stack(
                    [*(columns[c.key] for c in companions if c.key in columns), columns[cause.key]]
                )
                matrix = matrix / np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
                rest = self.left - matrix @ np.linalg.lstsq(matrix, self.left, rcond=None)[0]
                rests.append((rest @ rest, cause))
        best = [cause for _, cause in sorted(rests, key=lambda pair: pair[0])[:JOINT]]
        tested = self.watch.each(best, "causes tested with fitted values")
        fits = [self.newton([*companions, cause], np.zeros(len(companions) + 1)) for cause in tested]
        companion = self.newton([*companions[1:], companions[0]], np.zeros(len(companions)))
        least = 1.0 - max(share, companion.share)
        fits = sorted((fit for fit in fits if RIVAL * (1.0 - fit.share) < least), key=lambda fit: -fit.share)
        return [fit for fit in fits if self.is_shown(fit)]

    def newton(self, every: list[Cause], amounts: Array) -> _Fit:
        """Refine the amounts of causes by Gauss-Newton. A cause that makes the description invalid explains nothing."""
        best = _Fit(every, 0.0 * amounts, np.zeros((len(every), 1)), self.left, self.left)
        low, high = np.array([cause.bounds for cause in every]).T
        for _ in range(NEWTON_STEPS + (not amounts.any())):
            here, columns = self.residual(every, amounts), []
            for cause, step in zip(every, np.diag([0.1 * cause.step for cause in every]), strict=True):
                ahead = self.residual(every, amounts + step)
                columns += [] if here is None or ahead is None else [(here - ahead) / (0.1 * cause.step)]
            if here is None or len(columns) < len(every):
                amounts = 0.5 * amounts
                continue
            matrix = np.column_stack(columns)
            size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
            if best.after is self.left or here @ here < best.after @ best.after:
                # The pseudo-inverse's rows are the columns without the part that the others can replace.
                rows = np.linalg.pinv(matrix / size, rcond=1e-6) / size[:, None]
                rows = rows / np.maximum(np.sum(rows**2, axis=1), 1e-300)[:, None]
                best = _Fit(every, amounts, rows, here, self.left)
            change = np.linalg.lstsq(matrix / size, here, rcond=1e-6)[0] / size
            amounts = np.clip(amounts + change, low, high)
        return best

    def profile(self, cause: Cause) -> list[_Fit]:
        """Fit a cause with several columns. Its amount is half the range of the fitted profile over the travel."""
        profile = cause.profile
        assert profile is not None
        shapes = [profile(scene) for scene in self.scenes]  # columns of each recording
        columns = np.column_stack([self.stacked(own[k] for own in shapes) for k in range(cause.parts)])
        weights = np.linalg.lstsq(columns, self.left, rcond=None)[0]
        over_stroke = np.polynomial.legendre.legval(np.linspace(-1.0, 1.0, 101), weights)
        amount = 0.5 * float(np.ptp(over_stroke))
        if amount == 0.0:
            return []
        effect = columns @ weights

        def change(scene: Scene, size: float) -> Scene:
            terms = (size / amount * w * v for w, v in zip(weights, profile(scene), strict=True))
            return functools.reduce(Scene.less, terms, scene)

        fitted = replace(cause, change=change)
        return [_Fit([fitted], np.array([amount]), effect[None] / amount, self.left - effect, self.left)]

    def companion(self, fit: _Fit, k: int) -> _Fit:
        """Return the fit of the k-th companion of a cause, with the fraction of the residual that it explains."""
        others = [at for at in range(len(fit.causes)) if at != k]
        without = self.residual([fit.causes[at] for at in others], fit.amounts[others])
        before = fit.after if without is None else without
        return _Fit([fit.causes[k]], fit.amounts[[k]], fit.columns[[k]], fit.after, before)

    def culprit(self, fit: _Fit, others: Sequence[_Fit] = ()) -> Culprit:
        """Return a cause with its uncertainty and its rivals."""
        rivals = (o for o in others[:REFINED] if o.cause.key != fit.cause.key and self.is_rival(o, fit))
        moved = [self.companion(fit, k) for k in range(len(fit.causes) - 1)] if self.drive.provenance else []
        return Culprit(
            fit.cause,
            fit.amount,
            self.stderr(fit),
            fit.share,
            tuple((o.cause.key, o.share) for o in rivals),
            self.over_flow_laws(fit),
            tuple(_in_words(o.cause, o.amount) for o in moved if abs(o.amount) >= LEAST_T * self.stderr(o)),
        )

    def over_flow_laws(self, fit: _Fit) -> Interval | None:
        """Return the range of amounts of a leak over its possible critical pressure ratios; None for other causes.

        The shape of a leak is unknown. Its critical ratio is 0 for a narrow gap and 0.53 for a nozzle [iso6358-2013].
        For each critical ratio, the effect of the leak is rescaled at each sample. The range covers all critical ratios
        with a residual close to the smallest.
        """
        if fit.cause.ratio is None:
            return None
        effect, amounts, sizes = fit.columns[-1], [], []
        target = fit.after + fit.amount * effect
        for critical in LEAK_RATIOS:
            factors = []
            for scene in self.first:
                ratio, usual = fit.cause.ratio(scene)
                inside = ratio[scene.half : ratio.size - scene.half]
                factors.append(np.stack([_flow(inside, critical) / np.maximum(_flow(inside, usual), LEAST_FLOW)] * 3))
            column = effect * self.stacked(factors, weighted=False)
            amounts.append(float(column @ target / (column @ column)))
            rest = target - amounts[-1] * column
            sizes.append(rest @ rest)
        best = min(sizes)
        every = [a for a, size in zip(amounts, sizes, strict=True) if size <= RIVAL * best] + [fit.amount]
        return min(every), max(every)


def diagnose(
    drive: Drive,
    signals: Sequence[Signals],
    *,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> Diagnosis:
    """Find the causes that explain the residuals of the balances.

    Parameters
    ----------
    drive : Drive
        Model to test.
    signals : sequence of Signals
        Signals of recordings.
    progress, cancel : optional
        See `pneudrive.progress.Watch`.

    Returns
    -------
    Diagnosis
    """
    model = _Regression(drive, signals, Watch(progress, cancel))
    first, culprits = model.left, []
    is_told = drive.valve.time_on_s is None  # the balances know no armature on its way
    while is_told and len(culprits) < MOST_CULPRITS and model.is_dirty(model.left):
        fits = model.fits({c.key for c in culprits}, len(culprits))
        # Only the cause that explains most counts, because weaker ones are not evidence.
        if not fits or not model.is_shown(fits[0]):
            break
        culprits.append(model.culprit(fits[0], fits))
        if not drive.provenance:  # a companion that no fit has moved may be a cause of its own
            own = (model.companion(fits[0], k) for k in range(len(fits[0].causes) - 1))
            culprits += [model.culprit(fit) for fit in own if model.is_shown(fit)]
        model.scenes = model.changed(fits[0].causes, fits[0].amounts)
        model.left = model.stacked(scene.residuals for scene in model.scenes)
    remains = float(model.left @ model.left / (first @ first)) if first.any() else 0.0
    return Diagnosis(model.sizes(first), tuple(culprits), remains)


def _flow(ratio: Array, critical: float) -> Array:
    """Return the flow function of ISO 6358 with a subsonic index of 0.5."""
    beyond = np.clip((ratio - critical) / (1.0 - critical), 0.0, 1.0)
    return np.sqrt(1.0 - beyond**2)


#: Unit of an amount -> factor and unit in texts, if they differ from the common unit.
_SAID = {"s": (1e3, "ms"), "share of C": (100.0, "%"), "share": (100.0, "%")}


def _in_words(cause: Cause, amount: float, stderr: float | None = None) -> str:
    """Return a cause with its amount as text, including the uncertainty if the standard error is known."""
    size, unit = readable(cause.unit)
    factor, unit = _SAID.get(cause.unit, (1.0 / size, unit))
    compared = cause.words.startswith("{size} ")
    value = factor * (abs(amount) if compared else amount)
    shown = f"{plain(value)} {unit}".rstrip() if stderr is None else with_u(value, factor * NORMAL_95 * stderr, unit)
    if compared:
        shown += " more" if amount > 0.0 else " less"
    return cause.words.format(size=shown)

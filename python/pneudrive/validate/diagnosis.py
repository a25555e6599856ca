"""Diagnosis of a model: causes that explain the residuals of the balances, each with size and uncertainty.

The residuals of the force balance and of both pressure rates are weighted with their standard deviations and stacked.
Each cause is fitted separately by least squares, and its amount is refined on the nonlinear equations (Gauss-Newton).
The cause that explains most is added to the model, and the search continues with the remaining residual.

    share explained = 1 - |e(changed model)|^2 / |e(model)|^2

A search for values, such as `identify`, compensates an unmodelled effect by wrong values. A cause that explains little
is therefore also fitted together with these values. The joint fit is used if its residual is much smaller.

Standard errors come from the scores of blocks of 0.25 s, as neighbouring samples are correlated.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import DescriptionError, SimulationError
from pneudrive.estimate.estimates import NORMAL_95
from pneudrive.numbers import plain, with_u
from pneudrive.progress import Watch
from pneudrive.repr_tables import Shown
from pneudrive.units import readable
from pneudrive.validate.balance import Scene, Values, half_support
from pneudrive.validate.causes import Cause, causes
from pneudrive.validate.residuals import BALANCES, Residuals, residuals

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.progress import Flag
    from pneudrive.validate.signals import Signals

    Array = NDArray[np.float64]

BLOCK_S = 0.25
#: Normalised residual below which a balance closes: sensor noise and irrelevant errors.
CLEAN = 1.0
#: Normalised residual above which causes are tested: an error common to many samples is found within the noise.
SOUGHT = 0.7
MOST_CULPRITS = 3
#: Least explained share of the residual for a cause, and least number of standard errors.
LEAST_SHARE, LEAST_T = 0.15, 4.0
#: Number of causes whose linear fit is refined.
REFINED = 8
#: A cause is indistinguishable from the best one if its squared residual is within this factor.
RIVAL = 2.0
NEWTON_STEPS = 3
#: Critical pressure ratios that a leak may have; least flow function by which the effect of a leak is divided.
LEAK_RATIOS, LEAST_FLOW = (0.0, 0.2, 0.4, 0.528), 0.05
#: Causes that are fitted together with their companions.
JOINT = 4
#: Values that compensate an unmodelled effect, if the drive does not say which of its values were identified.
COMPENSATING = frozenset({"valve.conductance", "friction.coulomb", "friction.viscous"})


@dataclass(frozen=True)
class Culprit:
    """Cause that explains part of the residuals.

    Attributes
    ----------
    key, family, unit, remedy : str
        See `Cause`.
    amount : float
        Change of the model, in `unit`.
    stderr : float
    share : float
        Explained fraction of the squared residual before this cause.
    balances : dict
        Balance -> fraction of its squared residual.
    rivals : tuple of (str, float)
        Causes that explain nearly as much, with their fraction: the records cannot distinguish them.
    text : str
        Sentence for people.
    free : tuple of str
        Values of the drive file to identify for it.
    laws : tuple of float
        Lowest and highest amount over the flow laws of a leak that the recordings do not distinguish.
    """

    key: str
    family: str
    unit: str
    remedy: str
    amount: float
    stderr: float
    share: float
    balances: dict[str, float]
    rivals: tuple[tuple[str, float], ...]
    text: str
    free: tuple[str, ...] = ()
    laws: tuple[float, float] | None = None

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the amount; of a leak, over all flow laws that the recordings do not distinguish."""
        low, high = self.laws or (self.amount, self.amount)
        return low - NORMAL_95 * self.stderr, high + NORMAL_95 * self.stderr


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Shown):
    """Causes that explain the residuals of the balances.

    Attributes
    ----------
    size : dict
        Balance -> root mean square residual, relative to sensor noise and 1 % of the terms.
    culprits : tuple of Culprit
        Causes, the most important one first.
    left : float
        Share of the squared residual that no cause explains.
    alone : tuple of (str, float, float)
        Every single cause: key, amount, explained fraction (linear), best first.
    residuals : tuple of Residuals
        Residuals of each recording.
    """

    size: dict[str, float]
    culprits: tuple[Culprit, ...]
    left: float
    alone: tuple[tuple[str, float, float], ...]
    residuals: tuple[Residuals, ...] = field(repr=False)

    @property
    def is_clean(self) -> bool:
        """Whether the residuals are not larger than noise and the allowed model error."""
        return all(value <= CLEAN for value in self.size.values() if np.isfinite(value))

    def __str__(self) -> str:
        """Return the findings in words."""
        if self.is_clean and not self.culprits:
            return "the balances close: the residuals are sensor noise and less than 1 % of the terms"
        if not self.culprits:
            return "the balances do not close, but none of the known causes explains the residuals"
        lines = [c.text for c in self.culprits]
        if self.left > 0.3:
            lines.append(f"{100 * self.left:.0f} % of the residual remains without an explanation")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class _Model:
    """Model under test: the scenes of the recordings, and extra terms subtracted from the residuals."""

    scenes: list[Scene]
    taken: Array | float


class _Search:
    """Weighted, stacked residuals of several recordings, and effects of causes on them."""

    def __init__(self, drive: Drive, signals: Sequence[Signals]) -> None:
        self.drive, self.signals = drive, list(signals)
        self.found = [residuals(drive, s) for s in signals]
        self.stride = [max(half_support(s) // 2, 1) for s in signals]
        self.causes = {c.key: c for c in causes(drive)}
        blocks, places, first = [], [], 0
        for found, stride in zip(self.found, self.stride, strict=True):
            number = first + np.floor(found.time_s / BLOCK_S).astype(np.int64)
            for balance, used in enumerate(found.used):
                blocks.append(number[::stride][used[::stride]])
                places.append(np.full(blocks[-1].size, balance))
            first = int(number[-1]) + 1
        #: Block and balance of each stacked value.
        self.blocks, self.places = np.concatenate(blocks), np.concatenate(places)

    def stacked(self, values: Sequence[Values], *, weighted: bool = True) -> Array:
        """Return the values of all recordings and balances in one vector, relative to their standard deviations."""
        out = []
        for found, stride, own in zip(self.found, self.stride, values, strict=True):
            for v, scale, used in zip(own, found.scale, found.used, strict=True):
                out.append((v / scale if weighted else v)[::stride][used[::stride]])
        return np.concatenate(out)

    def left(self, model: _Model) -> Array:
        """Return the stacked residual of a model."""
        return self.stacked([scene.residuals for scene in model.scenes]) - model.taken

    def effect(self, model: _Model, cause: Cause, amount: float) -> Array | None:
        """Return the reduction of the stacked residual by a cause; None if the changed drive or motion is invalid."""
        try:
            effect = self.stacked([cause.effect(scene, amount) for scene in model.scenes])
        except (DescriptionError, SimulationError):
            return None
        return effect if np.isfinite(effect).all() else None

    def with_cause(self, model: _Model, r: _Refined) -> _Model:
        """Return the model with an added cause, and the causes that were fitted together with this cause."""
        for cause, amount, _ in r.others:
            model = self.changed(model, cause, amount)
        if r.cause.change is None:
            return _Model(model.scenes, model.taken + r.amount * r.column)
        return self.changed(model, r.cause, r.amount)

    @staticmethod
    def changed(model: _Model, cause: Cause, amount: float) -> _Model:
        """Return the model changed by an amount of a cause."""
        assert cause.change is not None
        return _Model([cause.change(scene, amount) for scene in model.scenes], model.taken)

    def squares(self, e: Array) -> dict[str, float]:
        """Return the sum of squares of each balance."""
        sums = np.bincount(self.places, weights=e * e, minlength=len(BALANCES))
        return dict(zip(BALANCES, sums.tolist(), strict=True))

    def sizes(self, e: Array) -> dict[str, float]:
        """Return the root mean square of each balance; NaN for a balance without usable samples."""
        counts = np.bincount(self.places, minlength=len(BALANCES))
        return {
            b: float(np.sqrt(total / n)) if n else np.nan
            for (b, total), n in zip(self.squares(e).items(), counts, strict=True)
        }

    def stderr(self, column: Array, left: Array) -> float:
        """Estimate the standard error of an amount with scores summed over blocks."""
        score = np.bincount(self.blocks, weights=column * left)
        power = float(column @ column)
        if power == 0.0:
            return np.inf
        blocks = max(int(np.unique(self.blocks).size), 2)
        return max(float(np.sqrt(score @ score * blocks / (blocks - 1))) / power, 1.0 / float(np.sqrt(power)))


@dataclass(frozen=True, eq=False)
class _Refined:
    """Fitted cause: amount, explained fraction, regression column, remaining residual, and values fitted together."""

    cause: Cause
    amount: float
    share: float
    column: Array
    after: Array
    others: tuple[tuple[Cause, float, Array], ...] = ()

    @classmethod
    def of(cls, cause: Cause, amount: float, column: Array, left: Array, effect: Array | None = None) -> _Refined:
        """Subtract a cause from a residual: its effect if given, otherwise its column times the amount."""
        after = left - (amount * column if effect is None else effect)
        return cls(cause, amount, 1.0 - float(after @ after) / float(left @ left), column, after)


def diagnose(
    drive: Drive,
    signals: Sequence[Signals],
    *,
    progress: Callable[[float, float, str], None] | None = None,
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
    watch = Watch(progress, cancel)
    search = _Search(drive, signals)
    model = _Model([Scene.of(drive, s) for s in search.signals], 0.0)
    first = left = search.left(model)
    culprits: list[Culprit] = []
    alone: tuple[tuple[str, float, float], ...] = ()
    while len(culprits) < MOST_CULPRITS and _is_dirty(search, left):
        taken = {c.key for c in culprits}
        refined = _refined(search, model, left, taken, watch)
        alone = alone or tuple((r.cause.key, r.amount, r.share) for r in refined)
        if refined and _is_dirty(search, refined[0].after):
            refined = _with_companions(search, model, left, taken, watch, refined)
        # Only the cause that explains most counts, because weaker ones are not evidence.
        if not refined or not _is_shown(search, found := refined[0], left):
            break
        culprits.append(_culprit(search, found, refined, left, is_identified=bool(drive.provenance)))
        if not drive.provenance:  # a companion that no fit has moved may be a cause of its own
            own = (_alone(search, model, found, k) for k in range(len(found.others)))
            culprits += [_culprit(search, r, [], left) for r in own if _is_shown(search, r, left)]
        model = search.with_cause(model, found)
        left = search.left(model)
    remains = float(left @ left) / float(first @ first) if first.size and first.any() else 0.0
    return Diagnosis(search.sizes(first), tuple(culprits), remains, alone, tuple(search.found))


def _is_dirty(search: _Search, e: Array) -> bool:
    return any(value > SOUGHT for value in search.sizes(e).values())


def _refined(search: _Search, model: _Model, left: Array, taken: set[str], watch: Watch) -> list[_Refined]:
    """Fit each cause separately, and refine the best on the equations. The best comes first."""
    wanted = [cause for key, cause in search.causes.items() if key not in taken]
    linear = []
    for cause in watch.each(wanted, f"causes tested after {len(taken)} found"):
        found = (_linear if cause.profile is None else _profile)(search, model, left, cause)
        linear += [found] if found is not None else []
    linear.sort(key=lambda r: -r.share)
    refined = [r if r.cause.change is None else _newton(search, model, left, r) for r in linear[:REFINED]]
    refined = sorted([*refined, *linear[REFINED:]], key=lambda r: -r.share)
    # Among indistinguishable causes, the one with the fewest coefficients comes first.
    rivals = [r for r in refined if _is_rival(search, r, refined[0])]
    return sorted(rivals, key=lambda r: (r.cause.parts, -r.share)) + [r for r in refined if r not in rivals]


def _with_companions(
    search: _Search, model: _Model, left: Array, taken: set[str], watch: Watch, alone: list[_Refined]
) -> list[_Refined]:
    """Fit each cause together with values that compensate it.

    Return these fits if one of them leaves a much smaller residual than any single cause.

    A fit of the companions without the cause is also considered. A wrong value is then not mistaken for another cause.
    """
    drive = model.scenes[0].drive
    values = frozenset(drive.provenance) or COMPENSATING
    companions = [c for c in search.causes.values() if c.free and values.issuperset(c.free) and c.change]
    if not companions:
        return alone
    fits = []
    wanted = [c for key, c in search.causes.items() if key not in taken and c.change and c not in companions]
    for cause in watch.each(_most_joint(search, model, left, wanted, companions), "causes tested with fitted values"):
        fit = _together(search, model, left, cause, companions)
        fits += [fit] if fit is not None else []
    base = _together(search, model, left, companions[0], companions[1:])
    least = 1.0 - max(alone[0].share, 0.0 if base is None else base.share)
    fits = sorted((fit for fit in fits if RIVAL * (1.0 - fit.share) < least), key=lambda fit: -fit.share)
    shown = [fit for fit in fits if _is_shown(search, fit, left)]
    return [*shown, *alone] if shown else alone


def _most_joint(
    search: _Search, model: _Model, left: Array, wanted: list[Cause], companions: list[Cause]
) -> list[Cause]:
    """Return the causes that explain most together with their companions, in the linear fit."""
    base = [column for c in companions if (column := search.effect(model, c, c.step)) is not None]
    rests = []
    for cause in wanted:
        column = search.effect(model, cause, cause.step)
        if column is not None and column.any():
            matrix = np.column_stack([*base, column])
            matrix = matrix / np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
            rest = left - matrix @ np.linalg.lstsq(matrix, left, rcond=None)[0]
            rests.append((float(rest @ rest), cause))
    return [cause for _, cause in sorted(rests, key=lambda one: one[0])[:JOINT]]


def _together(search: _Search, model: _Model, left: Array, cause: Cause, companions: list[Cause]) -> _Refined | None:
    """Fit the amounts of a cause and of its companions by Gauss-Newton; None if the changed drive is invalid."""
    every = [*companions, cause]
    amounts, best = np.zeros(len(every)), None
    for _ in range(NEWTON_STEPS + 1):
        here = _residual_with(search, model, every, amounts)
        if here is None:
            return best
        columns = []
        for k, one in enumerate(every):
            step = 0.1 * one.step * np.eye(len(every))[k]
            beside = _residual_with(search, model, every, amounts + step)
            if beside is None:
                return best
            columns.append((here - beside) / step[k])
        matrix = np.column_stack(columns)
        size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
        share = 1.0 - float(here @ here) / float(left @ left)
        if best is None or share > best.share:
            # The pseudo-inverse's rows are the columns without the part that the others can replace.
            own = np.linalg.pinv(matrix / size, rcond=1e-6) / size[:, None]
            own = own / np.maximum(np.sum(own**2, axis=1), 1e-300)[:, None]
            rest = tuple(zip(companions, amounts[:-1].tolist(), own[:-1], strict=True))
            best = _Refined(cause, float(amounts[-1]), share, own[-1], here, rest)
        change = np.linalg.lstsq(matrix / size, here, rcond=1e-6)[0] / size
        low, high = np.array([one.bounds for one in every]).T
        amounts = np.clip(amounts + change, low, high)
    return best


def _alone(search: _Search, model: _Model, r: _Refined, k: int) -> _Refined:
    """Return the k-th companion of a cause as a separate cause, with its part of the residual."""
    cause, amount, column = r.others[k]
    every = [(other, size) for other, size, _ in (*r.others[:k], *r.others[k + 1 :])] + [(r.cause, r.amount)]
    without = _residual_with(search, model, *map(list, zip(*every, strict=True)))
    left = r.after if without is None else without
    return _Refined(cause, amount, 1.0 - float(r.after @ r.after) / float(left @ left), column, r.after)


def _residual_with(search: _Search, model: _Model, every: list[Cause], amounts: Array | list[float]) -> Array | None:
    """Return the stacked residual with amounts of several causes; None if the changed drive or motion is invalid."""
    try:
        for cause, amount in zip(every, np.asarray(amounts).tolist(), strict=True):
            model = search.changed(model, cause, amount) if amount else model
        residual = search.left(model)
    except (DescriptionError, SimulationError):
        return None
    return residual if np.isfinite(residual).all() else None


def _linear(search: _Search, model: _Model, left: Array, cause: Cause) -> _Refined | None:
    """Fit the amount of a cause by its linearised effect."""
    effect = search.effect(model, cause, cause.step)
    if effect is None or not effect.any():
        return None
    column = effect / cause.step
    amount = float(np.clip(float(column @ left) / float(column @ column), *cause.bounds))
    return _Refined.of(cause, amount, column, left)


def _is_rival(search: _Search, r: _Refined, best: _Refined) -> bool:
    """Return whether a cause leaves only noise, or a residual close to that of the best cause."""
    return 1.0 - r.share <= RIVAL * (1.0 - best.share) or not _is_dirty(search, r.after)


def _profile(search: _Search, model: _Model, left: Array, cause: Cause) -> _Refined | None:
    """Fit a cause of several columns; its amount is the amplitude over the travelled range."""
    assert cause.profile is not None
    each = [cause.profile(scene) for scene in model.scenes]  # columns of each recording
    columns = np.column_stack([search.stacked([own[k] for own in each]) for k in range(cause.parts)])
    weights = np.linalg.lstsq(columns, left, rcond=None)[0]
    over_stroke = np.polynomial.legendre.legval(np.linspace(-1.0, 1.0, 101), weights)
    amount = 0.5 * float(np.ptp(over_stroke))
    if amount == 0.0:
        return None
    effect = columns @ weights
    return _Refined.of(cause, amount, effect / amount, left, effect)


def _newton(search: _Search, model: _Model, left: Array, start: _Refined) -> _Refined:
    """Refine one amount by Gauss-Newton from its linear value; an invalid description explains nothing."""
    cause, amount = start.cause, start.amount
    best: _Refined | None = None
    for _ in range(NEWTON_STEPS):
        here = search.effect(model, cause, amount)
        beside = search.effect(model, cause, amount + 0.1 * cause.step)
        if here is None or beside is None:
            amount *= 0.5
            continue
        found = _Refined.of(cause, amount, (beside - here) / (0.1 * cause.step), left, here)
        if best is None or found.share > best.share:
            best = found
        power = float(found.column @ found.column)
        if power == 0.0:
            break
        amount = float(np.clip(amount + float(found.column @ found.after) / power, *cause.bounds))
    return best or _Refined(cause, 0.0, 0.0, start.column, left)


def _is_shown(search: _Search, r: _Refined, left: Array) -> bool:
    """Return whether a cause is relevant and significant; if balances clearly do not close, any amount is relevant."""
    worth = abs(r.amount) >= r.cause.least or any(value > CLEAN for value in search.sizes(left).values())
    return worth and r.share >= LEAST_SHARE and abs(r.amount) >= LEAST_T * search.stderr(r.column, r.after)


def _culprit(
    search: _Search, r: _Refined, others: list[_Refined], left: Array, *, is_identified: bool = False
) -> Culprit:
    cause, stderr = r.cause, search.stderr(r.column, r.after)
    alike = (o for o in others[:REFINED] if o.cause.key != r.cause.key and _is_rival(search, o, r))
    rivals = tuple((o.cause.key, o.share) for o in alike)
    was, now, whole = search.squares(left), search.squares(r.after), float(left @ left)
    balances = {b: 1.0 - now[b] / was[b] for b in BALANCES if was[b] > 0.02 * whole}
    said = (cause.key, cause.family, cause.unit, cause.remedy)
    laws = _over_flow_laws(search, r)
    text = _in_words(r, stderr, rivals, laws, is_identified=is_identified)
    return Culprit(*said, r.amount, stderr, r.share, balances, rivals, text, cause.free, laws)


def _over_flow_laws(search: _Search, r: _Refined) -> tuple[float, float] | None:
    """Return the lowest and the highest amount of a leak over its possible critical pressure ratios; None for others.

    The shape of a leak is not known: the ratio is 0 for a narrow gap and 0.53 for a nozzle [iso6358-2013]. The effect
    of the leak is scaled at each sample by the flow of the other law. A law counts if its residual is close to the
    best.
    """
    if r.cause.ratio is None:
        return None
    amounts, sizes, target = [], [], r.after + r.amount * r.column
    for critical in LEAK_RATIOS:
        each = []
        for signals in search.signals:
            scene = Scene.of(search.drive, signals)
            ratio, usual = r.cause.ratio(scene)
            half = half_support(signals)
            inside = ratio[half : ratio.size - half]
            each.append((_flow(inside, critical) / np.maximum(_flow(inside, usual), LEAST_FLOW),) * len(BALANCES))
        column = r.column * search.stacked(each, weighted=False)
        amounts.append(float(column @ target) / float(column @ column))
        rest = target - amounts[-1] * column
        sizes.append(float(rest @ rest))
    best = min(sizes)
    fits = [a for a, size in zip(amounts, sizes, strict=True) if size <= RIVAL * best] + [r.amount]
    return min(fits), max(fits)


def _flow(ratio: Array, critical: float) -> Array:
    """Return the flow function of ISO 6358 with a subsonic index of 0.5."""
    beyond = np.clip((ratio - critical) / (1.0 - critical), 0.0, 1.0)
    return np.sqrt(1.0 - beyond**2)


#: Unit of an amount -> factor and unit in texts, if they differ from the common unit.
_SAID = {"s": (1e3, "ms"), "share of C": (100.0, "%"), "share": (100.0, "%")}


def _amount_in_words(cause: Cause, amount: float, stderr: float | None = None) -> str:
    """Return a cause with its amount, with the uncertainty of a known standard error."""
    size, unit = readable(cause.unit)
    factor, unit = _SAID.get(cause.unit, (1.0 / size, unit))
    compared = cause.words.startswith("{size} ")
    value = factor * (abs(amount) if compared else amount)
    shown = f"{plain(value)} {unit}".rstrip() if stderr is None else with_u(value, factor * NORMAL_95 * stderr, unit)
    if compared:
        shown += " more" if amount > 0.0 else " less"
    return cause.words.format(size=shown)


def _in_words(
    r: _Refined,
    stderr: float,
    rivals: tuple[tuple[str, float], ...],
    laws: tuple[float, float] | None,
    *,
    is_identified: bool,
) -> str:
    """Return a sentence: explained fraction, cause and size, indistinguishable causes, remedy."""
    cause = r.cause
    text = f"{100.0 * r.share:.0f} % of the residual is explained by {_amount_in_words(cause, r.amount, stderr)}"
    if laws is not None and laws[1] - laws[0] > stderr:
        low, high = (plain(_SAID[cause.unit][0] * end) for end in laws)
        text += f"; {low} to {high} % over the flow laws (b = 0 to 0.53) that the recordings cannot distinguish"
    if r.others and is_identified:
        words = (_amount_in_words(other, amount) for other, amount, _ in r.others)
        text += f" together with values that differ from the identified ones: {', '.join(words)}"
    if rivals:
        text += "; the recordings cannot distinguish this from " + ", ".join(
            f"{key} ({100 * s:.0f} %)" for key, s in rivals[:4]
        )
    untold = "" if cause.described else ". A drive file cannot describe it yet"
    return f"{text}{untold}. Remedy: {cause.remedy}."

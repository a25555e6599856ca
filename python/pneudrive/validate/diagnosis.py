"""Why is my model off? The causes that explain the residuals of the balances, each with size and uncertainty.

The residuals of the force balance and of both pressure rates are weighted with their standard deviations and stacked.
Each cause alone is fitted by least squares, its amount refined on the equations themselves (Gauss-Newton, as their
effect is not linear in it). The one that explains most joins the model, and the search goes on with what is left.

    share explained = 1 - |e(changed model)|^2 / |e(model)|^2

Standard errors come from the scores of blocks of 0.25 s, so that neighbours that know each other count once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import DescriptionError
from pneudrive.estimate.estimates import NORMAL_95
from pneudrive.numbers import with_u
from pneudrive.show import Shown
from pneudrive.units import readable
from pneudrive.validate.balance import Scene, Values, half_support
from pneudrive.validate.causes import Cause, causes
from pneudrive.validate.residuals import BALANCES, Residuals, residuals
from pneudrive.watch import Watch

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.validate.signals import Signals
    from pneudrive.watch import Flag

    Array = NDArray[np.float64]

BLOCK_S = 0.25
#: Normalised residuals below this are sensor noise and what is not worth a name.
CLEAN = 1.0
#: Above this a cause is looked for: what is common to many samples shows before it sticks out of the noise.
SOUGHT = 0.7
MOST_CULPRITS = 3
#: A culprit explains at least this share of what is there, at this many standard errors.
LEAST_SHARE, LEAST_T = 0.15, 4.0
#: Causes of which the linear fit is refined.
REFINED = 8
#: A cause whose remaining squared residual is within this factor of the best one's cannot be told from it.
RIVAL = 2.0
NEWTON_STEPS = 3


@dataclass(frozen=True)
class Culprit:
    """One explanation.

    Attributes
    ----------
    key, family, unit, remedy : str
        See `Cause`.
    amount : float
        Change that the model needs.
    stderr : float
    share : float
        Of the squared residual that was there before it.
    balances : dict
        Balance -> share of its own squared residual.
    rivals : tuple of (str, float)
        Causes that explain nearly as much, with their share: the records do not tell them apart.
    text : str
        In words.
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

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the amount."""
        return self.amount - NORMAL_95 * self.stderr, self.amount + NORMAL_95 * self.stderr


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(Shown):
    """What the residuals of the balances point to.

    Attributes
    ----------
    size : dict
        Balance -> root mean square residual over what sensor noise and 1 % of the terms leave.
    culprits : tuple of Culprit
        The most important one first.
    left : float
        Share of the squared residual that no cause explains.
    alone : tuple of (str, float, float)
        Every cause by itself: key, amount, share explained (linear), best first.
    residuals : tuple of Residuals
        Of each recording.
    """

    size: dict[str, float]
    culprits: tuple[Culprit, ...]
    left: float
    alone: tuple[tuple[str, float, float], ...]
    residuals: tuple[Residuals, ...] = field(repr=False)

    @property
    def is_clean(self) -> bool:
        """Whether the residuals are no larger than noise and what is not worth a name."""
        return all(value <= CLEAN for value in self.size.values() if np.isfinite(value))

    def __str__(self) -> str:
        """Return the findings in words."""
        if self.is_clean and not self.culprits:
            return "the balances close: what is left is sensor noise and below 1 % of their terms"
        if not self.culprits:
            return "the balances do not close, and none of the known causes explains it"
        lines = [c.text for c in self.culprits]
        if self.left > 0.3:
            lines.append(f"{100 * self.left:.0f} % of the residual remains without an explanation")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class _Model:
    """A model under test: the scenes of the recordings, and terms that no scene can say, taken off the residuals."""

    scenes: list[Scene]
    taken: Array | float


class _Search:
    """Weighted, stacked residuals of several recordings, and what causes do to them."""

    def __init__(self, drive: Drive, signals: Sequence[Signals]) -> None:
        self.signals = list(signals)
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

    def stacked(self, values: Sequence[Values]) -> Array:
        """Weighted values of all recordings and balances in one vector."""
        out = []
        for found, stride, own in zip(self.found, self.stride, values, strict=True):
            for v, scale, used in zip(own, found.scale, found.used, strict=True):
                out.append((v / scale)[::stride][used[::stride]])
        return np.concatenate(out)

    def left(self, model: _Model) -> Array:
        """Stacked residual of a model."""
        return self.stacked([scene.residuals for scene in model.scenes]) - model.taken

    def effect(self, model: _Model, cause: Cause, amount: float) -> Array | None:
        """Return what the stacked residual loses with a cause; None where the description refuses it."""
        try:
            effect = self.stacked([cause.effect(scene, amount) for scene in model.scenes])
        except DescriptionError:
            return None
        return effect if np.isfinite(effect).all() else None

    def with_cause(self, model: _Model, r: _Refined) -> _Model:
        """Return the model with a cause in it."""
        change = r.cause.change
        if change is None:
            return _Model(model.scenes, model.taken + r.amount * r.column)
        return _Model([change(scene, r.amount) for scene in model.scenes], model.taken)

    def squares(self, e: Array) -> dict[str, float]:
        """Sum of squares of each balance."""
        sums = np.bincount(self.places, weights=e * e, minlength=len(BALANCES))
        return dict(zip(BALANCES, sums.tolist(), strict=True))

    def sizes(self, e: Array) -> dict[str, float]:
        """Root mean square of each balance, NaN where it was never usable."""
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
    """A cause with its amount, the share that it explains, its column, and the residual after it."""

    cause: Cause
    amount: float
    share: float
    column: Array
    after: Array

    @classmethod
    def of(cls, cause: Cause, amount: float, column: Array, left: Array, effect: Array | None = None) -> _Refined:
        """Take an amount off a residual, by its column where its effect is not given."""
        after = left - (amount * column if effect is None else effect)
        return cls(cause, amount, 1.0 - float(after @ after) / float(left @ left), column, after)


def diagnose(
    drive: Drive,
    signals: Sequence[Signals],
    *,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> Diagnosis:
    """Find what the residuals of the balances point to.

    Parameters
    ----------
    drive : Drive
        The model.
    signals : sequence of Signals
        Of recordings.
    progress, cancel : optional
        See `pneudrive.watch.Watch`.

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
        refined = _refined(search, model, left, {c.key for c in culprits}, watch)
        alone = alone or tuple((r.cause.key, r.amount, r.share) for r in refined)
        # The one that explains most, or none: what it explains better is no evidence for another.
        if not refined or not _is_shown(search, found := refined[0], left):
            break
        culprits.append(_culprit(search, found, refined, left))
        model = search.with_cause(model, found)
        left = search.left(model)
    remains = float(left @ left) / float(first @ first) if first.size and first.any() else 0.0
    return Diagnosis(search.sizes(first), tuple(culprits), remains, alone, tuple(search.found))


def _is_dirty(search: _Search, e: Array) -> bool:
    return any(value > SOUGHT for value in search.sizes(e).values())


def _refined(search: _Search, model: _Model, left: Array, taken: set[str], watch: Watch) -> list[_Refined]:
    """Fit each cause by itself, refine the best on the equations; best first."""
    wanted = [cause for key, cause in search.causes.items() if key not in taken]
    linear = []
    for cause in watch.each(wanted, f"causes tried for what is left after {len(taken)}"):
        found = (_linear if cause.profile is None else _profile)(search, model, left, cause)
        linear += [found] if found is not None else []
    linear.sort(key=lambda r: -r.share)
    refined = [r if r.cause.change is None else _newton(search, model, left, r) for r in linear[:REFINED]]
    refined = sorted([*refined, *linear[REFINED:]], key=lambda r: -r.share)
    # Of those that cannot be told apart, the one with fewest numbers of its own comes first.
    rivals = [r for r in refined if _is_rival(search, r, refined[0])]
    return sorted(rivals, key=lambda r: (r.cause.parts, -r.share)) + [r for r in refined if r not in rivals]


def _linear(search: _Search, model: _Model, left: Array, cause: Cause) -> _Refined | None:
    """Fit the amount of a cause whose effect is taken for linear in it."""
    effect = search.effect(model, cause, cause.step)
    if effect is None or not effect.any():
        return None
    column = effect / cause.step
    amount = float(np.clip(float(column @ left) / float(column @ column), *cause.bounds))
    return _Refined.of(cause, amount, column, left)


def _is_rival(search: _Search, r: _Refined, best: _Refined) -> bool:
    """Whether a cause leaves no more than noise, or hardly more than the best one."""
    return 1.0 - r.share <= RIVAL * (1.0 - best.share) or not _is_dirty(search, r.after)


def _profile(search: _Search, model: _Model, left: Array, cause: Cause) -> _Refined | None:
    """Fit a cause of several columns; its amount is the amplitude over the travelled range."""
    assert cause.profile is not None
    each = [cause.profile(scene) for scene in model.scenes]  # one list of columns for each recording
    columns = np.column_stack([search.stacked([own[k] for own in each]) for k in range(cause.parts)])
    weights = np.linalg.lstsq(columns, left, rcond=None)[0]
    over_stroke = np.polynomial.legendre.legval(np.linspace(-1.0, 1.0, 101), weights)
    amount = 0.5 * float(np.ptp(over_stroke))
    if amount == 0.0:
        return None
    effect = columns @ weights
    return _Refined.of(cause, amount, effect / amount, left, effect)


def _newton(search: _Search, model: _Model, left: Array, start: _Refined) -> _Refined:
    """Gauss-Newton on one amount, from its linear value; what the description refuses explains nothing."""
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
    """Whether a cause is worth a name and beyond chance; where balances are plainly off, any amount is."""
    worth = abs(r.amount) >= r.cause.least or any(value > CLEAN for value in search.sizes(left).values())
    return worth and r.share >= LEAST_SHARE and abs(r.amount) >= LEAST_T * search.stderr(r.column, r.after)


def _culprit(search: _Search, r: _Refined, others: list[_Refined], left: Array) -> Culprit:
    cause, stderr = r.cause, search.stderr(r.column, r.after)
    rivals = tuple((o.cause.key, o.share) for o in others[:REFINED] if o is not r and _is_rival(search, o, r))
    was, now, whole = search.squares(left), search.squares(r.after), float(left @ left)
    balances = {b: 1.0 - now[b] / was[b] for b in BALANCES if was[b] > 0.02 * whole}
    said = (cause.key, cause.family, cause.unit, cause.remedy)
    return Culprit(*said, r.amount, stderr, r.share, balances, rivals, _in_words(r, stderr, rivals))


#: Unit of an amount -> factor and unit in which it is said, where they are not those in which people read values.
_SAID = {"s": (1e3, "ms"), "share of C": (100.0, "%"), "share": (100.0, "%")}


def _in_words(r: _Refined, stderr: float, rivals: tuple[tuple[str, float], ...]) -> str:
    """Say what explains how much, how large it is, what it cannot be told from, and what to do."""
    cause = r.cause
    size, unit = readable(cause.unit)
    factor, unit = _SAID.get(cause.unit, (1.0 / size, unit))
    compared = cause.words.startswith("{size} ")
    shown = with_u(factor * (abs(r.amount) if compared else r.amount), factor * NORMAL_95 * stderr, unit)
    if compared:
        shown += " more" if r.amount > 0.0 else " less"
    text = f"{100.0 * r.share:.0f} % of the residual is explained by {cause.words.format(size=shown)}"
    if rivals:
        text += "; the recordings do not tell it from " + ", ".join(f"{key} ({100 * s:.0f} %)" for key, s in rivals[:4])
    untold = "" if cause.described else ". A drive file cannot describe it yet"
    return f"{text}{untold}. Remedy: {cause.remedy}."

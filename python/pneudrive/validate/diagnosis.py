"""Why is my model off? The candidates that explain the residuals of the balances, each with size and uncertainty.

The residuals of the force balance and of both pressure rates are weighted with their standard deviations and stacked.
Each candidate alone is fitted by least squares, its amount refined on the equations themselves (Gauss-Newton, as their
effect is not linear in it). The one that explains most joins the model, and the search goes on with what is left.

    share explained = 1 - |e(changed model)|^2 / |e(model)|^2

Standard errors come from the scores of blocks of 0.25 s, so that neighbours that know each other count once.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.spread import NORMAL_95
from pneudrive.errors import DescriptionError
from pneudrive.numbers import with_u
from pneudrive.show import Shown
from pneudrive.validate.candidates import Candidate, candidates
from pneudrive.validate.residuals import BALANCES, Residuals, Scene, half_support, raw_residuals, residuals
from pneudrive.watch import Watch

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from pneudrive.describe import Drive
    from pneudrive.validate.signals import Signals
    from pneudrive.watch import Flag

    Array = NDArray[np.float64]
    Values = tuple[Array, Array, Array]

BLOCK_S = 0.25
#: Normalised residuals below this are sensor noise and what is not worth a name.
CLEAN = 1.0
#: Above this a cause is looked for: what is common to many samples shows before it sticks out of the noise.
SOUGHT = 0.7
MOST_CULPRITS = 3
#: A culprit explains at least this share of what is there, at this many standard errors.
LEAST_SHARE, LEAST_T = 0.15, 4.0
#: Candidates of which the linear fit is refined.
REFINED = 8
#: A candidate whose remaining squared residual is within this factor of the best one's cannot be told from it.
RIVAL = 2.0
NEWTON_STEPS = 3


@dataclass(frozen=True)
class Culprit:
    """One explanation.

    Attributes
    ----------
    key, family, unit, remedy : str
        See `Candidate`.
    amount : float
        Change that the model needs.
    stderr : float
    share : float
        Of the squared residual that was there before it.
    balances : dict
        Balance -> share of its own squared residual.
    rivals : tuple of (str, float)
        Candidates that explain nearly as much, with their share: the records do not tell them apart.
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
        Share of the squared residual that no candidate explains.
    alone : tuple of (str, float, float)
        Every candidate by itself: key, amount, share explained (linear), best first.
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
            return (
                "the balances do not close, and no candidate explains it: the cause is none of those that are asked for"
            )
        lines = [c.text for c in self.culprits]
        if self.left > 0.3:
            lines.append(f"{100 * self.left:.0f} % of the residual remains without an explanation")
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class _Model:
    """A model under test: the scenes of the recordings, and terms that no scene can say, taken off the residuals."""

    scenes: list[Scene]
    raw: list[Values]
    taken: Array

    def left(self, search: _Search) -> Array:
        """Stacked residual."""
        return search.stacked(self.raw) - self.taken


class _Search:
    """Weighted, stacked residuals of several recordings, and what candidates do to them."""

    def __init__(self, drive: Drive, signals: Sequence[Signals]) -> None:
        self.signals = list(signals)
        self.found = [residuals(drive, s) for s in signals]
        self.stride = [max(half_support(s) // 2, 1) for s in signals]
        self.candidates = {c.key: c for c in candidates(drive)}
        self.blocks = self._blocks()
        self.places = self._places()

    def start(self, drive: Drive) -> _Model:
        """Return the model as it is."""
        return self.model([Scene.of(drive, s) for s in self.signals], np.zeros(self.blocks.size))

    def model(self, scenes: list[Scene], taken: Array) -> _Model:
        """Make a model with these scenes."""
        raw = [raw_residuals(scene, s)[0] for scene, s in zip(scenes, self.signals, strict=True)]
        return _Model(scenes, raw, taken)

    def stacked(self, values: Sequence[Values]) -> Array:
        """Weighted values of all recordings and balances in one vector."""
        out = []
        for found, stride, own in zip(self.found, self.stride, values, strict=True):
            for v, scale, used in zip(own, found.scale, found.used, strict=True):
                out.append((v / scale)[::stride][used[::stride]])
        return np.concatenate(out)

    def _blocks(self) -> NDArray[np.int64]:
        """Block of each stacked value."""
        out, first = [], 0
        for found, stride in zip(self.found, self.stride, strict=True):
            number = first + np.floor(found.time_s / BLOCK_S).astype(np.int64)
            out += [number[::stride][used[::stride]] for used in found.used]
            first = int(number[-1]) + 1
        return np.concatenate(out)

    def _places(self) -> NDArray[np.int64]:
        """Balance of each stacked value."""
        sizes = [
            (b, int(used[::stride].sum()))
            for found, stride in zip(self.found, self.stride, strict=True)
            for b, used in enumerate(found.used)
        ]
        return np.concatenate([np.full(n, b) for b, n in sizes])

    def effect(self, model: _Model, candidate: Candidate, amount: float) -> Array | None:
        """Return what the stacked residual loses with a candidate; None where the description refuses it."""
        try:
            each = [
                candidate.effect(scene, s, amount, raw)
                for scene, s, raw in zip(model.scenes, self.signals, model.raw, strict=True)
            ]
        except DescriptionError:
            return None
        effect = self.stacked(each)
        return effect if np.isfinite(effect).all() else None

    def with_candidate(self, model: _Model, r: _Refined) -> _Model:
        """Return the model with a candidate in it."""
        change, amount = r.candidate.change, r.amount
        if change is None:
            return _Model(model.scenes, model.raw, model.taken + amount * r.column)
        scenes = [change(scene, s, amount) for scene, s in zip(model.scenes, self.signals, strict=True)]
        return self.model(scenes, model.taken)

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
    """A candidate with its amount on the equations themselves."""

    candidate: Candidate
    amount: float
    share: float
    column: Array
    after: Array


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
    model = search.start(drive)
    first = left = model.left(search)
    culprits: list[Culprit] = []
    alone: tuple[tuple[str, float, float], ...] = ()
    while len(culprits) < MOST_CULPRITS and _is_dirty(search, left):
        refined = _refined(search, model, left, {c.key for c in culprits}, watch)
        alone = alone or tuple((r.candidate.key, r.amount, r.share) for r in refined)
        # The one that explains most, or none: what it explains better is no evidence for another.
        if not refined or not _is_shown(search, found := refined[0], left):
            break
        culprits.append(_culprit(search, found, refined, left))
        model = search.with_candidate(model, found)
        left = model.left(search)
    remains = float(left @ left) / float(first @ first) if first.size and first.any() else 0.0
    return Diagnosis(search.sizes(first), tuple(culprits), remains, alone, tuple(search.found))


def _is_dirty(search: _Search, e: Array) -> bool:
    return any(value > SOUGHT for value in search.sizes(e).values())


def _refined(search: _Search, model: _Model, left: Array, taken: set[str], watch: Watch) -> list[_Refined]:
    """Fit each candidate by itself, refine the best on the equations; best first."""
    whole = float(left @ left)
    linear = []
    wanted = {key: candidate for key, candidate in search.candidates.items() if key not in taken}
    for candidate in watch.each(wanted.values(), f"causes tried for what is left after {len(taken)}"):
        if candidate.profile is not None:
            linear += [found] if (found := _profile(search, model, left, candidate)) is not None else []
            continue
        effect = search.effect(model, candidate, candidate.step)
        if effect is None or not effect.any():
            continue
        column = effect / candidate.step
        power = float(column @ column)
        amount = float(np.clip(float(column @ left) / power, *candidate.bounds))
        after = left - amount * column
        linear.append(_Refined(candidate, amount, 1.0 - float(after @ after) / whole, column, after))
    linear.sort(key=lambda r: -r.share)
    refined = [r if r.candidate.change is None else _newton(search, model, left, r) for r in linear[:REFINED]]
    refined = sorted([*refined, *linear[REFINED:]], key=lambda r: -r.share)
    # Of those that cannot be told apart, the one with fewest numbers of its own comes first.
    rivals = [r for r in refined if _is_rival(search, r, refined[0])]
    return sorted(rivals, key=lambda r: (r.candidate.parts, -r.share)) + [r for r in refined if r not in rivals]


def _is_rival(search: _Search, r: _Refined, best: _Refined) -> bool:
    """Whether a candidate leaves no more than noise, or hardly more than the best one."""
    return 1.0 - r.share <= RIVAL * (1.0 - best.share) or not _is_dirty(search, r.after)


def _profile(search: _Search, model: _Model, left: Array, candidate: Candidate) -> _Refined | None:
    """Fit a candidate of several columns; its amount is the amplitude over the travelled range."""
    assert candidate.profile is not None
    each = [
        candidate.profile(scene, s) for scene, s in zip(model.scenes, search.signals, strict=True)
    ]  # one list of columns, and of their values over the stroke, for each recording
    columns = np.column_stack([search.stacked([own[k] for own in each]) for k in range(candidate.parts)])
    if not columns.any():
        return None
    weights = np.linalg.lstsq(columns, left, rcond=None)[0]
    effect = columns @ weights
    over_stroke = np.polynomial.legendre.legval(np.linspace(-1.0, 1.0, 101), weights)
    amount = 0.5 * float(np.ptp(over_stroke))
    if amount == 0.0:
        return None
    after = left - effect
    share = 1.0 - float(after @ after) / float(left @ left)
    return _Refined(candidate, amount, share, effect / amount, after)


def _newton(search: _Search, model: _Model, left: Array, start: _Refined) -> _Refined:
    """Gauss-Newton on one amount, from its linear value; what the description refuses explains nothing."""
    candidate, amount, whole = start.candidate, start.amount, float(left @ left)
    best: _Refined | None = None
    for _ in range(NEWTON_STEPS):
        here = search.effect(model, candidate, amount)
        beside = search.effect(model, candidate, amount + 0.1 * candidate.step)
        if here is None or beside is None:
            amount *= 0.5
            continue
        after = left - here
        column = (beside - here) / (0.1 * candidate.step)
        share = 1.0 - float(after @ after) / whole
        if best is None or share > best.share:
            best = _Refined(candidate, amount, share, column, after)
        power = float(column @ column)
        if power == 0.0:
            break
        amount = float(np.clip(amount + float(column @ after) / power, *candidate.bounds))
    return best or _Refined(candidate, 0.0, 0.0, start.column, left)


def _is_shown(search: _Search, r: _Refined, left: Array) -> bool:
    """Whether a candidate is worth a name and beyond chance; where balances are plainly off, any amount is."""
    worth = abs(r.amount) >= r.candidate.least or any(value > CLEAN for value in search.sizes(left).values())
    return worth and r.share >= LEAST_SHARE and abs(r.amount) >= LEAST_T * search.stderr(r.column, r.after)


def _culprit(search: _Search, r: _Refined, others: list[_Refined], left: Array) -> Culprit:
    candidate, stderr = r.candidate, search.stderr(r.column, r.after)
    rivals = tuple((o.candidate.key, o.share) for o in others[:REFINED] if o is not r and _is_rival(search, o, r))
    was, now, whole = search.squares(left), search.squares(r.after), float(left @ left)
    balances = {b: 1.0 - now[b] / was[b] for b in BALANCES if was[b] > 0.02 * whole}
    text = in_words(candidate, r.amount, stderr, r.share, rivals)
    return Culprit(
        candidate.key,
        candidate.family,
        candidate.unit,
        candidate.remedy,
        r.amount,
        stderr,
        r.share,
        balances,
        rivals,
        text,
    )


#: Unit of an amount -> factor and unit in which it is said.
_SAID = {
    "N": (1.0, "N"),
    "N s/m": (1.0, "N s/m"),
    "N/m": (1.0, "N/m"),
    "N/Pa": (1e5, "N/bar"),
    "s": (1e3, "ms"),
    "m": (1e3, "mm"),
    "Pa": (1e-5, "bar"),
    "1": (1.0, ""),
    "share of C": (100.0, "%"),
    "share": (100.0, "%"),
}
_COMPARED = ("{size} moving", "{size} conductance", "{size} dead", "{size} heat", "{size} Coulomb", "{size} viscous",
             "{size} friction", "{size} supply")  # fmt: skip


def in_words(
    candidate: Candidate, amount: float, stderr: float, share: float, rivals: tuple[tuple[str, float], ...]
) -> str:
    """Say what explains how much, how large it is, what it cannot be told from, and what to do."""
    factor, unit = _SAID[candidate.unit]
    value, spread = factor * amount, factor * NORMAL_95 * stderr
    compared = candidate.words.startswith(_COMPARED)
    shown = with_u(abs(value) if compared else value, spread, unit)
    if compared:
        shown += " more" if amount > 0.0 else " less"
    said = candidate.words.format(size=shown)
    text = f"{100.0 * share:.0f} % of the residual is explained by {said}"
    if rivals:
        text += "; the recordings do not tell it from " + ", ".join(f"{key} ({100 * s:.0f} %)" for key, s in rivals[:4])
    untold = "" if candidate.described else ". A drive file cannot describe it yet"
    return f"{text}{untold}. Remedy: {candidate.remedy}."

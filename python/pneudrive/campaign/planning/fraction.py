"""The fraction of a campaign that fits into its time and keeps the model estimable.

A main effect has a column for each level except one, so an estimable model contains every level of every factor. The
named interaction is a slope over the first factor (over the logarithm of its level) for each level of the second.
Design
points are chosen for a large determinant of X'X in little time, at least two at every level. They are exchanged until
no exchange helps. Method: [fedorov1972].
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.campaign.planning.plan import cell_name
from pneudrive.describe.files import toml
from pneudrive.errors import ProtocolError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.campaign.planning.plan import Plan
    from pneudrive.campaign.planning.protocol import Protocol

    Array = NDArray[np.floating[Any]]

#: Added to X'X before it has full rank, so that its determinant exists; far below any column's norm.
RIDGE = 1e-6
#: Exchanges that raise the logarithm of the determinant by less than this are not made.
WORTH = 1e-9
#: Cells at every level, so that none hangs on a single combination with the others.
LEAST = 2
#: Passes over the chosen cells, each trying every exchange.
PASSES = 20
DEFAULT_INTERACTIONS = {"stop": ("stop", "pressure"), "sweep": ("speed", "pressure")}


@dataclass(frozen=True)
class Family:
    """The cells of a fraction that are of one kind, sweep or stop.

    Attributes
    ----------
    kind : str
    cells, of : int
        Number of chosen cells, and of all.
    levels : dict
        Factor -> least number of chosen cells at one of its levels.
    interaction : (str, str) or None
        The interaction that stays estimable, as slopes of the first factor at each level of the second.
    parameters : int
        Number of parameters of the model.
    efficiency : float
        D-efficiency: information for each cell, relative to the full factorial.
    error_ratio : float
        Standard errors of the model relative to those of the full factorial (geometric mean).
    lost : dict
        ``factor x factor`` -> (degrees of freedom that can still be estimated, all), where some are lost.
    """

    kind: str
    cells: int
    of: int
    levels: dict[str, int]
    interaction: tuple[str, str] | None
    parameters: int
    efficiency: float
    error_ratio: float
    lost: dict[str, tuple[int, int]]


@dataclass(frozen=True)
class CellProposal:
    """A fraction of a plan.

    Attributes
    ----------
    names : tuple of str
        Number of design points, as in `[fraction] cells`.
    families : tuple of Family
    """

    names: tuple[str, ...]
    families: tuple[Family, ...]


@dataclass(frozen=True)
class _Candidate:
    name: str
    levels: dict[str, Any]
    cost_s: float


def write_fraction(protocol: Protocol, proposal: CellProposal) -> str:
    """Return the protocol's text, unchanged, with the cells of a proposal as a table at the end."""
    chosen = ", ".join(f"{f.cells} of {f.of} {f.kind} cells" for f in proposal.families)
    cells = "\n".join(f"    {toml.value_text(name)}," for name in proposal.names)
    table = f"[fraction]  # {chosen}, chosen by `pneudrive campaign plan`\ncells = [\n{cells}\n]\n"
    return f"{protocol.text.rstrip()}\n\n{table}"


def propose(plan: Plan, limit_s: float) -> CellProposal:
    """Choose cells whose cycles fit into a time, with warm-up, checks and other cycles around them.

    If even the smallest estimable set of cells takes longer, that set is proposed.

    Parameters
    ----------
    plan : Plan
        Number of design points of the full protocol, without a fraction.
    limit_s : float

    Returns
    -------
    CellProposal

    Raises
    ------
    ProtocolError
        If the named interaction is not made of two factors of the protocol.
    """
    groups = _candidates(plan)
    points = sum(one.time_s for one in plan.planned if one.cell is not None)
    share = max(limit_s - (plan.time_s - points), 0.0) / points
    names: list[str] = []
    families = []
    for kind, candidates in groups.items():
        chosen, family = _choose(kind, candidates, plan.protocol, share * sum(c.cost_s for c in candidates))
        names += [candidates[i].name for i in chosen]
        families.append(family)
    return CellProposal(tuple(names), tuple(families))


def _candidates(plan: Plan) -> dict[str, list[_Candidate]]:
    """Return the cells of a plan, in the order of their first cycles, with the time of all their repeats."""
    groups: dict[str, dict[str, tuple[dict[str, Any], float]]] = {}
    for one in plan.planned:
        if one.cell is None:
            continue
        name = cell_name(one.cycle.levels, one.cell)
        group = groups.setdefault(one.cell.kind, {})
        levels, cost = group.get(name, (one.cell.levels() | one.cycle.levels, 0.0))
        group[name] = (levels, cost + one.time_s)
    return {kind: [_Candidate(n, *group[n]) for n in sorted(group)] for kind, group in groups.items()}


def _choose(kind: str, candidates: list[_Candidate], protocol: Protocol, budget_s: float) -> tuple[list[int], Family]:
    factors = _factors(candidates)
    interaction = _interaction(kind, factors, protocol)
    model = _model(candidates, factors, interaction)
    cost = np.array([c.cost_s for c in candidates])
    present = np.hstack(
        [
            np.array([[c.levels[name] == level for level in levels] for c in candidates])
            for name, levels in factors.items()
        ]
        or [np.ones((len(candidates), 1))]
    ).astype(float)
    chosen = _fill(model, cost, present, _complete(model, cost), budget_s)
    chosen = sorted(_exchange(model, cost, present, chosen, max(budget_s, float(cost[chosen].sum()))))
    rows = model[chosen]
    full, part = (np.linalg.slogdet(x.T @ x)[1] for x in (model, rows))
    error_ratio = math.exp(0.5 * (full - part) / model.shape[1])
    least = {
        name: min(sum(candidates[i].levels[name] == level for i in chosen) for level in levels)
        for name, levels in factors.items()
    }
    family = Family(
        kind=kind,
        cells=len(chosen),
        of=len(candidates),
        levels=least,
        interaction=interaction,
        parameters=model.shape[1],
        efficiency=len(candidates) / len(chosen) / error_ratio**2,
        error_ratio=error_ratio,
        lost=_lost(candidates, factors, model, chosen),
    )
    return chosen, family


def _factors(candidates: list[_Candidate]) -> dict[str, list[Any]]:
    """Return the factors with more than one level, each with its levels in order."""
    out: dict[str, list[Any]] = {}
    for candidate in candidates:
        for name, level in candidate.levels.items():
            levels = out.setdefault(name, [])
            if level not in levels:
                levels.append(level)
    return {
        name: sorted(levels) if all(isinstance(x, float) for x in levels) else levels
        for name, levels in out.items()
        if len(levels) > 1
    }


def _interaction(kind: str, factors: dict[str, list[Any]], protocol: Protocol) -> tuple[str, str] | None:
    asked = protocol.design.interaction
    if asked is None:
        default = DEFAULT_INTERACTIONS[kind]
        return default if all(name in factors for name in default) else None
    if all(name in factors for name in asked) and asked[0] != asked[1]:
        return asked[0], asked[1]
    if set(asked) & {"stop", "restart", "axis", "position"} and kind == "sweep":
        return None
    if set(asked) & {"speed", "turn"} and kind == "stop":
        return None
    raise protocol.fail(
        "design.interaction",
        f"design.interaction: {' x '.join(asked)} cannot be estimated",
        rule=f"two factors with more than one level each: {', '.join(factors)}",
    )


def _model(candidates: list[_Candidate], factors: dict[str, list[Any]], interaction: tuple[str, str] | None) -> Array:
    columns = [np.ones((len(candidates), 1))]
    columns += [_effects(candidates, name, levels) for name, levels in factors.items()]
    if interaction is not None:
        first, second = interaction
        slope = _score(candidates, first, factors[first])
        columns.append(slope[:, None] * _effects(candidates, second, factors[second]))
    return np.hstack(columns)


def _effects(candidates: list[_Candidate], name: str, levels: Sequence[Any]) -> Array:
    """Return the effect coding: a column for each level except the last, which has -1 in all columns.

    The sum of each column over all levels is therefore zero.
    """
    index = np.array([levels.index(c.levels[name]) for c in candidates])
    out = (index[:, None] == np.arange(len(levels) - 1)).astype(float)
    out[index == len(levels) - 1] = -1.0
    return out


def _score(candidates: list[_Candidate], name: str, levels: Sequence[Any]) -> Array:
    """Return a coordinate from -1 to 1 for each level of a factor: by the logarithm of a number, otherwise by rank."""
    if all(isinstance(level, float) for level in levels):
        least = min(level for level in levels if level > 0.0)
        values = [math.log10(level if level > 0.0 else 0.1 * least) for level in levels]  # no stop: a decade below
    else:
        values = [float(i) for i in range(len(levels))]
    low, high = min(values), max(values)
    place = {level: 2.0 * (value - low) / (high - low) - 1.0 for level, value in zip(levels, values, strict=True)}
    return np.array([place[c.levels[name]] for c in candidates])


def _gain(inverse: Array, model: Array) -> Array:
    """Return the gain of log det X'X for each candidate."""
    return np.log1p(((model @ inverse) * model).sum(axis=1))


def _complete(model: Array, cost: Array) -> list[int]:
    """Choose as many cells as the model has parameters.

    Each cell raises the rank, and cells with most information per second come first.
    """
    k = model.shape[1]
    inverse = np.eye(k) / RIDGE
    chosen: list[int] = []
    residual = model.copy()  # part outside the span of the chosen rows
    while len(chosen) < k:
        norm = np.einsum("ij,ij->i", residual, residual)
        open_ = norm > 1e-9 * k
        if not open_.any():
            raise ProtocolError(
                "even the full factorial design cannot separate the effects",
                rule="each level of one factor occurs with several levels of the others",
            )
        worth = np.where(open_, _gain(inverse, model) / cost, -np.inf)
        best = _best(worth)
        chosen.append(best)
        inverse = _updated(inverse, model[best])
        direction = residual[best] / math.sqrt(norm[best])
        residual -= np.outer(residual @ direction, direction)
    return chosen


def _fill(model: Array, cost: Array, levels: Array, chosen: list[int], budget_s: float) -> list[int]:
    """Add cells with most information per second first: `LEAST` at every level, then as many as the time allows."""
    chosen = list(chosen)
    used = float(cost[chosen].sum())
    inverse: Array = np.linalg.inv(model[chosen].T @ model[chosen])
    free = np.ones(len(cost), dtype=bool)
    free[chosen] = False
    while True:
        short = levels[chosen].sum(axis=0) < np.minimum(LEAST, levels.sum(axis=0))
        fits = free & (levels[:, short].any(axis=1) if short.any() else used + cost <= budget_s)
        if not fits.any():
            return chosen
        best = _best(np.where(fits, _gain(inverse, model) / cost, -np.inf))
        chosen.append(best)
        free[best] = False
        used += float(cost[best])
        inverse = _updated(inverse, model[best])


def _exchange(model: Array, cost: Array, levels: Array, chosen: list[int], budget_s: float) -> list[int]:
    """Exchange one chosen cell for another wherever that raises the determinant and keeps the time and `LEAST`."""
    chosen = list(chosen)
    used = float(cost[chosen].sum())
    spread = model @ np.linalg.inv(model[chosen].T @ model[chosen])
    for _ in range(PASSES):
        improved = False
        for place, old in enumerate(chosen):
            d, cross = (spread * model).sum(axis=1), spread @ model[old]
            delta = (1.0 + d) * (1.0 - d[old]) + cross**2  # of the determinant when the new row replaces the old one
            tight = (levels[old] > 0.0) & (levels[chosen].sum(axis=0) <= LEAST)
            allowed = (used - cost[old] + cost <= budget_s) & (levels[:, tight] > 0.0).all(axis=1)
            allowed[chosen] = False
            best = _best(np.where(allowed, delta, -np.inf))
            if allowed[best] and delta[best] > 1.0 + WORTH:
                used += float(cost[best] - cost[old])
                chosen[place] = best
                spread = model @ np.linalg.inv(model[chosen].T @ model[chosen])
                improved = True
        if not improved:
            break
    return chosen


def _best(values: Array) -> int:
    """Return the first of the largest values, so that rounding does not decide between equal ones."""
    top = float(values.max())
    return int(np.argmax(values >= top - 1e-9 * abs(top))) if math.isfinite(top) else 0


def _updated(inverse: Array, row: Array) -> Array:
    """Return the inverse of X'X after one more row (Sherman and Morrison)."""
    v = inverse @ row
    return inverse - np.outer(v, v) / (1.0 + float(row @ v))


def _lost(
    candidates: list[_Candidate], factors: dict[str, list[Any]], model: Array, chosen: list[int]
) -> dict[str, tuple[int, int]]:
    """Return, for each pair of factors, the part of its interaction that can be estimated in addition to the model."""
    rows = model[chosen]
    base, out = _rank(rows), {}
    for one, other in combinations(factors, 2):
        a, b = (_effects(candidates, name, factors[name]) for name in (one, other))
        both = (a[:, :, None] * b[:, None, :]).reshape(len(candidates), -1)
        slopes = _rank(np.hstack([model, both])) - model.shape[1]
        kept = _rank(np.hstack([rows, both[chosen]])) - base
        beside = both.shape[1] - slopes  # its part within the model
        if kept < slopes:
            out[f"{one} x {other}"] = (kept + beside, both.shape[1])
    return out


def _rank(columns: Array) -> int:
    """Return the rank, from the small matrix X'X: crossed effects are clearly independent or exactly dependent."""
    return int(np.linalg.matrix_rank(columns.T @ columns, hermitian=True))

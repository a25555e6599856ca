"""Fits as the page shows them: values, ellipses, residuals, profiles, next points to measure."""

from __future__ import annotations

import shlex
from typing import TYPE_CHECKING, Any

from pneudrive.campaign.planning.next_points import limits_of
from pneudrive.errors import CommandError
from pneudrive.friction.friction_map import read_map
from pneudrive.identify.base import shown_in
from pneudrive.identify.design import next_measurements
from pneudrive.identify.files import read_fit
from pneudrive.identify.static.result import PROBABILITIES, FrictionFit, SlidingFit, ellipses, profiles, with_map
from pneudrive.rig.loading import load_rig
from pneudrive.web.jobs import RIG
from pneudrive.web.lineage import MOST_TRACED, SAME, Lineage
from pneudrive.web.measured.friction import number
from pneudrive.web.results import sent
from pneudrive.web.workspace import safe

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.identify.files import AnyFit
    from pneudrive.views import View
    from pneudrive.web.workspace import Workspace

MOST_NEXT = 200  # largest number of proposed points


def shown_fit(workspace: Workspace, path: str) -> dict[str, Any]:
    """Return a fit of any kind: values with intervals, undetermined values, notes.

    Raises
    ------
    FitError
        The file is not a fit.
    """
    fit: AnyFit = read_fit(workspace.path(path, (".toml",)))
    about = {"kind": fit.KIND, "title": fit.TITLE, "synthetic": fit.synthetic, "converged": fit.converged}
    about |= {"statements": len(fit.statements())}
    return about | {"view": sent(fit.view()), "recordings": list(fit.recordings)}


def view_of_fit(workspace: Workspace, path: str) -> View:
    """Return the values of a fit of any kind."""
    return read_fit(workspace.path(path, (".toml",))).view()


def behind_fit(workspace: Workspace, path: str) -> dict[str, Any]:
    """Return the details of a fit: ellipses of its values and, with its map, residuals and profiles.

    Numbers are in the displayed units.

    Raises
    ------
    FitError
        The file is not a fit.
    """
    fit = read_fit(workspace.path(path, (".toml",)))
    scales = {name: shown_in(unit) for name, unit in fit.units.items()}
    drawn = [
        {
            "x": _axis(one.x, scales),
            "y": _axis(one.y, scales),
            "correlation": one.correlation,
            "points": (one.points / [scales[one.x][0], scales[one.y][0]]).tolist(),
        }
        for one in (ellipses(fit) if fit.covariance.size and fit.intervals else ())
    ]
    found: dict[str, Any] = {
        "ellipses": drawn,
        "residuals": [],
        "profiles": [],
        "designs": isinstance(fit, FrictionFit),
    }
    if not isinstance(fit, SlidingFit):
        return found | {"why": f"The {fit.TITLE} keeps no samples: Validation compares it with its recordings."}
    (edge,) = Lineage(workspace, MOST_TRACED).edges(path)
    if edge.state != SAME:
        return found | {"why": "Residuals and profiles need the map of the fit: it was removed or changed."}
    table = read_map(workspace.path(edge.path))
    of_map = with_map(fit, table).compared()["friction"]
    found["residuals"] = list(zip(of_map.at.tolist(), (of_map.measured - of_map.model).tolist(), strict=True))
    lines = [
        "from pneudrive.characterise import read_map",
        "from pneudrive.identify.files import read_fit",
        "from pneudrive.identify.static.result import ellipses, profiles, with_map\n",
        f"curves = read_map({edge.path!r})\nfit = with_map(read_fit({path!r}), curves)",
        'data = fit.compared()["friction"]\nresiduals = data.measured - data.model',
        "outlines = ellipses(fit)",
    ]
    if isinstance(fit, FrictionFit) and fit.model.knee_pa is None:
        lines.append("ends = profiles(fit, curves)")
        for name, ends in profiles(fit, table).items():
            size, value = scales[name][0], fit.free_values()[name]
            low, high = ([number(one / size) for one in ends[:, side]] for side in (0, 1))
            own = {**_axis(name, scales), "value": value / size, "low": low, "high": high}
            found["profiles"].append({**own, "probability": PROBABILITIES})
    words = ("pneudrive", "report", safe(path), "--map", edge.path, "--out", f"{path.removesuffix('.toml')}-report")
    python = "\n".join(lines) + "\n"
    return found | {"map": edge.path, "why": "", "command": shlex.join(words), "python": python}


def _axis(name: str, scales: Mapping[str, tuple[float, str]]) -> dict[str, str]:
    return {"name": name, "unit": scales[name][1]}


def next_points(workspace: Workspace, path: str, asked: str) -> dict[str, Any]:
    """Return the next points to measure for a fit on the simulated rig, with their expected benefit.

    Raises
    ------
    FitError
        The file is not the fit of a friction map, or the number of points is below 1.
    """
    if asked and not (asked.isdecimal() and 1 <= int(asked) <= MOST_NEXT):
        raise CommandError(f"points = {asked[:20]} is out of bounds", rule=f"1 to {MOST_NEXT}, or none")
    points = int(asked) if asked else None
    fit = FrictionFit.from_toml(workspace.path(path, (".toml",)))
    rig = load_rig(RIG)
    plan = next_measurements(fit, limits_of(fit, rig.identity(), rig.limits()), points=points)
    scales = {name: shown_in(fit.units[name]) for name in plan.half_widths_then}
    python = (
        "import pneudrive as pn\nfrom pneudrive.campaign.planning.next_points import limits_of\n"
        "from pneudrive.identify.static.result import FrictionFit\nfrom pneudrive.rig import load_rig\n\n"
        f"fit, rig = FrictionFit.from_toml({path!r}), load_rig({RIG!r})\n"
        f"plan = pn.next_measurements(fit, limits_of(fit, rig.identity(), rig.limits()), points={points})\n"
        "print(plan)\n"
    )
    return {
        "points": [vars(point) for point in plan.points],
        "seconds": plan.seconds,
        "expected": [
            {
                **_axis(name, scales),
                "now": number(plan.half_widths_now[name] / scales[name][0]),
                "then": number(then / scales[name][0]),
            }
            for name, then in plan.half_widths_then.items()
        ],
        "command": shlex.join(_design_words(path, points)),
        "python": python,
    }


def _design_words(fit: str, points: int | None) -> list[str]:
    return ["pneudrive", "design", safe(fit), "--rig", RIG, *([] if points is None else ["--points", str(points)])]

"""A platform on legs as SVG text, for a notebook and for pages: no script, no style sheet, every text escaped."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report.platform.scene import FONT, LOOKS, platform_scene

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from pneudrive.platforms.kinematics import Platform, Pose

#: Poses of a path that are drawn.
MOST_POSES = 400
#: Colour of a path, at least 3 to 1 against light and dark paper.
PATH = "#d1495b"


def platform_svg(platform: Platform, pose: Pose | None = None, path: ArrayLike | None = None) -> str:
    """Return the drawing of a platform as an SVG element in the colour of the text, on light and on dark paper.

    Parameters
    ----------
    platform : Platform
    pose : mapping or array, optional
        By default the last pose of the path, or else every leg at half of its stroke.
    path : array, shape (m, n), optional
        Poses of a run: the path of the origin of the platform is drawn.

    Examples
    --------
    >>> import pneudrive as pn
    >>> from pneudrive.report.platform.svg import platform_svg
    >>> platform_svg(pn.platform(pn.Circuit.load("examples/tripod.toml")))[:5]
    '<svg '
    """
    rows = np.zeros((0, len(platform.legs))) if path is None else np.atleast_2d(np.asarray(path, dtype=float))
    rows = rows[:: max(1, len(rows) // MOST_POSES)]
    shown = platform.pose(pose) if pose is not None else rows[-1] if len(rows) else platform.home
    scene = platform_scene(platform, np.vstack([rows, shown]))
    body = "".join(_element(what, points[-1]) for what, points in scene.lines)
    body += _element("path", scene.path[:-1]) if len(rows) else ""
    labels = "".join(
        f'<text x="{x:.1f}" y="{y + 0.35 * FONT:.1f}" font-size="{FONT:g}" text-anchor="middle" fill="currentColor" '
        f'stroke="none">{escape(text)}</text>\n'
        for text, (x, y) in scene.labels
    )
    width, height = scene.size
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" role="img" '
        f'aria-label="{escape(platform.name)}" width="{width:.0f}" style="max-width:100%;height:auto" fill="none" '
        f'stroke="currentColor" stroke-linejoin="round">{body}{labels}</svg>'
    )


def _element(what: str, points: NDArray[np.float64]) -> str:
    look = LOOKS[what]
    each = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    style = f' stroke-width="{look.width:g}"'
    style += f' stroke-opacity="{look.opacity:g}"' if look.opacity < 1.0 else ""
    style += f' stroke-dasharray="{" ".join(f"{part:g}" for part in look.dash)}"' if look.dash else ""
    style += f' stroke="{PATH}"' if look.is_path else ""
    style += f' fill="currentColor" fill-opacity="{look.fill:g}"' if look.fill else ""
    return f'<polyline points="{each}"{style}/>'

"""A platform on legs as SVG text: frame, cylinders with pistons, platform and path, in one isometric projection."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import ArrayLike, NDArray

    from pneudrive.platforms.kinematics import Platform, Pose

    Array = NDArray[np.float64]

#: Rows of the projection: x to the lower right, y to the upper right, z up.
VIEW = np.array([[0.866, 0.866, 0.0], [0.35, -0.35, -0.937]])
#: Width of the picture, its margin and the sizes of labels, px.
WIDTH, MARGIN, FONT = 360.0, 30.0, 11.0
#: Distances of a label from its joint that are tried in turn, px, and the angles for each.
DISTANCES, ANGLES = (13.0, 20.0, 28.0), np.radians([0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0])
#: Fraction of the length of a leg at x = 0 that the barrel has if the leg has no stroke.
BARREL = 0.6
#: Poses of a path that are drawn.
MOST_POSES = 400


def platform_lines(platform: Platform, pose: Pose) -> Iterator[tuple[str, Array]]:
    """Yield the lines of a platform at a pose: what each shows, and its points in m.

    The kinds are frame, platform, guide, barrel, rod, piston and arm.
    """
    pose = platform.pose(pose)
    own = platform.evaluate(pose)
    frame, places, directions = (np.asarray(one, dtype=float).reshape(-1, 3) for one in platform.core.joints)
    origin, axes = own["frame"][0][0], own["frame"][0][1:]
    joints = origin + places @ axes
    x = own["positions"][0]
    yield "frame", np.vstack([frame, frame[:1]])
    is_delta = platform.core.coordinates[0] == "x_m" and len(directions) > 0
    for leg, a, joint, i in zip(platform.legs, frame, joints, range(len(x)), strict=True):
        if is_delta:
            stroke = leg.stroke_m if np.isfinite(leg.stroke_m) else max(abs(x[i]), 0.1)
            carriage = a + x[i] * directions[i]
            yield "guide", np.array([a, a + stroke * directions[i]])
            yield "piston", np.array([carriage])
            yield "arm", np.array([carriage, joint])
            continue
        length = float(np.linalg.norm(joint - a))
        along, shortest = (joint - a) / length, length - x[i]
        barrel = min(1.1 * leg.stroke_m if np.isfinite(leg.stroke_m) else BARREL * shortest, 0.95 * shortest)
        head = shortest - barrel
        yield "rod", np.array([a, a + head * along])
        piston = a + min(head + max(x[i], 0.0) + 0.05 * barrel, shortest - 0.02 * barrel) * along
        yield "rod", np.array([piston, joint])
        yield "barrel", np.array([a + head * along, a + shortest * along])
        yield "piston", np.array([piston])
    yield "platform", np.vstack([joints, joints[:1]])


def platform_svg(platform: Platform, pose: Pose | None = None, path: ArrayLike | None = None) -> str:
    """Return the drawing of a platform as an SVG element in the colour of the text.

    Parameters
    ----------
    platform : Platform
    pose : mapping or array, optional
        By default every leg is at half of its stroke.
    path : array, shape (m, n), optional
        Poses of a run: the path of the origin of the platform is drawn.

    Examples
    --------
    >>> import pneudrive as pn
    >>> from pneudrive.report.circuit.platform_svg import platform_svg
    >>> platform_svg(pn.platform(pn.Circuit.load("examples/tripod.toml")))[:5]
    '<svg '
    """
    lines = list(platform_lines(platform, platform.home if pose is None else pose))
    if path is not None:
        rows = np.atleast_2d(np.asarray(path, dtype=float))
        rows = rows[:: max(1, len(rows) // MOST_POSES)]
        lines.append(("path", platform.evaluate(rows)["frame"][:, 0]))
    flat = [points @ VIEW.T for _, points in lines]
    everything = np.vstack(flat)
    low, high = everything.min(axis=0), everything.max(axis=0)
    scale = (WIDTH - 2.0 * MARGIN) / max(high[0] - low[0], 0.8 * (high[1] - low[1]), 1e-9)
    width, height = (high - low) * scale + 2.0 * MARGIN
    drawn = [((what, points), (own - low) * scale + MARGIN) for (what, points), own in zip(lines, flat, strict=True)]
    body = "".join(_element(what, points) for (what, _), points in drawn)
    frame = next(points for (what, _), points in drawn if what == "frame")
    middle = np.array([width, height]) / 2.0
    joints = frame[:-1]
    labels = "".join(
        f'<text x="{x:.1f}" y="{y + 0.35 * FONT:.1f}" font-size="{FONT:g}" text-anchor="middle" fill="currentColor" '
        f'stroke="none">{i}</text>\n'
        for i, (x, y) in enumerate(label_places(joints, middle), start=1)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" role="img" '
        f'aria-label="{escape(platform.name)}" width="{width:.0f}" style="max-width:100%;height:auto" fill="none" '
        f'stroke="currentColor" stroke-width="1.5" stroke-linejoin="round">{body}{labels}</svg>'
    )


def label_places(joints: Array, middle: Array) -> list[Array]:
    """Return the centres of the labels of joints, px: outside the frame, and apart from each other.

    Parameters
    ----------
    joints : ndarray, shape (n, 2)
    middle : ndarray, shape (2,)
    """
    out: list[Array] = []
    for joint in joints:
        outward = joint - middle
        angle = np.arctan2(outward[1], outward[0])
        tried = [
            joint + d * np.array([np.cos(angle + turn), np.sin(angle + turn)]) for d in DISTANCES for turn in ANGLES
        ]
        free = (place for place in tried if all(np.max(np.abs(place - other) / [0.8, 1.1]) > FONT for other in out))
        out.append(next(free, tried[0]))
    return out


def _element(what: str, points: Array) -> str:
    each = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    if what == "piston":
        x, y = points[0]
        return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4" fill="currentColor" stroke="none"/>'
    if what == "platform":
        return f'<polygon points="{each}" fill="currentColor" fill-opacity="0.15" stroke-width="2.5"/>'
    style = {
        "frame": ' stroke-dasharray="5 4" stroke-width="1"',
        "guide": ' stroke-width="9" stroke-opacity="0.25" stroke-linecap="round"',
        "barrel": ' stroke-width="11" stroke-opacity="0.3"',
        "path": ' stroke="#d1495b" stroke-width="1.2"',
        "arm": ' stroke-width="2"',
    }
    return f'<polyline points="{each}"{style.get(what, "")}/>'

"""A platform on legs as lines in one isometric projection, for SVG text, figures and the page."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import ArrayLike, NDArray

    from pneudrive.platforms.kinematics import Platform

    Array = NDArray[np.float64]


#: Rows of the projection: x to the lower right, y to the upper right, z up.
VIEW = np.array([[0.866, 0.866, 0.0], [0.35, -0.35, -0.937]])
#: Width of a picture, its margin and the size of labels, px.
WIDTH, MARGIN, FONT = 360.0, 30.0, 11.0
#: Distances of a label from its joint that are tried in turn, px, and the angles for each.
DISTANCES, ANGLES = (13.0, 19.0, 25.0), np.radians([0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0, 130.0, -130.0])
#: Distance of the centre of a label from the edges of lines, px.
CLEAR = 7.0
#: Fraction of the length of a leg at x = 0 that the barrel has if the leg has no stroke.
BARREL = 0.6
#: Thickness of a piston, as a fraction of its barrel or guide.
PISTON = 0.08


class LineLook(NamedTuple):
    """Look of a line, in the colour of the text.

    Attributes
    ----------
    width : float
        px.
    opacity : float
    dash : sequence of float
        Lengths of dashes and gaps, px; empty for a solid line.
    fill : float
        Opacity of the area inside; 0 for none.
    is_path : bool
        Whether it has the colour of paths.
    """

    width: float
    opacity: float = 1.0
    dash: Sequence[float] = ()
    fill: float = 0.0
    is_path: bool = False


LOOKS = {
    "frame": LineLook(1.0, dash=(5.0, 4.0)),
    "guide": LineLook(11.0, 0.25),
    "barrel": LineLook(11.0, 0.25),
    "rod": LineLook(2.5),
    "piston": LineLook(11.0),
    "arm": LineLook(2.0),
    "path": LineLook(1.6, is_path=True),
    "platform": LineLook(2.5, fill=0.15),
}
#: Colours of text, path and paper on light and on dark paper.
INKS = {"light": ("#111111", "#c2334d", "#ffffff"), "dark": ("#e8eaed", "#ff8095", "#14181d")}


class PlatformScene(NamedTuple):
    """A platform at several poses, in px, y down.

    Attributes
    ----------
    size : tuple of float
        Width and height.
    lines : list of tuple
        What a line shows, a key of `LOOKS`, and its points, shape (m, k, 2). Lines that do not move have m = 1.
    labels : list of tuple
        Text and centre of each label, shape (2,).
    path : ndarray, shape (m, 2)
        Origin of the platform.
    """

    size: tuple[float, float]
    lines: list[tuple[str, Array]]
    labels: list[tuple[str, Array]]
    path: Array


def platform_lines(platform: Platform, poses: ArrayLike) -> Iterator[tuple[str, Array]]:
    """Yield the lines of a platform: the name of the part, and the points, m, shape (m, k, 3), or (1, k, 3) at rest.

    The last line is the path of the origin, shape (m, 1, 3).

    Parameters
    ----------
    platform : Platform
    poses : array, shape (m, n)
    """
    own = platform.evaluate(poses)
    frame, places, directions = (np.asarray(one, dtype=float).reshape(-1, 3) for one in platform.core.joints)
    origin, axes = own["frame"][:, 0], own["frame"][:, 1:]
    joints = origin[:, None] + places @ axes
    yield "frame", frame[None, [*range(len(frame)), 0]]
    for i, leg in enumerate(platform.legs):
        a, joint, x = frame[i], joints[:, i], own["positions"][:, i, None]
        if platform.is_delta:
            stroke = leg.stroke_m if np.isfinite(leg.stroke_m) else max(float(np.max(np.abs(x))), 0.1)
            along, half = directions[i], 0.5 * PISTON * stroke
            yield "guide", np.array([[a, a + stroke * along]])
            yield "piston", np.stack([a + (x - half) * along, a + (x + half) * along], axis=1)
            yield "arm", np.stack([a + x * along, joint], axis=1)
            continue
        length = np.linalg.norm(joint - a, axis=1, keepdims=True)
        along, shortest = (joint - a) / length, float(np.mean(length - x))
        barrel = min(1.1 * leg.stroke_m if np.isfinite(leg.stroke_m) else BARREL * shortest, 0.95 * shortest)
        head = shortest - barrel
        piston = head + np.clip(x + 0.01 * barrel, 0.01 * barrel, (0.99 - PISTON) * barrel)
        at = [a + distance * along for distance in (0.0 * x, head + 0.0 * x, piston, piston + PISTON * barrel)]
        yield "rod", np.stack(at[:2], axis=1)
        yield "rod", np.stack([at[3], joint], axis=1)
        yield "barrel", np.stack([at[1], a + shortest * along], axis=1)
        yield "piston", np.stack(at[2:], axis=1)
    yield "platform", joints[:, [*range(len(frame)), 0]]
    yield "path", origin[:, None]


def platform_scene(platform: Platform, poses: ArrayLike) -> PlatformScene:
    """Return the drawing of a platform at poses, all in one scale.

    Parameters
    ----------
    platform : Platform
    poses : array, shape (m, n)
    """
    lines = [(what, points @ VIEW.T) for what, points in platform_lines(platform, poses)]
    everything = np.concatenate([points.reshape(-1, 2) for _, points in lines])
    low, high = everything.min(axis=0), everything.max(axis=0)
    scale = (WIDTH - 2.0 * MARGIN) / max(high[0] - low[0], 0.8 * (high[1] - low[1]), 1e-9)
    width, height = (high - low) * scale + 2.0 * MARGIN
    *lines, (_, path) = [(what, (points - low) * scale + MARGIN) for what, points in lines]
    seen = sorted({0, len(path) // 2, len(path) - 1})
    segments, halves = [], []
    for what, points in lines:
        own = points[seen] if len(points) > 1 else points
        segments.append(np.stack([own[:, :-1], own[:, 1:]], axis=2).reshape(-1, 2, 2))
        halves.append(np.full(len(segments[-1]), 0.5 * LOOKS[what].width))
    middle = np.array([width, height]) / 2.0
    centres = label_places(lines[0][1][0, :-1], middle, np.concatenate(segments), np.concatenate(halves))
    labels = [(str(i), centre) for i, centre in enumerate(centres, start=1)]
    return PlatformScene((float(width), float(height)), lines, labels, path[:, 0])


def label_places(joints: Array, middle: Array, segments: Array, halves: Array) -> list[Array]:
    """Return the centres of the labels of joints, px: apart from each other, and if possible from the lines.

    Parameters
    ----------
    joints : ndarray, shape (n, 2)
    middle : ndarray, shape (2,)
        Of the picture: labels are outside of their joints.
    segments : ndarray, shape (m, 2, 2)
        Both ends of each line.
    halves : ndarray, shape (m,)
        Half of the width of each line.
    """
    out: list[Array] = []
    for joint in joints:
        outward = joint - middle
        angle = np.arctan2(outward[1], outward[0])
        tried = [
            joint + d * np.array([np.cos(angle + turn), np.sin(angle + turn)]) for d in DISTANCES for turn in ANGLES
        ]
        free = [place for place in tried if all(np.max(np.abs(place - other) / [0.8, 1.1]) > FONT for other in out)]
        clear = (place for place in free if _distance(place, segments, halves) > CLEAR)
        out.append(next(clear, (free or tried)[0]))
    return out


def _distance(place: Array, segments: Array, halves: Array) -> float:
    """Return the distance of a place from the nearest edge of a line."""
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    square = np.maximum(np.sum(along * along, axis=1), 1e-12)
    share = np.clip(np.sum((place - start) * along, axis=1) / square, 0.0, 1.0)
    return float(np.min(np.linalg.norm(start + share[:, None] * along - place, axis=1) - halves))

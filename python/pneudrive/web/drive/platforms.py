"""Platforms of a run for the page: every point of their drawing, projected, and their outputs at the same samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive.platforms import platforms
from pneudrive.platforms.outputs import motion_of, platform_outputs, pose_columns
from pneudrive.report.platform.scene import INKS, LOOKS, platform_scene
from pneudrive.simulation.trajectory import meaning
from pneudrive.units import readable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive

    Array = NDArray[Any]


class SentLine(NamedTuple):
    """A line of a drawing: its look, and its points in px, or their number if they move."""

    width: float
    opacity: float
    dash: list[float]
    fill: float
    points: list[tuple[float, float]]
    moving: int


class SentOutput(NamedTuple):
    """An output of a platform: its column, its name in words, and the unit with its size in SI."""

    column: str
    label: str
    unit: str
    size: float


class SentPlatform(NamedTuple):
    """A platform of a run. The array ``platform/NAME`` has the moving points of each sample, the origin last."""

    name: str
    width: float
    height: float
    lines: list[SentLine]
    labels: list[tuple[str, float, float]]
    path: tuple[str, str]
    outputs: list[SentOutput]


def platform_motion(
    described: Circuit | Drive, columns: Mapping[str, Array], rows: NDArray[np.int64]
) -> tuple[list[dict[str, Any]], dict[str, Array]]:
    """Return the platforms of a run as plain data, and arrays of their points and outputs at some of its samples."""
    sent, arrays = [], {}
    for own in platforms(described):
        pose = pose_columns(own)
        some = {name: np.asarray(columns[name], dtype=np.float64)[rows] for of in pose for name in of}
        outputs = {name: some[name] for name in pose[0]} | platform_outputs(own, some)
        scene = platform_scene(own, motion_of(own, some)[0])
        lines = []
        for what, points in scene.lines:
            look, rests = LOOKS[what], len(points) == 1 < len(rows)
            at_rest = [(float(x), float(y)) for x, y in points[0]] if rests else []
            lines.append(SentLine(*look[:2], list(look.dash), look.fill, at_rest, 0 if rests else points.shape[1]))
        moving = [points for _, points in scene.lines if len(points) == len(rows)]
        arrays[f"platform/{own.name}"] = np.concatenate([*moving, scene.path[:, None]], axis=1).astype("f4").ravel()
        arrays |= {f"motion/{name}": values for name, values in outputs.items()}
        labels = [(text, float(x), float(y)) for text, (x, y) in scene.labels]
        about = [SentOutput(name, *_words(name)) for name in outputs]
        one = SentPlatform(own.name, *scene.size, lines, labels, (INKS["light"][1], INKS["dark"][1]), about)
        plain = {"lines": [line._asdict() for line in lines], "outputs": [output._asdict() for output in about]}
        sent.append(one._asdict() | plain)
    return sent, arrays


def _words(column: str) -> tuple[str, str, float]:
    name, si_unit, _ = meaning(column)
    size, unit = readable(si_unit)
    return name.partition(".")[2].replace("_", " "), unit, size

"""Start poses of platforms: positions of their legs from heave, tilt and place."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.describe.base import Quantity, within, wrong
from pneudrive.errors import DescriptionError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from pneudrive._core import Platform

    Array = NDArray[np.float64]

#: Ends of the names of coordinates in the core.
_METRES = "_m"
_LENGTH, _ANGLE = Quantity("m", "mm"), Quantity("rad", "deg")


def coordinate_keys(platform: Platform) -> list[str]:
    """Return the coordinates as users write them: heave, tilt_1, x."""
    return [name.removesuffix(_METRES) for name in platform.coordinates]


def coordinates(platform: Platform, pose: Array) -> Array:
    """Return the coordinates of the core from places, m, and angles, rad. A tilt is the angle 2 asin(e).

    Parameters
    ----------
    platform : Platform
    pose : array, shape (..., n)
    """
    import numpy as np

    lengths = [name.endswith(_METRES) for name in platform.coordinates]
    return np.where(lengths, pose, np.sin(0.5 * pose))


def angles(platform: Platform, q: Array) -> Array:
    """Return places, m, and angles, rad, from the coordinates of the core."""
    import numpy as np

    lengths = [name.endswith(_METRES) for name in platform.coordinates]
    return np.where(lengths, q, 2.0 * np.arcsin(np.where(lengths, 0.0, q)))


class Poses:
    """Start poses of the platforms of a circuit.

    Parameters
    ----------
    platforms : sequence of Platform
    """

    def __init__(self, platforms: Sequence[Platform]) -> None:
        self.keys = {
            f"{platform.name}.{key}": (platform, k)
            for platform in platforms
            for k, key in enumerate(coordinate_keys(platform))
        }
        self.legs = {f"{leg}.position": platform for platform in platforms for leg in platform.legs}
        self.given: dict[str, dict[int, float]] = {}

    def take(self, table: Mapping[str, object]) -> None:
        """Read the poses of one table. A later table with poses or leg positions replaces those of an earlier one.

        Raises
        ------
        DescriptionError
            A value has another dimension, or a table has both a pose and positions of legs.
        """
        own: dict[str, dict[int, float]] = {}
        for key, value in table.items():
            if key not in self.keys:
                continue
            platform, k = self.keys[key]
            mark = _LENGTH if platform.coordinates[k].endswith(_METRES) else _ANGLE
            try:
                own.setdefault(platform.name, {})[k] = mark.read(value)
            except DescriptionError as error:
                raise within(error, key, "initial.") from None
        for key in table:
            platform = self.legs.get(key)
            if platform is None:
                continue
            if platform.name in own:
                what = f"{key} and a pose of {platform.name} are both given"
                raise wrong(f"initial.{key}", what, rule="a run starts from a pose or from positions of the legs")
            self.given.pop(platform.name, None)
        for name, pose in own.items():
            self.given[name] = self.given.get(name, {}) | pose

    def positions(self, otherwise: Callable[[str], float], stroke: Callable[[str], float | None]) -> dict[str, float]:
        """Return the positions of the legs in the poses, by name.

        Parameters
        ----------
        otherwise : callable
            Default position of a leg, m. Coordinates without a start value follow from the defaults.
        stroke : callable
            Stroke of a leg, m, or None.

        Raises
        ------
        DescriptionError
            A leg would leave its stroke.
        """
        import numpy as np

        out = {}
        for platform in dict.fromkeys(platform for platform, _ in self.keys.values()):
            given = self.given.get(platform.name)
            if given is None:
                continue
            q, _ = platform.locate(np.array([[otherwise(leg) for leg in platform.legs]]))
            pose = angles(platform, np.asarray(q)[0])
            pose[list(given)] = list(given.values())
            q = coordinates(platform, pose)[None]
            positions = platform.evaluate(q, np.zeros_like(q))["positions"][0]
            first = f"initial.{platform.name}.{coordinate_keys(platform)[min(given)]}"
            for leg, x in zip(platform.legs, positions, strict=True):
                longest = stroke(leg)
                if not np.isfinite(x) or (longest is not None and not 0.0 <= x <= longest):
                    what = f"the pose of {platform.name} needs {leg}.position = {1e3 * x:.4g} mm"
                    rule = f"0 mm <= position <= {1e3 * (longest or 0.0):g} mm"
                    raise wrong(first, what, rule=rule)
                out[leg] = float(x)
        return out

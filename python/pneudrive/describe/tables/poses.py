"""Start poses of platforms: positions of their legs from heave, tilt and place."""

from __future__ import annotations

from contextlib import suppress
from math import degrees
from typing import TYPE_CHECKING

from pneudrive.describe.keys import within, wrong
from pneudrive.describe.quantities import Quantity
from pneudrive.errors import DescriptionError

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from pneudrive._core import Platform

    Array = NDArray[np.float64]

#: Ends of the names of coordinates in the core.
_METRES = "_m"
#: Largest residual of a start, m, as in the core. A start with a smaller singular value is rejected (assumed).
CLOSED, SINGULAR = 1e-9, 1e-6
#: Distance from a given coordinate, m or rad, at which a pose is another one (assumed).
SAME = 1e-6
REACHES = "the arm reaches from its carriage to the platform"
NEARER = "Start nearer to half strokes."
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


def start_place(initial: Mapping[str, object], name: str) -> dict[str, float]:
    """Return the numbers of the core for the place of a platform in a start table, m; a wrong value is left out."""
    own = initial.get(name)
    nested = own if isinstance(own, dict) else {}
    found = {}
    for axis in "xyz":
        value = initial.get(f"{name}.{axis}", nested.get(axis))
        with suppress(DescriptionError):  # the start itself names a wrong value
            found |= {} if value is None else {f"near_{axis}": float(_LENGTH.read(value))}
    return found


def pose_text(platform: Platform, pose: Array) -> str:
    """Return places, m, and angles, rad, in words."""
    each = zip(coordinate_keys(platform), pose, platform.coordinates, strict=True)
    shown = (
        (key, 1e3 * value, "mm") if name.endswith(_METRES) else (key, degrees(value), "deg")
        for key, value, name in each
    )
    return ", ".join(f"{key} = {round(value, 6) + 0.0:.4g} {unit}" for key, value, unit in shown)


def singular_values(platform: Platform, q: Array) -> Array:
    """Return the singular values of the pose Jacobian at rows of coordinates of the core, largest first.

    The twist is the velocity of the origin of the platform, and its angular velocity times the mean radius of its
    joints. The values therefore have no unit.
    """
    import numpy as np

    own = platform.evaluate(q, np.zeros_like(q))
    radius = float(np.mean(np.linalg.norm(np.asarray(platform.joints[1]), axis=1)))
    twist = own["twist"] * np.array([1.0, 1.0, 1.0, radius, radius, radius])[:, None]
    triangle = np.linalg.qr(twist, mode="r")
    return np.asarray(np.linalg.svd(own["jacobian"] @ np.linalg.inv(triangle), compute_uv=False), dtype=float)


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
                rule = "a run starts from a pose or from positions of the legs"
                raise wrong(f"initial.{key}", what, rule=rule, remedy="Remove one of the two.")
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
                if not np.isfinite(x):
                    what = f"the arm of {leg} does not reach the pose {pose_text(platform, pose)}"
                    raise wrong(first, what, rule=REACHES, remedy=NEARER)
                if longest is not None and not 0.0 <= x <= longest:
                    what = f"the pose of {platform.name} needs {leg}.position = {1e3 * x:.4g} mm"
                    rule = f"0 mm <= position <= {1e3 * longest:g} mm"
                    raise wrong(first, what, rule=rule, remedy=NEARER)
                out[leg] = float(x)
        return out

    def check(self, positions: Callable[[str], float], given: Collection[str]) -> None:
        """Check that the legs reach the start, and that they hold the platform there.

        Parameters
        ----------
        positions : callable
            Start position of a leg, m.
        given : collection of str
            Keys of the start values that a user has given.

        Raises
        ------
        DescriptionError
            No pose has these positions, or the pose is singular.
        """
        import numpy as np

        for platform in dict.fromkeys(platform for platform, _ in self.keys.values()):
            own = [f"{leg}.position" for leg in platform.legs] + [
                key for key in self.keys if self.keys[key][0] is platform
            ]
            key = next((f"initial.{key}" for key in own if key in given), f"components.{platform.name}")
            x = np.array([[positions(leg) for leg in platform.legs]])
            q, residuals = platform.locate(x)
            found = platform.evaluate(q, np.zeros_like(q))["positions"][0]
            if not np.all(np.isfinite(found)):
                leg = platform.legs[int(np.argmin(np.isfinite(found)))]
                at = f"{leg}.position = {1e3 * positions(leg):.4g} mm"
                what = f"the arm of {leg} does not reach {platform.name} from {at}"
                raise wrong(key, what, rule=REACHES, remedy="Lengthen the arms, or start from other positions.")
            if residuals[0] > CLOSED:
                i = int(np.argmax(np.abs(found - x[0])))
                at = ", ".join(f"{1e3 * one:.6g}" for one in x[0])
                what = f"no pose of {platform.name} has its legs at {at} mm"
                rule = f"in the nearest pose {platform.legs[i]}.position = {1e3 * found[i]:.6g} mm"
                remedy = f"Start from a pose, for instance {next(iter(self.keys))}, or from other positions."
                raise wrong(key, what, rule=rule, remedy=remedy)
            pose = angles(platform, q)[0]
            if any(abs(pose[k] - value) > SAME for k, value in self.given.get(platform.name, {}).items()):
                what = (
                    f"the legs of {platform.name} have the positions of the start also at {pose_text(platform, pose)}"
                )
                is_delta = platform.coordinates[0] == "x_m" and len(platform.joints[2]) > 0
                remedy = f"Write the pose into [initial] of the file, or near = {{ z = ... }} at {platform.name}."
                remedy = remedy if is_delta else NEARER
                raise wrong(key, what, rule="a run starts from the positions of the legs", remedy=remedy)
            least = float(singular_values(platform, q)[0, -1])
            if not least > SINGULAR:
                what = f"the start of {platform.name} is singular: {pose_text(platform, pose)}"
                rule = f"smallest singular value above {SINGULAR:g}, here {least:.1g}"
                remedy = "Start from another pose, or change the joints: here the legs do not hold the platform."
                raise wrong(key, what, rule=rule, remedy=remedy)

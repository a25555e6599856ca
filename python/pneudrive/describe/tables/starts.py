"""Start state of a circuit: given values, and derived values for all others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from math import degrees
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from pneudrive import units
from pneudrive.describe.connections import Joint, Port, Wiring, is_platform
from pneudrive.describe.files.toml import leaves
from pneudrive.describe.marks import NOT_NEGATIVE, POSITIVE, Quantity, StatedPressure, absolute_above_vacuum
from pneudrive.describe.tables.parts import Ambient, Initial
from pneudrive.errors import CommandError, DescriptionError, Problems, invalid, nearest, wrong

if TYPE_CHECKING:
    from pneudrive._core import Circuit as CoreCircuit
    from pneudrive._core import Platform
    from pneudrive.arrays import Array, Keyed, NamedNumbers, Plain
    from pneudrive.describe.components import Component

#: A start state as users give it.
StartState: TypeAlias = "Initial | Keyed | str | None"

# --- Start poses of platforms: positions of their legs from heave, tilt and place.

#: Suffix of the names of coordinates in the core.
_METRES = "_m"
#: Largest residual of a start pose, m, as in the core; smallest accepted singular value of a start pose (assumed).
CLOSED, SINGULAR = 1e-9, 1e-6
#: Deviation from a given coordinate, m or rad, above which a pose counts as different (assumed).
SAME = 1e-6
_LENGTH, _ANGLE = Quantity("m", "mm"), Quantity("rad", "deg")


def coordinate_keys(platform: Platform) -> list[str]:
    """Return the names of the coordinates as users write them, such as heave, tilt_1 and x."""
    return [name.removesuffix(_METRES) for name in platform.coordinates]


def is_length(platform: Platform) -> list[bool]:
    """Return for each coordinate of a platform whether it is a displacement (True) or an angle (False)."""
    return [name.endswith(_METRES) for name in platform.coordinates]


def coordinates(platform: Platform, pose: Array) -> Array:
    """Convert displacements (m) and angles (rad) to coordinates of the core, which has e = sin(angle/2) for an angle.

    Parameters
    ----------
    platform : Platform
    pose : array, shape (..., n)
    """
    return np.where(is_length(platform), pose, np.sin(0.5 * pose))


def angles(platform: Platform, q: Array) -> Array:
    """Convert coordinates of the core to displacements (m) and angles (rad)."""
    lengths = is_length(platform)
    return np.where(lengths, q, 2.0 * np.arcsin(np.where(lengths, 0.0, q)))


def start_place(initial: Keyed, name: str) -> NamedNumbers:
    """Read the start coordinates x, y and z of a platform, in the core's form. Invalid values are left out."""
    given, found = dict(leaves(initial)), {}
    for axis in filter(lambda axis: f"{name}.{axis}" in given, "xyz"):
        with suppress(DescriptionError):  # the start itself names a wrong value
            found[f"near_{axis}"] = float(_LENGTH.read(given[f"{name}.{axis}"]))
    return found


def pose_text(platform: Platform, pose: Array) -> str:
    """Return a pose (m, rad) of a platform as text, in mm and degrees."""
    each = zip(coordinate_keys(platform), pose, is_length(platform), strict=True)
    shown = ((key, 1e3 * value, "mm") if long else (key, degrees(value), "deg") for key, value, long in each)
    return ", ".join(f"{key} = {round(value, 6) + 0.0:.4g} {unit}" for key, value, unit in shown)


def singular_values(platform: Platform, q: Array) -> Array:
    """Return the singular values of the pose Jacobian for each row of the core's coordinates `q`, largest first.

    The angular velocity in the twist is multiplied by the mean radius of the joints. The values therefore have no unit.
    """
    own = platform.evaluate(q, np.zeros_like(q))
    radius = float(np.mean(np.linalg.norm(np.asarray(platform.joints[1]), axis=1)))
    twist = own["twist"] * np.array([1.0, 1.0, 1.0, radius, radius, radius])[:, None]
    triangle = np.linalg.qr(twist, mode="r")
    return np.asarray(np.linalg.svd(own["jacobian"] @ np.linalg.inv(triangle), compute_uv=False), dtype=float)


# --- Start state: given values, and derived values for all others.

PRESSURE, TEMPERATURE, POSITION, VELOCITY = "pressure_pa", "temperature_k", "position_m", "velocity_m_s"
#: Last part of a start value's name in the core -> its key and its annotation.
_MARKS: dict[str, tuple[str, Quantity | StatedPressure]] = {
    PRESSURE: ("pressure", StatedPressure()),
    TEMPERATURE: ("temperature", Quantity("K", "K", POSITIVE)),
    POSITION: ("position", Quantity("m", "mm")),
    VELOCITY: ("velocity", Quantity("m/s", "mm/s")),
    "contact_age_s": ("contact_age", Quantity("s", "s", NOT_NEGATIVE)),
}


class Starts:
    """Start values of a circuit, and start poses of its platforms.

    Parameters
    ----------
    circuit : Circuit
        Circuit. Its start values have their names in the core: ``left.position_m``, ``left.a.pressure_pa``.
    """

    def __init__(self, circuit: Any) -> None:  # noqa: ANN401 - the module of circuits imports this one
        core: CoreCircuit = circuit.system.compiled()
        self.names, self.platforms = core.start_names, core.platforms
        self.components: Mapping[str, Component] = circuit.components
        self.wiring: Wiring = circuit.wiring
        self.ambient: Ambient = circuit.ambient
        #: Coordinate of a platform as users write it -> the platform, and the number of the coordinate.
        self.coordinates = {
            f"{platform.name}.{key}": (platform, k)
            for platform in self.platforms
            for k, key in enumerate(coordinate_keys(platform))
        }
        joints: dict[str, Joint] = {}  # port, or component with gas -> its joint
        for port, joint in self.wiring.at.items():
            joints.setdefault(port.id, joint)
            if port.holds == "volume":
                joints.setdefault(port.component, joint)
        self.keys = {_key(name): name for name in self.names}  # key as users write it -> name in the core
        self.places: dict[str, Joint] = {}  # port or component with a start pressure -> its joint
        for of in (name.removesuffix(f".{PRESSURE}") for name in self.names if name.endswith(f".{PRESSURE}")):
            self.keys[of] = f"{of}.{PRESSURE}"
            if of in joints:
                self.places[of] = joints[of]
                for port in joints[of].ports:  # all ports of the joint name this gas
                    self.keys.setdefault(port.id, f"{of}.{PRESSURE}")
                    for last in (PRESSURE, TEMPERATURE):
                        self.keys.setdefault(_key(f"{port.id}.{last}"), f"{of}.{last}")

    def values(self, *given: Keyed) -> tuple[NamedNumbers, list[str]]:
        """Return all start values in SI, and notes on the assumed values.

        Parameters
        ----------
        *given : mapping
            Tables as users write them, nested or with dotted keys. Later tables override earlier ones.

        Raises
        ------
        DescriptionError
            A key is unknown, or a value is out of bounds or has another dimension.
        """
        tables, problems = [list(leaves(table)) for table in given], Problems()
        known: NamedNumbers = {}
        poses: dict[str, dict[int, float]] = {}
        for table in tables:
            with problems.caught():
                self._take_poses(dict(table), poses)
        for key, value in (entry for table in tables for entry in table if entry[0] not in self.coordinates):
            with problems.caught():
                name = self.keys.get(key)
                if name is None:
                    own = [_key(one) for one in self.names]
                    raise wrong(f"initial.{key}", f"{key} is not a start value", remedy=nearest(key, own))
                known[name] = self._read(key, name, value)
        problems.tell()
        for platform in self.platforms:
            if platform.name in poses:
                known |= self._legs_in(platform, poses[platform.name])
        out, notes = dict(known), list[str]()
        for name in self.names:
            if name not in out:
                of, _, last = name.rpartition(".")
                out[name] = self._pressure(of, known, notes) if last == PRESSURE else self._default(of, last, known)
        for platform in self.platforms:
            self._check_pose(platform, out, poses.get(platform.name, {}), {key for table in tables for key, _ in table})
        return out, notes

    def _take_poses(self, table: Keyed, poses: dict[str, dict[int, float]]) -> None:
        """Read the poses of one table into `poses`: platform -> number of a coordinate -> value in m or rad.

        Poses or leg positions of a later table replace earlier ones.

        Raises
        ------
        DescriptionError
            If a value has another dimension, or a table has both a pose and positions of legs.
        """
        own: dict[str, dict[int, float]] = {}
        for key in filter(self.coordinates.__contains__, table):
            platform, k = self.coordinates[key]
            mark = _LENGTH if is_length(platform)[k] else _ANGLE
            own.setdefault(platform.name, {})[k] = mark.read_at(key, table[key], "initial.")
        legs = {f"{leg}.position": platform for platform in self.platforms for leg in platform.legs}
        for key, platform in ((key, legs[key]) for key in table if key in legs):
            if platform.name in own:
                raise invalid(f"initial.{key}", "describe.pose-and-legs", key=key, platform=platform)
            poses.pop(platform.name, None)
        for name, pose in own.items():
            poses[name] = poses.get(name, {}) | pose

    def _legs_in(self, platform: Platform, given: Mapping[int, float]) -> NamedNumbers:
        """Return the positions of the legs in a pose, in m, by name of their start values.

        Coordinates that are not given follow from the default positions of the legs.

        Raises
        ------
        DescriptionError
            A leg would leave its stroke, or its arm does not reach the pose.
        """
        q, _ = platform.locate(np.array([[self._default(leg, POSITION, {}) for leg in platform.legs]]))
        pose = angles(platform, np.asarray(q)[0])
        pose[list(given)] = list(given.values())
        q = coordinates(platform, pose)[None]
        first = f"initial.{platform.name}.{coordinate_keys(platform)[min(given)]}"
        out: NamedNumbers = {}
        for leg, x in zip(platform.legs, platform.evaluate(q, np.zeros_like(q))["positions"][0], strict=True):
            masses = list(self._moves_with(leg))
            longest = next((stroke for one in masses if (stroke := self._stroke(one)) is not None), None)
            if not np.isfinite(x):
                raise invalid(first, "describe.pose-out-of-reach", leg=leg, pose=pose_text(platform, pose))
            if longest is not None and not 0.0 <= x <= longest:
                raise invalid(
                    first,
                    "describe.pose-outside-stroke",
                    name=platform.name,
                    leg=leg,
                    x_mm=1e3 * x,
                    longest_mm=1e3 * longest,
                )
            out |= {name: float(x) for one in masses if (name := f"{one}.{POSITION}") in self.names}
        return out

    def _check_pose(
        self,
        platform: Platform,
        starts: NamedNumbers,
        pose_given: Mapping[int, float],
        given: set[str],
    ) -> None:
        """Check that the legs reach the start pose, and that the pose is not singular.

        Parameters
        ----------
        platform : Platform
        starts : mapping
            All start values in SI.
        pose_given : mapping
            Given coordinates in m or rad, by index.
        given : set of str
            Keys of the start values that a user has given.

        Raises
        ------
        DescriptionError
            The start positions of the legs fit no pose or more than one pose, or the pose is singular.
        """
        own = [f"{leg}.position" for leg in platform.legs]
        own += [key for key, (guide, _) in self.coordinates.items() if guide is platform]
        key = next((f"initial.{key}" for key in own if key in given), f"components.{platform.name}")
        names = ([f"{one}.{POSITION}" for one in self._moves_with(leg)] for leg in platform.legs)
        x = np.array([[next(starts[name] for name in each if name in starts) for each in names]])
        q, residuals = platform.locate(x)
        found = platform.evaluate(q, np.zeros_like(q))["positions"][0]
        pose = angles(platform, q)[0]
        about = {"name": platform.name, "pose": pose_text(platform, pose)}
        if not np.all(np.isfinite(found)):
            i = int(np.argmin(np.isfinite(found)))
            raise invalid(key, "describe.arm-too-short", leg=platform.legs[i], at_mm=1e3 * x[0, i], **about)
        if residuals[0] > CLOSED:
            i = int(np.argmax(np.abs(found - x[0])))
            raise invalid(
                key,
                "describe.no-such-pose",
                at=", ".join(f"{1e3 * one:.6g}" for one in x[0]),
                leg=platform.legs[i],
                nearest_mm=1e3 * found[i],
                example=next(iter(self.coordinates)),
                **about,
            )
        if any(abs(pose[k] - value) > SAME for k, value in pose_given.items()):
            is_delta = platform.coordinates[0] == "x_m" and len(platform.joints[2]) > 0
            remedy = f"Write the pose in [initial] of the file, or near = {{ z = ... }} in the table {platform.name}."
            raise invalid(key, "describe.second-pose", remedy=remedy if is_delta else None, **about)
        least = float(singular_values(platform, q)[0, -1])
        if not least > SINGULAR:
            raise invalid(key, "describe.singular-start", least=least, bound=SINGULAR, **about)

    def _read(self, key: str, name: str, given: object) -> float:
        of, _, last = name.rpartition(".")
        value = start_mark(last)[1].read_at(key, given, "initial.")
        if isinstance(value, units.Pressure):
            return absolute_above_vacuum(value, self.ambient.pressure_pa, f"initial.{key}", f"{key} = {value}")
        stroke = self._stroke(of) if last == POSITION else None
        if stroke is not None and not 0.0 <= value <= stroke:
            what = f"{key} = {value * 1e3:g} mm is outside the stroke"
            raise wrong(f"initial.{key}", what, rule=f"0 mm <= position <= {of}.stroke = {stroke * 1e3:g} mm")
        return value

    def _stroke(self, of: str) -> float | None:
        return getattr(self.components.get(of), "stroke_m", None)

    def _default(self, of: str, last: str, known: NamedNumbers) -> float:
        """Return the default of a start value: mid stroke, at rest, ambient temperature, or contact age zero.

        A mass without a stroke moves like the mass to which it is coupled.
        """
        for name in self._moves_with(of) if last in (POSITION, VELOCITY) else ():
            if f"{name}.{last}" in known:
                return known[f"{name}.{last}"]
            if self._stroke(name) is not None and f"{name}.{last}" in self.names:
                of = name
                break
        if last == TEMPERATURE:
            return self.ambient.temperature_k
        return 0.5 * (self._stroke(of) or 0.0) if last == POSITION else 0.0

    def _moves_with(self, of: str) -> Iterator[str]:
        """Yield a component or a port, then the components that move with it. The search ends at platforms."""
        found = [of]
        for name in found:  # grows during the loop
            yield name
            if any(name == platform.name for platform in self.platforms):
                continue
            for port in [port for port in self.wiring.at if port.id == name] or self.wiring.ports(name):
                joint = self.wiring.at.get(port) if port.kind == "axis" else None
                found += [one.component for one in joint.ports if one.component not in found] if joint else []

    def _pressure(self, of: str, known: NamedNumbers, notes: list[str]) -> float:
        """Return the start pressure of gas in Pa.

        The nearest known pressure along permanently open paths is used; without one, ambient pressure.
        """
        always = {name for name, one in self.components.items() if one.entry["open"]}
        found = [self.places[of]] if of in self.places else []
        if not found:  # a cell within a component, reached from its first port: the note of the joint covers it
            notes, own = [], of.rpartition(".")[0]
            found = [joint for port, joint in self.wiring.at.items() if port.component == own and own in always][:1]
        starts = {joint: name for name, joint in self.places.items() if f"{name}.{PRESSURE}" in known}
        held: Port | None = None
        for joint in found:  # grows during the loop: nearest first, ending at constant pressures
            if joint in starts:
                value = known[f"{starts[joint]}.{PRESSURE}"]
                notes.append(f"{of} starts at {_bar(value)}, like {starts[joint]}")
                return value
            held = held or next((port for port in joint.ports if port.holds in ("pressure", "set")), None)
            if not joint.is_constant:
                found += [other for other in dict.fromkeys(self.wiring.across(joint, always)) if other not in found]
        if held is None:
            return self.ambient.pressure_pa
        (stated,) = self.components[held.component].pressures()
        value = stated.absolute_pa(self.ambient.pressure_pa)
        notes.append(f"{of} starts at {_bar(value)}, the pressure of {held.component}")
        return value


def _key(name: str) -> str:
    """Return the key of a start value, without its unit."""
    of, _, last = name.rpartition(".")
    return f"{of}.{start_mark(last)[0]}"


def start_mark(last: str) -> tuple[str, Quantity | StatedPressure]:
    """Return the key and the annotation of a start value by the last part of its name.

    A name other than pressure, temperature, position, velocity or age means a number without a unit.
    """
    return _MARKS.get(last, (last, Quantity("")))


def _bar(value: float) -> str:
    return f"{value * 1e-5:.6g} bar abs"


def read_initial(given: StartState) -> Initial | None:
    """Read a start state: an `Initial`, its keys as a dict, or ``"position = 50 mm, pressure_a = 3 bar abs"``.

    Raises
    ------
    CommandError
        The argument has another type, or an entry of a text is not ``key = quantity`` or is repeated.
    DescriptionError
        A key is unknown, or a quantity has another dimension.

    Examples
    --------
    >>> read_initial({"position": "50 mm"}) == read_initial("position = 50 mm")
    True
    """
    if given is None or isinstance(given, Initial):
        return given
    return Initial.model_validate(dict(start_values(given)))


def start_values(given: object) -> Keyed:
    """Read start values of a circuit: a dict, or ``"left.position = 20 mm, tank = 5 bar abs"``.

    Raises
    ------
    CommandError
        The argument has another type, or an entry of a text is not ``key = quantity`` or is repeated.

    Examples
    --------
    >>> start_values("tank = 5 bar abs")
    {'tank': '5 bar abs'}
    """
    if isinstance(given, str):
        entries: dict[str, str] = {}
        for entry in filter(None, map(str.strip, given.split(","))):
            key, equals, value = (part.strip() for part in entry.partition("="))
            if not equals or not value:
                raise CommandError.of("describe.start-without-key", entry=entry)
            if key in entries:
                raise CommandError(f"{key} is given twice in the initial state", remedy="Keep one of them.")
            entries[key] = value
        return entries
    if given is not None and not isinstance(given, Mapping):
        raise CommandError.of("describe.start-not-a-table", name=type(given).__name__)
    return given or {}


def start_table(given: object) -> Keyed:
    """Return a start state of a drive or a circuit as a table, with the given keys and quantities."""
    return given.to_dict() if hasattr(given, "to_dict") else start_values(given)  # type: ignore[union-attr]


def start_state(start: Initial, stroke_m: Any, ambient_pa: Any, ambient_k: Any) -> Plain:  # noqa: ANN401
    """Return a start state in SI, with absolute pressures, by variable. Arrays have one element for each drive.

    Parameters
    ----------
    start : Initial
    stroke_m, ambient_pa, ambient_k : float or ndarray
        Stroke in m, absolute ambient pressure in Pa, and ambient temperature in K.
    """
    state = {
        "position_m": 0.5 * stroke_m if start.position_m is None else start.position_m,
        "velocity_m_s": start.velocity_m_s,
        "contact_age_s": start.contact_age_s,
    }
    for chamber, pressure, temperature in (
        ("a", start.pressure_a, start.temperature_a_k),
        ("b", start.pressure_b, start.temperature_b_k),
    ):
        state[f"pressure_{chamber}_pa"] = ambient_pa if pressure is None else pressure.absolute_pa(ambient_pa)
        state[f"temperature_{chamber}_k"] = ambient_k if temperature is None else temperature
    return state


# --- Checks of platforms: a cylinder at each leg, in the direction of the leg, and possible moments of inertia.

AXES = "xyz"


def check_platforms(wiring: Wiring, components: Keyed, problems: Problems) -> None:
    """Check the platforms of a circuit, and add their errors to `problems`.

    Parameters
    ----------
    wiring : Wiring
    components : mapping
    problems : Problems
    """
    for name, own in components.items():
        if not is_platform(own.entry):
            continue
        for port in wiring.ports(name):
            told = {getattr(one, "key", None) for one in problems.found.values()}
            for problem in _leg_problems(wiring, port, components):
                of_joint = problem.key == wiring.at[port].key
                if of_joint or problem.key not in told:  # copies share one table: its errors are reported once
                    problems.add(problem)
        moments = [getattr(own, f"inertia_{axis}_kg_m2", 0.0) for axis in AXES]
        for axis, moment in zip(AXES, moments, strict=True):
            others = [other for other in AXES if other != axis]
            most = sum(moments) - moment
            if moment > most * (1.0 + 1e-12):
                what = f"{name}.inertia.{axis} = {moment:g} kg m2 is impossible"
                rule = f"{axis} <= {' + '.join(others)} = {most:g} kg m2"
                remedy = "Give the moments of inertia about axes through the centre of mass."
                problems.add(wrong(f"{wiring.parts[name].table}.inertia", what, rule=rule, remedy=remedy))


def _leg_problems(wiring: Wiring, port: Port, components: Keyed) -> Iterator[DescriptionError]:
    """Yield the errors of a leg: no cylinder, two cylinders, an incline of a cylinder."""
    joint = wiring.at.get(port)
    if joint is None:
        return  # reported with the connections
    leg = f"leg {port.name} of {port.component}"
    links = [one for one in joint.ports if sum(port.kind == "axis" for port in wiring.ports(one.component)) == 2]
    names = [one.component for one in joint.ports if one.component in components]
    movers = [name for name in names if any(one["name"] == "position_m" for one in components[name].entry["outputs"])]
    if not movers and not links:
        yield invalid(joint.key, "describe.leg-without-cylinder", leg=leg, name=port.name, id=port.id)
    if len(movers) > 1:
        yield invalid(joint.key, "describe.two-movers", movers=movers[::-1], every=" and ".join(movers), leg=leg)
    for name in movers:
        angle = getattr(components[name], "incline_rad", None) or 0.0
        if angle != 0.0:
            what, rule = f"{name}.incline = {degrees(angle):g} deg", f"the two joints of {leg} define its direction"
            yield wrong(f"{wiring.parts[name].table}.incline", what, rule=rule, remedy="Leave out incline.")

"""Start state of a circuit: given values, and derived values for the rest."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from math import degrees
from typing import TYPE_CHECKING, Any

from pneudrive import units
from pneudrive.describe.connections import Joint, Port, Wiring, is_platform
from pneudrive.describe.files.toml import leaves
from pneudrive.describe.marks import NOT_NEGATIVE, POSITIVE, Quantity, StatedPressure
from pneudrive.errors import CommandError, DescriptionError, Problems, invalid, nearest, within, wrong

if TYPE_CHECKING:
    from pneudrive._core import Platform
    from pneudrive.arrays import Array, Keyed, Plain
    from pneudrive.describe.components import Component
    from pneudrive.describe.tables.parts import Ambient, Initial


# --- Start poses of platforms: positions of their legs from heave, tilt and place.

#: Suffix of the names of coordinates in the core.
_METRES = "_m"
#: Largest residual of a start pose, m, as in the core; smallest accepted singular value of a start pose (assumed).
CLOSED, SINGULAR = 1e-9, 1e-6
#: Deviation from a given coordinate, m or rad, above which a pose counts as different (assumed).
SAME = 1e-6
REACHES = "the arm reaches from its carriage to the platform"
NEARER = "Start nearer to half strokes."
_LENGTH, _ANGLE = Quantity("m", "mm"), Quantity("rad", "deg")


def coordinate_keys(platform: Platform) -> list[str]:
    """Return the coordinates as users write them: heave, tilt_1, x."""
    return [name.removesuffix(_METRES) for name in platform.coordinates]


def coordinates(platform: Platform, pose: Array) -> Array:
    """Convert displacements, m, and angles, rad, to coordinates of the core. A coordinate e means a tilt of 2 asin(e).

    Parameters
    ----------
    platform : Platform
    pose : array, shape (..., n)
    """
    import numpy as np

    lengths = [name.endswith(_METRES) for name in platform.coordinates]
    return np.where(lengths, pose, np.sin(0.5 * pose))


def angles(platform: Platform, q: Array) -> Array:
    """Convert coordinates of the core to displacements, m, and angles, rad."""
    import numpy as np

    lengths = [name.endswith(_METRES) for name in platform.coordinates]
    return np.where(lengths, q, 2.0 * np.arcsin(np.where(lengths, 0.0, q)))


def start_place(initial: Mapping[str, object], name: str) -> dict[str, float]:
    """Read the coordinates of a platform from a start table, in the core's form. Invalid values are left out."""
    own = initial.get(name)
    nested = own if isinstance(own, dict) else {}
    found = {}
    for axis in "xyz":
        value = initial.get(f"{name}.{axis}", nested.get(axis))
        with suppress(DescriptionError):  # the start itself names a wrong value
            found |= {} if value is None else {f"near_{axis}": float(_LENGTH.read(value))}
    return found


def pose_text(platform: Platform, pose: Array) -> str:
    """Return a pose (m, rad) of a platform as text, in mm and degrees."""
    each = zip(coordinate_keys(platform), pose, platform.coordinates, strict=True)
    shown = (
        (key, 1e3 * value, "mm") if name.endswith(_METRES) else (key, degrees(value), "deg")
        for key, value, name in each
    )
    return ", ".join(f"{key} = {round(value, 6) + 0.0:.4g} {unit}" for key, value, unit in shown)


def singular_values(platform: Platform, q: Array) -> Array:
    """Return the singular values of the pose Jacobian at each row of core coordinates, largest first.

    The angular velocity in the twist is multiplied by the mean radius of the joints. The values therefore have no unit.
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
        self.platforms = platforms
        self.keys = {
            f"{platform.name}.{key}": (platform, k)
            for platform in platforms
            for k, key in enumerate(coordinate_keys(platform))
        }
        self.legs = {f"{leg}.position": platform for platform in platforms for leg in platform.legs}
        self.given: dict[str, dict[int, float]] = {}

    def take(self, table: Mapping[str, object]) -> None:
        """Read the poses of one table. Poses or leg positions of a later table replace earlier ones.

        Raises
        ------
        DescriptionError
            If a value has another dimension, or a table has both a pose and positions of legs.
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
                raise invalid(f"initial.{key}", "describe.pose-and-legs", key=key, platform=platform)
            self.given.pop(platform.name, None)
        for name, pose in own.items():
            self.given[name] = self.given.get(name, {}) | pose

    def positions(self, otherwise: Callable[[str], float], stroke: Callable[[str], float | None]) -> dict[str, float]:
        """Return the positions of the legs in the poses, by name.

        Parameters
        ----------
        otherwise : callable
            Default position of a leg, m. Coordinates without a start value follow from these defaults.
        stroke : callable
            Stroke of a leg, m, or None.

        Raises
        ------
        DescriptionError
            A leg would leave its stroke.
        """
        import numpy as np

        out = {}
        for platform in self.platforms:
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
        """Check that the legs reach the start pose, and that the pose is not singular.

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

        for platform in self.platforms:
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
                raise invalid(key, "describe.arm-too-short", leg=leg, name=platform.name, at=at, rule=REACHES)
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
                    f"the start positions of the legs of {platform.name} also fit the pose {pose_text(platform, pose)}"
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
    """Start values of a circuit.

    Parameters
    ----------
    names : sequence of str
        Names in the core: ``left.position_m``, ``left.a.pressure_pa``, ``tank.pressure_pa``.
    components : mapping
    wiring : Wiring
    ambient : Ambient
    platforms : sequence of Platform
    """

    def __init__(
        self,
        names: Sequence[str],
        components: Mapping[str, Component],
        wiring: Wiring,
        ambient: Ambient,
        platforms: Sequence[Platform] = (),
    ) -> None:
        self.names, self.components, self.wiring, self.ambient = names, components, wiring, ambient
        self.platforms = platforms
        self._guides = {platform.name for platform in platforms}
        self.places: dict[str, Joint] = {}  # port or component with gas -> its joint
        self.keys = {_key(name): name for name in names}  # key as users write it -> name in the core
        for name in names:
            of, _, last = name.rpartition(".")
            if last == PRESSURE:
                self.keys[of] = name
                self._place(of)

    def _place(self, of: str) -> None:
        """Find the joint to which a start value of gas applies, and add the names of all ports of the joint."""
        for port, joint in self.wiring.at.items():
            if of == port.id or (of == port.component and port.holds == "volume"):
                self.places[of] = joint
                for other in joint.ports:
                    for last in (PRESSURE, TEMPERATURE):
                        self.keys.setdefault(_key(f"{other.id}.{last}"), f"{of}.{last}")
                    self.keys.setdefault(other.id, f"{of}.{PRESSURE}")
                return

    def values(self, *given: Keyed) -> tuple[dict[str, float], list[str]]:
        """Return all start values in SI, and notes on the assumed ones.

        Parameters
        ----------
        *given : mapping
            Tables as users write them, nested or with dotted keys. Later tables override earlier ones.

        Raises
        ------
        DescriptionError
            A key is unknown, or a value does not fit.
        """
        known: dict[str, float] = {}
        problems = Problems()
        poses = Poses(self.platforms)
        for table in given:
            with problems.caught():
                poses.take(dict(leaves(table)))
        for key, value in (entry for table in given for entry in leaves(table)):
            if key in poses.keys:
                continue
            with problems.caught():
                name = self.keys.get(key)
                if name is None:
                    own = [_key(one) for one in self.names]
                    raise wrong(f"initial.{key}", f"{key} is not a start value", remedy=nearest(key, own))
                known[name] = self._read(key, name, value)
        problems.tell()
        notes: list[str] = []
        for leg, x in poses.positions(lambda leg: self._moved(leg, POSITION, {}), self._stroke_of_leg).items():
            known |= {name: x for own in self._moves_with(leg) if (name := f"{own}.{POSITION}") in self.names}
        out = dict(known)
        for name in self.names:
            if name not in out:
                of, _, last = name.rpartition(".")
                if last == PRESSURE:
                    out[name] = self._pressure(of, known, notes)
                else:
                    moves = last in (POSITION, VELOCITY)
                    out[name] = self._moved(of, last, known) if moves else self._otherwise(of, last)
        given_keys = {key for table in given for key, _ in leaves(table)}
        poses.check(
            lambda leg: next(out[n] for own in self._moves_with(leg) if (n := f"{own}.{POSITION}") in out), given_keys
        )
        return out, notes

    def _read(self, key: str, name: str, given: object) -> float:
        of, _, last = name.rpartition(".")
        try:
            value = start_mark(last)[1].read(given)
        except DescriptionError as error:
            raise within(error, key, "initial.") from None
        if isinstance(value, units.Pressure):
            absolute = value.absolute_pa(self.ambient.pressure_pa)
            if not absolute > 0.0:
                raise wrong(f"initial.{key}", f"{key} = {value} is below vacuum", rule="gauge + ambient > 0")
            return absolute
        stroke = self._stroke(of) if last == POSITION else None
        if stroke is not None and not 0.0 <= value <= stroke:
            what = f"{key} = {value * 1e3:g} mm lies outside the stroke"
            raise wrong(f"initial.{key}", what, rule=f"0 mm <= position <= {of}.stroke = {stroke * 1e3:g} mm")
        return value

    def _stroke(self, of: str) -> float | None:
        return getattr(self.components.get(of), "stroke_m", None)

    def _stroke_of_leg(self, leg: str) -> float | None:
        """Return the stroke of the cylinder at a leg, joined directly or by a coupling."""
        return next((stroke for name in self._moves_with(leg) if (stroke := self._stroke(name)) is not None), None)

    def _otherwise(self, of: str, last: str) -> float:
        """Return the default of a start value: mid stroke, at rest, ambient temperature, or contact age zero."""
        if last == TEMPERATURE:
            return self.ambient.temperature_k
        return 0.5 * (self._stroke(of) or 0.0) if last == POSITION else 0.0

    def _moved(self, of: str, last: str, known: Mapping[str, float]) -> float:
        """Return position or velocity of a mass.

        A mass without a stroke moves like the mass to which it is coupled.
        """
        for name in self._moves_with(of):
            if f"{name}.{last}" in known:
                return known[f"{name}.{last}"]
            if self._stroke(name) is not None and f"{name}.{last}" in self.names:
                return self._otherwise(name, last)
        return self._otherwise(of, last)

    def _moves_with(self, of: str) -> Iterator[str]:
        """Yield a component or a port, and the components coupled with it. A platform does not couple components."""
        found = [of]
        for name in found:  # grows during the loop
            yield name
            if name in self._guides:
                continue
            for port in [port for port in self.wiring.at if port.id == name] or self.wiring.ports(name):
                joint = self.wiring.at.get(port) if port.kind == "axis" else None
                found += [one.component for one in joint.ports if one.component not in found] if joint else []

    def _pressure(self, of: str, known: Mapping[str, float], notes: list[str]) -> float:
        """Return the settled pressure of gas: the nearest known pressure along paths that are always open."""
        if of not in self.places:
            notes = []  # of a cell within a component: the note of the joint covers it
        starts = {joint: name for name, joint in self.places.items() if f"{name}.{PRESSURE}" in known}
        held: Port | None = None
        for joint in self._reached(self.places.get(of) or self._before(of)):
            if joint in starts:
                value = known[f"{starts[joint]}.{PRESSURE}"]
                notes.append(f"{of} starts at {_bar(value)}, like {starts[joint]}")
                return value
            held = held or next((port for port in joint.ports if port.holds in ("pressure", "set")), None)
        if held is None:
            return self.ambient.pressure_pa
        (stated,) = self.components[held.component].pressures()
        value = stated.absolute_pa(self.ambient.pressure_pa)
        notes.append(f"{of} starts at {_bar(value)}, the pressure of {held.component}")
        return value

    def _before(self, cell: str) -> Joint | None:
        """Return the joint at the first port of a component with a gas volume, if the path to it is always open."""
        own = cell.rpartition(".")[0]
        if own not in self.components or not self.components[own].entry["open"]:
            return None
        return next((joint for port, joint in self.wiring.at.items() if port.component == own), None)

    def _reached(self, first: Joint | None) -> Iterator[Joint]:
        """Yield the joints along paths that are always open, nearest first, ending at constant pressures."""
        always = {name for name, one in self.components.items() if one.entry["open"]}
        found = [] if first is None else [first]
        for joint in found:  # grows during the loop
            yield joint
            if not joint.is_constant:
                found += [other for other in dict.fromkeys(self.wiring.across(joint, always)) if other not in found]


def _key(name: str) -> str:
    """Return the key of a start value, without its unit."""
    of, _, last = name.rpartition(".")
    return f"{of}.{start_mark(last)[0]}"


def start_mark(last: str) -> tuple[str, Quantity | StatedPressure]:
    """Return the key and the annotation of a start value by the last part of its name. The default is a pure number."""
    return _MARKS.get(last, (last, Quantity("")))


def _bar(value: float) -> str:
    return f"{value * 1e-5:.6g} bar abs"


def read_initial(given: Initial | Mapping[str, object] | str | None) -> Initial | None:
    """Read a start state: an `Initial`, its keys as a dict, or ``"position = 50 mm, pressure_a = 3 bar abs"``.

    Raises
    ------
    CommandError
        The argument has another type, or an entry of a text is not ``key = quantity`` or is repeated.
    DescriptionError
        Unknown key, or a quantity of another dimension.

    Examples
    --------
    >>> read_initial({"position": "50 mm"}) == read_initial("position = 50 mm")
    True
    """
    from pneudrive.describe.tables.parts import Initial

    if given is None or isinstance(given, Initial):
        return given
    return Initial.model_validate(dict(start_values(given)))


def start_values(given: object) -> Mapping[str, object]:
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
    given = _entries(given) if isinstance(given, str) else given
    if given is not None and not isinstance(given, Mapping):
        raise CommandError.of("describe.start-not-a-table", name=type(given).__name__)
    return given or {}


def start_table(given: object) -> Mapping[str, object]:
    """Return a start state of a drive or a circuit as a table, in the form in which it was given."""
    return given.to_dict() if hasattr(given, "to_dict") else start_values(given)  # type: ignore[union-attr]


def _entries(text: str) -> dict[str, str]:
    """Read ``key = quantity`` entries into a dict."""
    given: dict[str, str] = {}
    for entry in filter(None, map(str.strip, text.split(","))):
        key, equals, value = (part.strip() for part in entry.partition("="))
        if not equals or not value:
            raise CommandError.of("describe.start-without-key", entry=entry)
        if key in given:
            raise CommandError(f"{key} is given twice in the initial state", remedy="Keep one of them.")
        given[key] = value
    return given


def start_state(start: Initial, stroke_m: Any, ambient_pa: Any, ambient_k: Any) -> Plain:  # noqa: ANN401
    """Return a start state in SI, with absolute pressures, by the names of a drive. Arrays describe many drives.

    Parameters
    ----------
    start : Initial
    stroke_m, ambient_pa, ambient_k : float or ndarray
        Stroke, m, and ambient pressure, Pa absolute, and temperature, K.
    """

    def or_else(value: float | None, otherwise: Any) -> Any:  # noqa: ANN401
        return otherwise if value is None else value

    state = {
        "position_m": or_else(start.position_m, 0.5 * stroke_m),
        "velocity_m_s": start.velocity_m_s,
        "contact_age_s": start.contact_age_s,
    }
    for chamber, pressure, temperature in (
        ("a", start.pressure_a, start.temperature_a_k),
        ("b", start.pressure_b, start.temperature_b_k),
    ):
        state[f"pressure_{chamber}_pa"] = ambient_pa if pressure is None else pressure.absolute_pa(ambient_pa)
        state[f"temperature_{chamber}_k"] = or_else(temperature, ambient_k)
    return state


# --- Checks of platforms: a cylinder at each leg, in the direction of the leg, and possible moments of inertia.

AXES = "xyz"


def check_platforms(wiring: Wiring, components: Keyed, keys: Mapping[str, str], problems: Problems) -> None:
    """Add the errors of platforms to `problems`.

    Parameters
    ----------
    wiring : Wiring
    components : mapping
    keys : mapping
        Component -> its key in the file.
    problems : Problems
    """
    for name, own in components.items():
        if not is_platform(own.entry):
            continue
        for port in wiring.ports(name):
            with problems.caught():
                _check_mover(wiring, port, components)
            told = {getattr(one, "key", None) for one in problems.found.values()}
            for problem in _inclined(wiring, port, components, keys):
                if problem.key not in told:  # copies have one table
                    problems.add(problem)
        moments = [getattr(own, f"inertia_{axis}_kg_m2", 0.0) for axis in AXES]
        for axis, moment in zip(AXES, moments, strict=True):
            others = [other for other in AXES if other != axis]
            most = sum(moments) - moment
            if moment > most * (1.0 + 1e-12):
                what = f"{name}.inertia.{axis} = {moment:g} kg m2 is impossible"
                rule = f"{axis} <= {' + '.join(others)} = {most:g} kg m2"
                remedy = "Give the moments of inertia about axes through the centre of mass."
                problems.add(wrong(f"{_table(keys[name])}.inertia", what, rule=rule, remedy=remedy))


def _movers(wiring: Wiring, port: Port, components: Keyed) -> list[str]:
    """Return the components with an axis at a leg."""
    names = [one.component for one in wiring.at[port].ports if one.component in components] if port in wiring.at else []
    return [name for name in names if any(one["name"] == "position_m" for one in components[name].entry["outputs"])]


def _check_mover(wiring: Wiring, port: Port, components: Keyed) -> None:
    joint = wiring.at.get(port)
    if joint is None:
        return  # reported with the connections
    links = [one for one in joint.ports if sum(port.kind == "axis" for port in wiring.ports(one.component)) == 2]
    movers, leg = _movers(wiring, port, components), f"leg {port.name} of {port.component}"
    if not movers and not links:
        raise invalid(joint.key, "describe.leg-without-cylinder", leg=leg, name=port.name, id=port.id)
    if len(movers) > 1:
        raise invalid(joint.key, "describe.two-movers", movers=movers[::-1], every=" and ".join(movers), leg=leg)


def _inclined(wiring: Wiring, port: Port, components: Keyed, keys: Mapping[str, str]) -> Iterator[DescriptionError]:
    for name in _movers(wiring, port, components):
        angle = getattr(components[name], "incline_rad", None) or 0.0
        if angle != 0.0:
            rule = f"the two joints of leg {port.name} of {port.component} define its direction"
            what = f"{name}.incline = {degrees(angle):g} deg"
            yield wrong(f"{_table(keys[name])}.incline", what, rule=rule, remedy="Leave out incline.")


def _table(key: str) -> str:
    """Return the key of the table of a component, or of the original of a copy."""
    return key.partition(".copies")[0]

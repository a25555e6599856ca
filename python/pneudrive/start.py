"""Start of a simulation: a description in the core's form, its start state in SI, and its session."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any, cast

from pneudrive.errors import CommandError, DescriptionError
from pneudrive.session import Session, short_name

if TYPE_CHECKING:
    from collections.abc import Sequence

    from typing_extensions import TypeIs

    from pneudrive._core import Circuit as CoreCircuit
    from pneudrive._core import Drive as CoreDrive
    from pneudrive._core import Session as CoreSession
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.describe.parts import Initial

RTOL_BOUNDS = (1e-13, 1e-1)


def start(
    described: Drive | Circuit, initial: Initial | Mapping[str, object] | str | None = None, rtol: float = 1e-6
) -> Session:
    """Start a session of a drive or a circuit; see `Drive.start` and `Circuit.start`."""
    check_tolerance(rtol)
    core, state = ready(described, initial)
    session = core.start(state, rtol)
    is_short = not is_circuit(described) and described.runs_as_circuit
    return Session(cast("CoreSession", _Short(session)) if is_short else session)


def ready(described: Drive | Circuit, initial: Any) -> tuple[CoreDrive | CoreCircuit, dict[str, float]]:  # noqa: ANN401
    """Return the core's form of a drive or a circuit, and the start state in SI; some drives run as their circuit.

    Raises
    ------
    CommandError, DescriptionError
        The start state is not valid, or does not fit the drive.
    """
    if is_circuit(described):
        from pneudrive.describe.circuit import compiled as compiled_circuit

        return compiled_circuit(described.core_json()), described.core_initial(start_values(initial))
    given = read_initial(initial)
    if described.runs_as_circuit:
        from pneudrive.describe.circuit import compiled as compiled_circuit

        return compiled_circuit(described.circuit.core_json()), described.circuit_initial(given)
    return compiled(described.core_json()), described.core_initial(given)


class _Short:
    """Session of a drive's circuit with the names of a drive."""

    def __init__(self, core: CoreSession) -> None:
        self._core = core
        self._names = {short_name(name): name for name in (*(i[0] for i in core.inputs), *core.columns)}

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - any attribute of the core's session
        return getattr(self._core, name)

    def _full(self, name: str) -> str:
        return self._names.get(name, "") if isinstance(name, str) else name

    @property
    def inputs(self) -> list[tuple[str, str, str, str]]:
        return [(short_name(name), unit, bounds, what) for name, unit, bounds, what in self._core.inputs]

    @property
    def columns(self) -> list[str]:
        return [short_name(name) for name in self._core.columns]

    @property
    def states(self) -> list[tuple[str, str]]:
        return [(short_name(name), unit) for name, unit in self._core.states]

    def set(self, name: str, value: float) -> None:
        self._core.set(self._full(name), value)

    def read(self, name: str) -> float:
        return self._core.read(self._full(name))

    def schedule(self, name: str, *entries: Any) -> None:  # noqa: ANN401 - times and values
        self._core.schedule(self._full(name), *entries)

    def linearise(self, names: Sequence[str]) -> Any:  # noqa: ANN401 - the core's own type
        return self._core.linearise([self._full(name) for name in names])


def is_circuit(described: Drive | Circuit) -> TypeIs[Circuit]:
    """Return whether a description is a circuit, without importing its class."""
    return hasattr(described, "wiring")


def circuit_of(described: Drive | Circuit) -> Circuit:
    """Return the circuit of a drive; a circuit unchanged."""
    return described if is_circuit(described) else described.circuit


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
    from pneudrive.describe.parts import Initial

    if given is None or isinstance(given, Initial):
        return given
    if isinstance(given, str):
        given = _entries(given)
    if not isinstance(given, Mapping):
        raise CommandError(
            f"the initial state is a {type(given).__name__}",
            remedy='Give {"position": "50 mm"}, "position = 50 mm" or pn.Initial(position="50 mm").',
        )
    return Initial.model_validate(dict(given))


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
        remedy = 'Give {"left.position": "20 mm"} or "left.position = 20 mm".'
        raise CommandError(f"the initial state is a {type(given).__name__}", remedy=remedy)
    return given or {}


def start_table(given: object) -> Mapping[str, object]:
    """Return a start state of a drive or a circuit as the table in which it was given."""
    return given.to_dict() if hasattr(given, "to_dict") else start_values(given)  # type: ignore[union-attr]


def _entries(text: str) -> dict[str, str]:
    """Read ``key = quantity`` entries into a dict."""
    given: dict[str, str] = {}
    for entry in filter(None, map(str.strip, text.split(","))):
        key, equals, value = (part.strip() for part in entry.partition("="))
        if not equals or not value:
            raise CommandError(
                f'"{entry}" in the initial state is not key = quantity', remedy='For instance "position = 50 mm".'
            )
        if key in given:
            raise CommandError(f"{key} is given twice in the initial state", remedy="Keep one of them.")
        given[key] = value
    return given


def check_tolerance(rtol: float) -> None:
    """Raise an error for a relative tolerance that no simulation can keep."""
    low, high = RTOL_BOUNDS
    if isinstance(rtol, (bool, str)) or not low <= rtol <= high:
        raise CommandError(f"rtol = {rtol} is out of bounds", rule=f"{low:g} <= rtol <= {high:g}")


@lru_cache(maxsize=256)
def compiled(core_json: str) -> CoreDrive:
    """Return the core's form of a drive; each description is compiled once.

    Raises
    ------
    DescriptionError
        The core rejects the description.
    """
    from pneudrive import _core

    try:
        return _core.Drive(core_json)
    except ValueError as error:
        raise DescriptionError(str(error)) from None

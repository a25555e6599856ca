"""Compiled core, defined in `crates/python`. All values are in SI. Pressures are absolute unless a name says gauge."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, NotRequired, TypedDict, final, type_check_only

from numpy import bool_, float64, int64, uint8
from numpy.typing import NDArray

__all__ = [
    "Circuit",
    "ControlReference",
    "ControlSensors",
    "Ensemble",
    "Members",
    "Platform",
    "Session",
    "bin_means",
    "choked_flow_factor",
    "close_step",
    "components",
    "constants",
    "control_events",
    "control_export",
    "control_factors",
    "control_feasibility",
    "control_laws",
    "control_run",
    "control_signals",
    "control_thresholds",
    "control_tune",
    "dwell_growth",
    "flow_ratio",
    "formula_component",
    "formula_law",
    "friction_laws",
    "reference_at",
    "seal_factors",
    "seal_warming",
    "steady_friction",
    "steady_friction_sensitivity",
    "turning_points",
    "valve_openings",
]

@type_check_only
class Impact(TypedDict):
    time_s: float
    end: Literal["a", "b"]
    speed_m_s: float
    energy_j: float
    depth_m: float
    peak_force_n: float

@type_check_only
class Result(TypedDict):
    columns: dict[str, NDArray[float64]]
    statistics: dict[str, int]
    ledger: dict[str, Any] | None
    impacts: list[Impact]

@type_check_only
class SimulationResult(Result):
    warnings: list[str]
    citations: list[str]

@type_check_only
class Shooting(TypedDict):
    times: Sequence[float] | NDArray[float64]
    commands: Sequence[float] | NDArray[float64]
    others: NotRequired[Sequence[tuple[str, Sequence[float], Sequence[float]]]]
    sample_times: Sequence[float] | NDArray[float64]
    starts: Sequence[int]
    initial: NDArray[float64]
    parameters: NotRequired[Sequence[str]]
    with_initial: NotRequired[bool | Sequence[int] | Sequence[Sequence[int]]]
    outputs: Sequence[str]
    rtol: float
    threads: NotRequired[int]

@type_check_only
class Shot(TypedDict):
    values: NDArray[float64]
    sensitivities: NDArray[float64]
    ends: NDArray[float64]
    end_sensitivities: NDArray[float64]
    failures: list[str | None]

@type_check_only
class Output(TypedDict):
    column: str
    what: Literal["final", "max", "min", "mean", "integral", "time_when", "rate_when", "samples"]
    value: NotRequired[float | None]  # what time_when and rate_when compare with; the rate of samples, 1/s
    above: NotRequired[bool]  # of time_when and rate_when: whether the column must rise above the value

@type_check_only
class Request(TypedDict):
    values: NDArray[float64]
    plans: Sequence[tuple[str, Sequence[float], NDArray[float64]]]
    duration: NDArray[float64]
    initial: NDArray[float64]
    outputs: Sequence[Output]
    rtol: float
    contact_age_s: NotRequired[float]
    threads: NotRequired[int]
    budget: NotRequired[int | None]
    kernel: NotRequired[Literal["scalar", "four", "eight"] | None]

@type_check_only
class Outcome(TypedDict):
    outputs: list[NDArray[float64]]
    status: NDArray[uint8]
    reasons: dict[int, str]
    attempts: int

@final
class Ensemble:
    def __new__(
        cls, json: str, vary: Sequence[str], names: tuple[str, Sequence[tuple[str, str]], bool] | None = None
    ) -> Ensemble: ...
    @property
    def names(self) -> list[str]: ...
    @property
    def inputs(self) -> list[str]: ...
    @property
    def columns(self) -> list[str]: ...
    @property
    def start_names(self) -> list[str]: ...
    def run(self, asked: Request, look: Callable[[float], object] | None = None) -> Outcome: ...

@final
class ControlReference:
    def __new__(cls, motion: str) -> ControlReference: ...
    def at(self, t: float) -> tuple[float, float, float, float]: ...

@final
class ControlSensors:
    def __new__(cls, setup: str) -> ControlSensors: ...
    def sample(self, tick: int, period: float, truth: Sequence[float]) -> tuple[float, tuple[float, float] | None]: ...

@final
@type_check_only
class Linear(TypedDict):
    a: NDArray[float64]
    b: NDArray[float64]
    c: NDArray[float64]
    d: NDArray[float64]
    columns: list[int]
    state: NDArray[float64]
    rates: NDArray[float64]
    outputs: NDArray[float64]

@final
class Session:
    @property
    def time(self) -> float: ...
    @property
    def failed(self) -> str | None: ...
    @property
    def statistics(self) -> dict[str, int]: ...
    @property
    def inputs(self) -> list[tuple[str, str, str, str]]: ...
    @property
    def columns(self) -> list[str]: ...
    @property
    def states(self) -> list[tuple[str, str]]: ...
    @property
    def state(self) -> list[float]: ...
    def set(self, name: str, value: float) -> None: ...
    def schedule(self, name: str, times: Sequence[float], values: Sequence[float]) -> None: ...
    def advance(self, until: float, look: Callable[[float], object] | None = None) -> None: ...
    def record(
        self,
        until: float,
        times: Sequence[float] | NDArray[float64],
        columns: Sequence[str],
        look: Callable[[float], object] | None = None,
    ) -> Result: ...
    def control(
        self,
        controller: Callable[..., float],
        address: int,
        period: float,
        periods: int,
        columns: Sequence[str],
        command: str,
        look: Callable[[float], object] | None = None,
    ) -> tuple[NDArray[float64], BaseException | None]: ...
    def read(self, name: str) -> float: ...
    def save(self) -> bytes: ...
    def restore(self, saved: bytes) -> None: ...
    def linearise(self, inputs: Sequence[str]) -> Linear: ...
    def try_velocity(self, velocity: float, until: float) -> float: ...
    def velocity_slope(self, velocity: float, until: float) -> tuple[float, float]: ...
    def accept(self) -> None: ...

def close_step(
    sessions: Sequence[Session],
    until: float,
    mechanics: Sequence[Sequence[float]],
    velocities: Sequence[float],
    slopes: Sequence[float],
    known: Sequence[float] = ...,
) -> tuple[list[float], list[float], list[float], int]: ...

@type_check_only
class Port(TypedDict):
    name: str
    kind: Literal["gas", "axis", "pilot"]
    holds: Literal["", "volume", "pressure", "set", "motion"]
    exhaust: bool
    optional: bool

@type_check_only
class ComponentColumn(TypedDict):
    key: str
    unit: str
    meaning: str
    rule: str
    lower: float
    upper: float
    open: bool
    open_above: bool
    default: float | None

@type_check_only
class ComponentParameter(ComponentColumn):
    assumed: str
    follows: str
    unless: str
    within: str
    only: str
    was: str

@type_check_only
class ComponentPoints(TypedDict):
    key: str
    optional: bool
    columns: list[ComponentColumn]
    most: int

@type_check_only
class ComponentChoice(TypedDict):
    name: str
    meaning: str
    options: list[str]

@type_check_only
class ComponentVariable(TypedDict):
    name: str
    unit: str
    meaning: str

@type_check_only
class ComponentFormula(TypedDict):
    output: str
    unit: str
    names: list[ComponentVariable]

@type_check_only
class ComponentSymbol(TypedDict):
    strokes: list[Any]
    when: list[tuple[str, list[Any]]]
    ports: list[list[float]]

@type_check_only
class Component(TypedDict):
    kind: str
    title: str
    doc: str
    sources: list[str]
    ports: list[Port]
    parameters: list[ComponentParameter]
    choices: list[ComponentChoice]
    formula: ComponentFormula | None
    points: ComponentPoints | None
    open: bool
    friction: bool
    inputs: list[ComponentVariable]
    outputs: list[ComponentVariable]
    symbol: ComponentSymbol

def components() -> list[Component]: ...

@final
class Circuit:
    def __new__(cls, json: str, names: tuple[str, Sequence[tuple[str, str]], bool] | None = None) -> Circuit: ...
    @property
    def inputs(self) -> list[tuple[str, str, str, str]]: ...
    @property
    def columns(self) -> list[str]: ...
    @property
    def joint_volumes(self) -> list[tuple[str, float]]: ...
    def end_stops(self, start: float) -> dict[str, tuple[list[float], list[float]]]: ...
    @property
    def start_names(self) -> list[str]: ...
    @property
    def segment_names(self) -> list[str]: ...
    @property
    def platforms(self) -> list[Platform]: ...
    @property
    def states(self) -> list[tuple[str, str]]: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def citations(self) -> list[str]: ...
    def start(self, start: Mapping[str, float] | Sequence[float], rtol: float) -> Session: ...
    def members(self, names: Sequence[str], values: NDArray[float64]) -> Members: ...
    def chambers(self, states: NDArray[float64]) -> NDArray[float64]: ...
    def along(
        self,
        times: NDArray[float64],
        position: NDArray[float64],
        velocity: NDArray[float64],
        pressure_a: NDArray[float64],
        pressure_b: NDArray[float64],
        openings: NDArray[float64],
        temperatures: Sequence[float],
    ) -> dict[str, NDArray[float64]]: ...
    def shoot(self, command: str | None, asked: Shooting, look: Callable[[float], object] | None = None) -> Shot: ...
    def simulate(
        self,
        plans: Sequence[tuple[str, Sequence[float], Sequence[float]]],
        duration: float,
        sample_rate: float,
        start: Mapping[str, float],
        rtol: float,
        ledger: bool = False,
        budget: int | None = None,
        look: Callable[[float], object] | None = None,
    ) -> SimulationResult: ...

@final
class Platform:
    @property
    def name(self) -> str: ...
    @property
    def coordinates(self) -> list[str]: ...
    @property
    def legs(self) -> list[str]: ...
    @property
    def joints(self) -> list[list[list[float]]]: ...
    @property
    def masses(self) -> list[tuple[str, list[float]]]: ...
    def evaluate(self, q: NDArray[float64], u: NDArray[float64]) -> dict[str, NDArray[float64]]: ...
    def locate(
        self, x: NDArray[float64], near: NDArray[float64] | None = None
    ) -> tuple[NDArray[float64], NDArray[float64]]: ...

@final
class Members:
    def __len__(self) -> int: ...
    def start(self, member: int, start: Mapping[str, float], rtol: float) -> Session: ...

def flow_ratio(pressure_ratio: float, critical_pressure_ratio: float, subsonic_index: float) -> float: ...
def choked_flow_factor(heat_capacity_ratio: float) -> float: ...
def constants() -> dict[str, float]: ...
def control_events() -> list[tuple[str, str, str]]: ...
def control_export(
    spec: str, setup: str, language: Literal["c", "c-single", "st"], about: str, name: str | None
) -> tuple[list[tuple[str, str]], list[tuple[str, str, str, str, float]]]: ...
def control_laws() -> list[str]: ...
def control_thresholds() -> list[tuple[str, str, str, str, str]]: ...
def control_factors() -> list[tuple[str, str, str]]: ...
def control_tune(
    spec: str, deviation: float
) -> tuple[dict[str, Any], list[list[tuple[str, str, float, str, str]]]]: ...
def reference_at(motion: str, times: NDArray[float64]) -> NDArray[float64]: ...
def control_feasibility(
    spec: str, motion: str, duration: float, share: float
) -> tuple[dict[str, float], float | None]: ...
def control_run(
    circuit: Circuit,
    start: Mapping[str, float],
    axes: list[tuple[str, str, str]],
    outputs: list[str],
    duration: float,
    rtol: float,
    look: Callable[[float], object] | None = None,
    own: tuple[Callable[[tuple[float, ...]], float], list[str]] | None = None,
) -> tuple[list[dict[str, Any]], NDArray[float64], float]: ...
def control_signals() -> list[tuple[str, str, str]]: ...
def dwell_growth(growth: str, age: NDArray[float64], time: float, exponent: float) -> NDArray[float64]: ...
def friction_laws() -> list[dict[str, Any]]: ...
def formula_component(kind: str, json: str) -> dict[str, Any]: ...
def formula_law(json: str) -> dict[str, Any]: ...
def seal_factors(
    levels_per_k: float,
    viscous_per_k: float,
    above_k: float,
    run_in: float,
    run_in_distance_m: float,
    slid_m: float,
) -> tuple[float, float]: ...
def seal_warming(resistance_k_w: float, time_s: float, warming_k: float, heat_w: float, duration_s: float) -> float: ...
def steady_friction(
    law: str,
    parameters: Mapping[str, float],
    velocity: NDArray[float64],
    gauge_a_pa: float = 0.0,
    gauge_b_pa: float = 0.0,
    pressure: Mapping[str, float] | None = None,
    dependences: Mapping[str, Any] | None = None,
    position_m: float = 0.0,
) -> NDArray[float64]: ...
def steady_friction_sensitivity(
    law: str,
    parameters: Mapping[str, float],
    names: Sequence[str],
    velocity: NDArray[float64],
    gauge_a_pa: NDArray[float64],
    gauge_b_pa: NDArray[float64],
    position_m: NDArray[float64],
    dependences: Mapping[str, Any] | None = None,
) -> tuple[NDArray[float64], NDArray[float64]]: ...
def valve_openings(command: NDArray[float64]) -> NDArray[float64]: ...
def turning_points(values: NDArray[float64], least: float) -> NDArray[int64]: ...
def bin_means(
    position: NDArray[float64],
    values: NDArray[float64],
    chosen: NDArray[bool_] | None,
    stretches: Sequence[tuple[int, int]],
    bins: tuple[float, float, int],
) -> NDArray[float64]: ...

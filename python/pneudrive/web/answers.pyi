"""Forms of the server's answers: `tools/page.py types` writes them in TypeScript, `tests/web` holds answers to them.

A form that a class of the package already has, such as a view or a figure, is not written here again.
"""

from typing import Literal

from typing_extensions import NotRequired, TypedDict

from pneudrive.report.circuit.svg import Box, PistonShapes, Shape
from pneudrive.results import ValuePair
from pneudrive.views import SentValue, SentView, ShownFigure
from pneudrive.web.signatures import CommandInput
from pneudrive.web.workspace import Listed

class Problem(TypedDict):
    file: NotRequired[str]
    line: int | None
    key: str | None
    what: str
    value: str | None
    rule: str | None
    remedy: str | None

class CatalogueEntry(TypedDict):
    path: str
    title: str

class Studies(TypedDict):
    """State and content of the folder. An answer to a request with this state has nothing else."""

    state: str
    folder: str
    version: str
    platform: str
    build: str
    protocols: list[str]
    control: bool
    left_out: int
    is_cut: bool
    files: list[Listed]
    catalogue: list[CatalogueEntry]

class Progress(TypedDict):
    done: int
    total: int
    task: str

class Job(TypedDict):
    """A job. `ends`: it was cancelled, and runs until it can stop."""

    number: int
    command: str
    kind: str
    out: str
    state: Literal["running", "done", "failed", "cancelled"]
    ends: bool
    tail: str
    progress: Progress | None

class Jobs(TypedDict):
    jobs: list[Job]

class Form(TypedDict):
    title: str
    fields: list[CommandInput]

class Copied(TypedDict):
    """Lines that do the same in a shell and in Python."""

    command: str
    python: str

class Made(TypedDict):
    """An input of a file, with its own inputs."""

    kind: str
    name: str
    digest: str
    path: str
    state: Literal["same", "changed", "differs", "missing", "named", "unread"]
    inputs: list[Made]

class Lineage(TypedDict):
    path: str
    inputs: list[Made]
    made: list[str]
    again: dict[str, object] | None
    stale: list[str]

class Stale(TypedDict):
    stale: dict[str, list[str]]
    unchecked: int

# --- Descriptions and tasks.

class Field(TypedDict):
    """A value of a description or a task. `copies`: components that its table describes together."""

    key: str
    text: str
    origin: str
    kind: Literal["given", "source", "identified", "assumed", "default"]
    number: NotRequired[float]
    unit: NotRequired[str]
    units: NotRequired[list[str]]
    component: NotRequired[str]
    copies: NotRequired[list[str]]
    low: NotRequired[float]
    high: NotRequired[float]

class Follows(TypedDict):
    what: str
    value: float
    unit: str

class Checked(TypedDict):
    """Check of a text. `valves`: those of a circuit with their lowest commands; `follows`: from a task."""

    problems: list[Problem]
    name: NotRequired[str]
    kind: NotRequired[Literal["drive", "circuit"]]
    valves: NotRequired[dict[str, int]]
    values: NotRequired[list[Field]]
    notes: NotRequired[list[str]]
    sliders: NotRequired[list[str]]
    follows: NotRequired[list[Follows]]

class TextFile(TypedDict):
    text: str
    sha256: str | None

class CircuitDrawing(TypedDict):
    shapes: list[Shape]
    pistons: dict[str, PistonShapes]
    nets: list[list[tuple[str, str]]]
    ports: dict[str, dict[str, tuple[float, float]]]
    box: Box
    words: list[str]

class Kinds(TypedDict):
    kinds: list[tuple[str, str]]

class Part(TypedDict):
    name: str
    title: str

class Parts(TypedDict):
    parts: list[Part]

class Fmu(TypedDict):
    view: SentView
    sha256: str
    fmpy: str

# --- Runs.

class CurveColumn(TypedDict):
    column: str
    label: str

class RunPanel(TypedDict):
    """Curves of a run with one unit. `left_out`: number of curves that are not drawn."""

    title: str
    unit: str
    size: float
    curves: list[CurveColumn]
    left_out: NotRequired[int]

class Impact(TypedDict):
    time_s: float
    end: str
    cylinder: NotRequired[str]
    speed_m_s: float
    energy_j: float

class RunEvent(TypedDict):
    time_s: float
    what: str

# Line of a platform: its part, number of its leg or 0, and its points at rest, m, or how many points move.
class SentPart(TypedDict):
    part: str
    leg: int
    points: list[tuple[float, float, float]]
    moving: int

# A leg: its name, the column of its force, and its forces at rest under supply pressure, N.
class SentLeg(TypedDict):
    name: str
    force: str
    limits: tuple[float | None, float | None]

# Path of the traced point in another run, or of its reference, m.
class SentPath(TypedDict):
    label: str
    points: list[tuple[float, float, float]]

# An output of a platform: its column, its name in words, and the unit with its size in SI.
class SentOutput(TypedDict):
    column: str
    label: str
    unit: str
    size: float

# A platform of a run. The array ``platform/NAME`` has the moving points of each sample, m, then the origin and the
# traced point.
class SentPlatform(TypedDict):
    name: str
    traced: str
    view: SentView
    parts: list[SentPart]
    legs: list[SentLeg]
    reach: list[tuple[float, float, float]]
    paths: list[SentPath]
    outputs: list[SentOutput]

class MovingCylinder(TypedDict):
    """A cylinder and the columns of its position and pressures."""

    name: str
    stroke_m: float
    position: str
    pressures: tuple[str, str]

class OtherRun(TypedDict):
    path: str
    ends: dict[str, float]
    largest: dict[str, float]

class MemberBand(TypedDict):
    members: int
    failed: int
    why: str
    refused: bool
    share: tuple[float, float]
    ends: dict[str, tuple[float, float]]

class RunHead(TypedDict):
    number: int
    path: str
    problems: NotRequired[list[Problem]]
    panels: NotRequired[list[RunPanel]]
    warnings: NotRequired[list[str]]
    impacts: NotRequired[list[Impact]]
    more_impacts: NotRequired[int]
    leading: NotRequired[list[SentValue]]
    events: NotRequired[list[RunEvent]]
    assumed: NotRequired[int]
    samples: NotRequired[int]
    ends: NotRequired[dict[str, float]]
    others: NotRequired[list[OtherRun]]
    loops: NotRequired[list[str]]
    energy: NotRequired[SentView]
    band: NotRequired[MemberBand]
    platforms: NotRequired[list[SentPlatform]]
    cylinders: NotRequired[list[MovingCylinder]]

# --- Control.

class Gain(TypedDict):
    key: str
    number: float
    unit: str
    low: float
    high: float
    meaning: str
    rule: str

class ControlHead(Copied):
    """A run under control. Gains have the ranges of their sliders; `told` is the assumed drive."""

    number: int
    problems: NotRequired[list[Problem]]
    panels: list[RunPanel]
    samples: int
    took_s: float
    law: str
    drive: str
    gains: list[Gain]
    mismatch: tuple[str, str]
    warnings: list[str]
    max_error_m: float | None
    view: SentView
    told: SentView
    lost: bool

class StandardReference(TypedDict):
    name: str
    text: str
    usable: bool

class Choices(TypedDict):
    laws: list[str]
    setups: list[str]
    mismatches: list[str]
    spreads: list[str]
    references: list[StandardReference]

class Measure(TypedDict):
    name: str
    title: str
    size: float
    unit: str

class CardReference(TypedDict):
    name: str
    text: str

class CardCell(TypedDict):
    law: str
    reference: str
    text: str
    range: list[str]
    value: float | None
    best: bool
    lost: int

class CardRun(TypedDict):
    law: str
    reference: str
    seed: int
    value: float | None

class Card(Copied):
    measure: str
    spread: str
    total: int
    finished: bool
    done: int
    laws: list[str]
    references: list[CardReference]
    measures: list[Measure]
    cells: list[CardCell]
    each: list[CardRun]
    failed: list[str]
    told: SentView

class ErrorUnit(TypedDict):
    unit: str
    size: float

class Tracks(TypedDict):
    laws: list[str]
    error: ErrorUnit

# --- Sizings.

class Limit(TypedDict):
    """A value that 1 % of the samples exceed, its limit, and the values between which 98 % lie."""

    name: str
    value: float | None
    limit: float | None
    unit: str
    margin: float | None
    interval: tuple[float | None, float | None] | None

class Candidate(TypedDict):
    """A simulated choice. Limits of the task come first, then air and load ratio."""

    name: str
    title: str
    parts: str
    cylinder: str
    setting: str
    draws: int
    met: int
    at_least: float
    time_out: float | None
    time_back: float | None
    energy: float | None
    air: float | None
    load_ratio: float | None
    margin: float | None
    binding: str
    limits: list[Limit]
    misses: bool
    place: int | None
    file: str

class Sizing(TypedDict):
    """A search, the best candidates first. It has view and sheet once it is done. `searched`: by any process."""

    name: str
    words: str
    task: str
    draws: int
    candidates: list[Candidate]
    view: SentView | None
    sheet: SentView | None
    done: bool
    searched: bool
    asked: dict[str, int] | None
    provisional: str

# --- Recordings and campaigns.

class Channel(TypedDict):
    column: str
    label: str
    unit: str

class OpenedRecording(TypedDict):
    """A recording, its problems, or the fraction of its file that is read."""

    problems: NotRequired[list[Problem]]
    share: NotRequired[float]
    key: NotRequired[str]
    channels: NotRequired[list[Channel]]
    span: NotRequired[tuple[float, float]]
    samples: NotRequired[int]
    time: NotRequired[bool]
    layout: NotRequired[str | None]
    notes: NotRequired[list[str]]

Stroke = TypedDict("Stroke", {"from": float, "to": float, "direction": int, "speed": float})

class FaultKind(TypedDict):
    count: int
    places: list[tuple[float, float]]

class Strokes(TypedDict):
    strokes: list[Stroke]
    faults: dict[str, FaultKind]
    note: NotRequired[str]

WindowHead = TypedDict(
    "WindowHead",
    {
        "number": int,
        "problems": NotRequired[list[Problem]],
        "path": str,
        "key": str | None,
        "missing": int,
        "samples": int,
        "raw": bool,
        "from": float,
        "to": float,
    },
)

class Guess(TypedDict):
    role: str
    column: str
    unit: str
    why: str

class Proposal(TypedDict):
    text: str
    problem: str
    kind: str
    strokes: int
    guesses: list[Guess]

class MeasuredRow(TypedDict):
    recording: str
    label: str
    unit: str
    time_s: tuple[float, float]
    values: tuple[float | None, float | None]
    difference: float | None
    slope: float | None

class MeasuredRows(TypedDict):
    rows: list[MeasuredRow]

class QuickPoint(TypedDict):
    """Speed and friction of a cycle, without an interval."""

    x: float
    y: float
    spread: None

class QuickGroup(TypedDict):
    label: str
    points: list[QuickPoint]

class Campaign(TypedDict):
    name: str
    synthetic: bool
    done: int
    extra: int
    planned: int | None
    remaining_s: float | None
    state: str | None
    text: str
    cycle: str
    flags: dict[str, int]
    problems: list[str]
    log: list[str]
    groups: list[QuickGroup]

class CycleHead(TypedDict):
    cycle: str
    left: NotRequired[str]
    samples: NotRequired[int]

class Plan(Copied):
    text: str
    time_s: float
    cycles: int

# --- Friction and validations.

class FrictionPoint(TypedDict):
    """Friction y over speed x, or over gauge pressure x with the speed."""

    recording: str
    direction: int
    x: float
    y: float
    spread: float | None
    flags: str

class GaugePoint(FrictionPoint):
    speed: float

class FrictionCurve(TypedDict):
    """Friction of a fit over speed or gauge pressure, with its band and the measured range."""

    x: list[float]
    y: list[float | None]
    low: list[float | None]
    high: list[float | None]
    measured: tuple[float | None, float | None]

class FrictionGroup(TypedDict):
    """Points of one seal and pressure, with the curve of the fit; `assembly` is seal, mounting and drive."""

    label: str
    assembly: str
    points: list[FrictionPoint]
    curve: NotRequired[FrictionCurve]
    gauges: tuple[float, float]

class SliceGroup(TypedDict):
    label: str
    assembly: str
    points: list[GaugePoint]
    curve: NotRequired[FrictionCurve]
    speed: float

class FrictionMap(TypedDict):
    """Points of a map. `fit`: why curves are missing; `seals`: fit of each seal."""

    groups: list[FrictionGroup]
    fit: str
    fits: list[str]
    seals: dict[str, str]
    recordings: dict[str, str]
    left_out: int

class Slice(TypedDict):
    chamber: Literal["a", "b"]
    groups: list[SliceGroup]
    python: str

class BehindFit(TypedDict):
    view: SentView
    designs: bool
    command: NotRequired[str]
    python: NotRequired[str]

class NextPoints(Copied):
    view: SentView

class Compared(Copied):
    names: tuple[str, str]
    sentence: str
    figure: ShownFigure | None
    values: list[ValuePair]
    lines: list[str]

class Culprit(TypedDict):
    what: str
    share: float
    text: str
    free: list[str]

class Diagnosis(TypedDict):
    left: float
    clean: bool
    culprit: NotRequired[list[Culprit]]

class Source(TypedDict):
    name: str
    file: str

class OriginOfValue(TypedDict):
    key: str
    text: str
    kind: str
    origin: str
    interval: NotRequired[str]
    fit: NotRequired[str]
    source: NotRequired[list[Source]]

class ValidatedChannel(TypedDict):
    column: Literal["position_m", "pressure_a_pa", "pressure_b_pa"]
    label: str
    size: float
    unit: str

class FreeRun(TypedDict):
    nrmse: NotRequired[float | None]
    fit_percent: NotRequired[float | None]

class ChannelResult(TypedDict):
    free: FreeRun
    off_s: NotRequired[float]

class ValidatedRecord(TypedDict):
    """A recording of a validation with its agreement. `start_s`: its time 0 on the clock of the file."""

    badge: NotRequired[str]
    name: str
    file: str
    span: tuple[float, float]
    start_s: NotRequired[float]
    position_m: ChannelResult
    pressure_a_pa: ChannelResult
    pressure_b_pa: ChannelResult

class Validation(TypedDict):
    name: str
    drive: str
    editable: bool
    window_s: float
    synthetic: bool
    record: list[ValidatedRecord]
    diagnosis: Diagnosis
    suspects: list[Field]
    values: list[OriginOfValue]
    channels: list[ValidatedChannel]

class ValidationHead(TypedDict):
    number: int
    problems: NotRequired[list[Problem]]
    fit: NotRequired[dict[str, float | None]]

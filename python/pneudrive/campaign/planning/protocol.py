"""The campaign protocol as a TOML file: factors, order, preparations and checks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, PrivateAttr, model_validator

from pneudrive.campaign.planning.protocol_tables import (
    BeforeBlock,
    Conditions,
    Count,
    DriveUnderTest,
    Filter,
    Fraction,
    HardFactor,
    Mounting,
    Order,
    Pressures,
    Range,
    SamplingTable,
    Seal,
    Sentinel,
    Speeds,
    Stops,
    Tightened,
    WarmUp,
)
from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.keys import wrong
from pneudrive.describe.marks import Whole
from pneudrive.errors import ProtocolError, nearest
from pneudrive.rig.interface import Sampling

if TYPE_CHECKING:
    from collections.abc import Mapping

FOLDER = Path(__file__).with_name("protocols")
HARD = ("mounting", "seal", "drive")
#: Tables of earlier versions: they are read, and the plan notes that they are not applied.
UNUSED = Field(default=None, description="of earlier versions; not applied")


class Protocol(Described):
    """A campaign as its file describes it. Frozen; all values SI, pressures as stated (absolute or gauge).

    Examples
    --------
    >>> protocol = read_protocol("paper-speed")
    >>> protocol.speed.levels_m_s[0]
    0.001
    """

    schema_version: Literal[1] = Field(default=1, alias="schema", description="of this file")
    name: str = Field(default="unnamed protocol", description="of the campaign")
    about: str = Field(default="", description="free text")
    operator: str = Field(default="", description="who is at the rig")
    seed: Annotated[int, Whole(at_least=0, bound=None)] = Field(
        default=0, description="seed of the order and of a simulated rig"
    )
    repeats: Count = Field(default=1, description="repetitions of every point within each block")
    directions: Literal["both", "+x", "-x"] = Field(
        default="both", description="pressures of sweeps and stops; x grows as chamber a grows"
    )
    labels: dict[str, str] = Field(default_factory=dict, description="free text, kept with every result")
    speed: Speeds | None = None
    pressure: Pressures = Pressures()
    stop: Stops | None = None
    mounting: Mounting | None = None
    seal: Seal | None = None
    drive: DriveUnderTest | None = None
    order: Order = Order()
    warm_up: WarmUp | None = None
    samples: SamplingTable = Field(default=SamplingTable(), alias="sampling")
    before_block: BeforeBlock = BeforeBlock()
    sentinel: Sentinel | None = None
    filter: Filter = Filter()
    adaptive: dict[str, Any] | None = UNUSED
    conditions: Conditions = Conditions()
    limits: Tightened = Tightened()
    position: Range = Range()
    design: dict[str, Any] | None = UNUSED
    fraction: Fraction | None = None

    _text: str = PrivateAttr(default="")
    _origin: str = PrivateAttr(default="protocol")

    @model_validator(mode="after")
    def _says_what_to_measure(self) -> Protocol:
        if self.speed is None and self.stop is None:
            raise wrong(
                "speed",
                "the protocol measures nothing: neither [speed] nor [stop] is given",
                remedy='Add [speed] with from = "1 mm/s", to = "450 mm/s", count = 20.',
            )
        shuffled = self.order.kind != "as-given"
        if shuffled and self.speed is not None and "order" in self.speed.model_fields_set:
            raise wrong(
                "speed.order",
                f'speed.order = "{self.speed.order}" and order.kind = "{self.order.kind}" contradict each other',
                remedy='Leave out speed.order, or set [order] kind = "as-given".',
            )
        return self

    @property
    def hard(self) -> dict[str, HardFactor]:
        """Factors that are changed by hand, the hardest to change outermost."""
        given = {"drive": self.drive, "seal": self.seal, "mounting": self.mounting}
        return {name: factor for name, factor in given.items() if factor is not None}

    @property
    def sampling(self) -> Sampling:
        """Sampling in the form of a rig."""
        s = self.samples
        return Sampling(s.samples_per_stroke, s.burst_rate_hz, s.burst_before_s, s.burst_after_s, s.hold_rate_hz)

    @property
    def origin(self) -> str:
        """File of the protocol."""
        return self._origin

    @property
    def text(self) -> str:
        """Text of the file, unchanged, or generated without a file."""
        return self._text or toml.write({"schema": self.schema_version} | self.to_dict())

    def fail(self, key: str, what: str, *, rule: str | None = None, remedy: str | None = None) -> ProtocolError:
        """Return an error with the line of a key."""
        return toml.located(wrong(key, what, rule=rule, remedy=remedy), self._origin, self._text).turned(ProtocolError)


def read_protocol(source: str | Path) -> Protocol:
    """Read a protocol from a TOML file, or a ready protocol by its name.

    Parameters
    ----------
    source : path-like
        A file, or a name that `ready_protocols` lists; a file of that name takes precedence.

    Raises
    ------
    ProtocolError
        If the file is invalid; the message names file, line, value, rule and remedy.
    """
    path = Path(source)
    ready = ready_protocols()
    if not path.exists() and str(source) in ready:
        path = ready[str(source)]
    elif not path.exists() and path.parent == Path() and path.suffix != ".toml":
        raise ProtocolError(f"there is no protocol '{source}'", remedy=f"{nearest(str(source), ready)} Or name a file.")
    tables, text = toml.read(path, ProtocolError, f"Ready protocols: {', '.join(ready)}.")
    return _from_tables(tables, text, str(path))


def parse_protocol(text: str, origin: str = "protocol") -> Protocol:
    """Read a protocol from TOML text; `origin` names it in messages.

    Raises
    ------
    ProtocolError
        As `read_protocol`.
    """
    return _from_tables(toml.parse(text, origin, ProtocolError), text, origin)


def ready_protocols() -> dict[str, Path]:
    """Return the ready protocols by name."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.toml"))}


def protocol_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a protocol."""
    schema = Protocol.model_json_schema(by_alias=True)
    measured = [{"required": ["speed"]}, {"required": ["stop"]}]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "anyOf": measured}


def _from_tables(tables: Mapping[str, Any], text: str, origin: str) -> Protocol:
    with toml.locating(origin, text, ProtocolError):
        protocol = Protocol.model_validate(tables)
    protocol._text, protocol._origin = text, origin
    return protocol


__all__ = ["Protocol", "parse_protocol", "protocol_schema", "read_protocol", "ready_protocols"]

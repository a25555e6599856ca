"""The campaign folder: one Parquet file per cycle, written whole or not at all; its listing is the catalogue.

- ``campaign.toml``: the protocol as run
- ``campaign.json``: schema, name, seed, operator, labels, created, version
- ``rig.json``: the rig's identity and calibration (`pneudrive.rig.interface.Identity`)
- ``cycles/00001-KEY.parquet``: raw samples; the head of the cycle is JSON under the key "pneudrive" of its metadata
- ``truth/00001-KEY.json``: simulated rigs only: what was true; for tests, never read by results
"""

from __future__ import annotations

import json
import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.campaign.cycle import Cycle
from pneudrive.errors import CampaignError
from pneudrive.rig.interface import CHANNELS, Identity, Samples

if TYPE_CHECKING:
    from collections.abc import Iterator

SCHEMA = 1
HEAD = "pneudrive"
COLUMNS = (*CHANNELS, "step")


@dataclass(frozen=True)
class Head:
    """What a cycle's file says beside its samples.

    Attributes
    ----------
    index : int
        Place in the order in which the cycles were run, from 1.
    cycle : Cycle
    began_s : float
        The rig's own clock at time zero of the cycle, so that drift can be told.
    started : str
        Date and time of the computer, ISO 8601 with zone.
    flags : dict
        Counts of what was found in the samples on arrival.
    memory : dict
        What a simulated rig needs to go on from here.
    """

    index: int
    cycle: Cycle
    began_s: float = 0.0
    started: str = ""
    flags: dict[str, int] = field(default_factory=dict)
    memory: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class CycleFile:
    """A finished cycle on disk."""

    path: Path
    head: Head

    def samples(self) -> Samples:
        """Read the raw samples.

        Raises
        ------
        CampaignError
            If the file is damaged or lacks a column.
        """
        import polars as pl

        try:
            frame = pl.read_parquet(self.path)
            channels = {name: frame[name].to_numpy().astype(np.float64) for name in CHANNELS}
            step = frame["step"].to_numpy().astype(np.int64)
        except (OSError, pl.exceptions.PolarsError) as error:
            raise CampaignError("a cycle cannot be read", where=str(self.path), value=str(error)) from None
        return Samples(**channels, step=step)


def write_cycle(folder: Path, head: Head, samples: Samples) -> Path:
    """Write one cycle: to a temporary name, flushed, then renamed, so that it is there whole or not at all."""
    import polars as pl

    name = f"{head.index:05d}-{re.sub(r'[^A-Za-z0-9.+-]+', '_', head.cycle.key)}.parquet"
    target = folder / "cycles" / name
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_suffix(".part")
    text = json.dumps({**vars(head), "schema": SCHEMA, "cycle": head.cycle.to_dict()})
    with temporary.open("wb") as file:
        frame = pl.DataFrame({name: getattr(samples, name) for name in COLUMNS})
        frame.write_parquet(file, metadata={HEAD: text})
        file.flush()
        os.fsync(file.fileno())
    temporary.rename(target)
    return target


def read_head(path: Path) -> Head:
    """Read the head of a cycle's file without its samples."""
    import polars as pl

    try:
        data = json.loads(pl.read_parquet_metadata(path)[HEAD])
        data.pop("schema")
        return Head(**{**data, "cycle": Cycle.from_dict(data["cycle"])})
    except (OSError, KeyError, TypeError, ValueError, pl.exceptions.PolarsError) as error:
        raise CampaignError("a cycle cannot be read", where=str(path), value=str(error)) from None


@dataclass(frozen=True)
class Campaign:
    """A campaign folder, opened for reading."""

    path: Path
    identity: Identity
    about: dict[str, Any]

    @classmethod
    def open(cls, path: str | Path) -> Campaign:
        """Open a folder.

        Raises
        ------
        CampaignError
            If it is not a campaign.
        """
        folder = Path(path)
        try:
            identity = Identity(**json.loads((folder / "rig.json").read_text(encoding="utf-8")))
            about = json.loads((folder / "campaign.json").read_text(encoding="utf-8"))
        except (OSError, ValueError, TypeError) as error:
            raise CampaignError("this is not a campaign folder", where=str(folder), value=str(error)) from None
        return cls(folder, identity, about)

    def cycles(self) -> Iterator[CycleFile]:
        """Give the finished cycles in the order in which they were run."""
        for path in sorted((self.path / "cycles").glob("*.parquet")):
            yield CycleFile(path, read_head(path))

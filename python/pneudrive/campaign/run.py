"""Run a campaign, and resume one that was interrupted."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from pneudrive import __version__, own_code
from pneudrive.campaign.planning.plan import lay_out
from pneudrive.campaign.planning.preflight import Plan, check_levels
from pneudrive.campaign.planning.protocol import Protocol, read_protocol
from pneudrive.campaign.running.campaign_run import DONE, ENDED, CampaignRun, Options, Subscribers
from pneudrive.campaign.storage.control import FolderLock, make_folder, now
from pneudrive.campaign.storage.folder import ABOUT, Campaign, create, plan_of
from pneudrive.errors import CampaignError
from pneudrive.files.inputs import INPUTS, stored_beside, stored_input
from pneudrive.repr_tables import Shown
from pneudrive.rig.interface import Rig, as_json, closed_after


@dataclass(frozen=True, repr=False)
class Result(Shown):
    """Outcome of a campaign run.

    Attributes
    ----------
    campaign : Campaign
    finished, planned : int
        Number of cycles on disk, and total number of cycles.
    ended : str
        ``done``, or ``ended`` if a person ended the campaign. An ended campaign can be resumed.
    """

    campaign: Campaign
    finished: int
    planned: int
    ended: str


def run_campaign(
    protocol: Protocol | str | Path,
    rig: Rig | str | Path,
    into: str | Path,
    *,
    options: Options | None = None,
    labels: Mapping[str, str] | None = None,
    pace: float | None = None,
    subscribers: Subscribers = (),
) -> Result:
    """Run a campaign into a folder, or resume it if the folder already contains it.

    Parameters
    ----------
    protocol : Protocol, str or Path
        A protocol, its file, or the name of a ready protocol.
    rig : Rig, str or Path
        A rig, or its name, file, address or code for `pneudrive.rig.load_rig`. The seed of a simulated rig is that of
        the protocol.
    into : str or Path
        The campaign folder; created if missing.
    options : Options, optional
    labels : mapping, optional
        Free text in addition to the protocol's labels.
    pace : float, optional
        Seconds of a simulated rig per second of wall-clock time. Default: as fast as possible.
    subscribers : sequence of callable
        Called as ``subscriber(name, document)`` with the documents of bluesky's event model: a start, a descriptor, an
        event for each finished cycle, a stop.

    Returns
    -------
    Result

    Raises
    ------
    ProtocolError
        The plan exceeds the limits of the rig, or the protocol is not valid.
    CampaignError
        If another process uses the folder, if the folder has other content or cannot be written, or if conditions were
        not met in time.
    RigError
        If the rig fails. After every error the rig is at rest and finished cycles are kept.
    """
    asked = protocol if isinstance(protocol, Protocol) else read_protocol(protocol)
    folder = Path(into)
    if (folder / ABOUT).exists():
        there = Campaign.open(folder)
        if asked.text.strip() != there.protocol.strip():
            names = {"there": there.about.get("name", ""), "name": asked.name, "folder": folder}
            raise CampaignError.of("campaign.other-protocol", where=folder, **names)
        return resume_campaign(folder, rig, options=options, pace=pace, subscribers=subscribers)
    with _bench(rig, asked.seed, pace) as (bench, source):
        check_levels(asked, bench)
        plan = lay_out(asked, bench.identity(), bench.limits())
        make_folder(folder)
        with FolderLock(folder) as lock:
            if (folder / ABOUT).exists():  # another process was faster
                raise CampaignError.of("campaign.begun", where=folder, folder=folder)
            digest = _digest(source)
            about = {
                "name": asked.name,
                "seed": asked.seed,
                "operator": (options and options.operator) or asked.operator,
                "labels": {**asked.labels, **(labels or {})},
                "synthetic": plan.identity.synthetic,
                "created": now(),
                "version": __version__,
                "filter": asked.filter.stored(),
                "rig": source,
                "rig_sha256": digest,
                "envelope": asdict(plan.envelope),
            }
            inputs = [stored_input("rig", source, source, digest)] if Path(source).is_file() else []
            about |= stored_beside({INPUTS: inputs}, folder)
            campaign = create(folder, asked.text, plan.identity, about)
            return _run(campaign, plan, bench, options, lock, subscribers)


def resume_campaign(
    folder: str | Path,
    rig: Rig | str | Path | None = None,
    *,
    options: Options | None = None,
    pace: float | None = None,
    allow_code: str | None = None,
    subscribers: Subscribers = (),
) -> Result:
    """Resume a campaign; see `run_campaign`.

    Parameters
    ----------
    folder : str or Path
    rig : Rig, str or Path, optional
        Required for custom code, and for a rig that moves an axis or needs a login, because a folder must not decide
        which code runs. Optional for a simulated rig or a replay.
    allow_code : str, optional
        Instead of `rig`: SHA-256 of the file of the custom code that started the campaign.
    options, pace, subscribers
        As in `run_campaign`.

    Raises
    ------
    ProtocolError, CampaignError, RigError
        As in `run_campaign`; also if `rig` is required but missing.
    """
    folder = Path(folder)
    campaign = Campaign.open(folder)
    plan = plan_of(campaign)
    where, made_with = str(folder / ABOUT), str(campaign.about.get("rig_sha256") or "")
    found: dict[str, str | None] = {}
    if rig is None:  # the rig named in the folder, if this is allowed
        rig = campaign.about.get("rig")
        if not rig or not isinstance(rig, str):
            raise CampaignError("the folder does not name its rig", where=where, remedy="Add --rig RIG.")
        if allow_code is not None and made_with != allow_code.strip().lower():
            names = {"made_with": made_with or "not stated", "allowed": allow_code, "rig": rig}
            raise CampaignError.of("campaign.other-code", where=where, **names)
        found = {"found_in": where, "allow_code": allow_code}
    with FolderLock(folder) as lock, _bench(rig, plan.protocol.seed, pace, **found) as (bench, source):
        identity = bench.identity()
        here, there = (as_json(one.to_dict()) for one in (identity, campaign.identity))
        # The text on errors of a simulated rig depends on the version; the hash of its file identifies it.
        free = {"calibration"} if identity.synthetic else set()
        other = [name for name in here if name not in free and here[name] != there[name]]
        if not other and identity.synthetic and made_with and _digest(source) not in ("", made_with):
            other = [f"the file {source}"]
        if other:  # cycles of another rig are not comparable
            raise CampaignError.of("campaign.other-rig", where=campaign.path, names=", ".join(other))
        if (limits := bench.limits()) != plan.envelope:
            lay_out(plan.protocol, campaign.identity, limits)  # check again: the rig may allow less than before
        return _run(campaign, plan, bench, options, lock, subscribers)


def can_be_resumed(error: BaseException) -> bool:
    """Return whether an error ended a campaign after its start. Other errors mean that the request was invalid."""
    return getattr(error, "while_running", False)


def _run(
    campaign: Campaign,
    plan: Plan,
    bench: Rig,
    options: Options | None,
    lock: FolderLock,
    subscribers: Subscribers,
) -> Result:
    """Run a campaign to its end. The operator is taken from the folder, unless the options name one."""
    options = options or Options()
    operator = options.operator or str(campaign.about.get("operator", ""))
    run = CampaignRun(campaign, plan, bench, replace(options, operator=operator), lock, subscribers)
    ended = run.run()
    return Result(campaign, len(run.finished), run.total, ended)


@contextmanager
def _bench(
    rig: Rig | str | Path,
    seed: int,
    pace: float | None,
    **found: str | None,
) -> Iterator[tuple[Rig, str]]:
    """Provide the rig, and its address for a later `resume_campaign`.

    The address is empty if the caller made the rig and closes it. An address (also ``own_rig.py:make_rig``) has full
    paths, so that it is valid in any folder.
    """
    from pneudrive.rig.rig_file import load_rig

    if not isinstance(rig, str | Path):
        yield rig, ""
        return
    source = str(rig)
    file, _, name = source.rpartition(":")
    with closed_after(load_rig(rig, seed=seed, pace=pace, **found)) as bench:
        if Path(source).exists():
            source = str(Path(source).resolve())
        elif file and Path(file).is_file():
            source = f"{Path(file).resolve()}:{name}"
        yield bench, source


def _digest(source: str) -> str:
    path = Path(source)
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else own_code.sha256(source)


__all__ = ["DONE", "ENDED", "Options", "Result", "can_be_resumed", "resume_campaign", "run_campaign"]

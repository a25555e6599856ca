"""A campaign while it runs: its plan for bluesky's RunEngine, and what it does with each cycle."""

from __future__ import annotations

import asyncio
import concurrent.futures
import errno
import re
import shutil
import time
from typing import TYPE_CHECKING, Any

from bluesky.utils import Msg

from pneudrive.campaign.adaptive import LEVELS, Finished, Point, measure, needless, next_cycle
from pneudrive.campaign.checks import arrival_flags, serious
from pneudrive.campaign.devices import Axis, Chambers, Conditions, RigThread, whats_wrong
from pneudrive.campaign.folder import Head, write_cycle, write_truth
from pneudrive.campaign.lock import now, user
from pneudrive.campaign.storage import REMEDIES
from pneudrive.campaign.watch import FAULT, NO_ANSWER, Bounds, look
from pneudrive.errors import CampaignError, ConnectionLostError

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence
    from pathlib import Path

    from pneudrive.campaign.cycle import Cycle
    from pneudrive.campaign.folder import Campaign, CycleFile
    from pneudrive.campaign.journal import Journal
    from pneudrive.campaign.live import Display
    from pneudrive.campaign.lock import FolderLock
    from pneudrive.campaign.options import Options
    from pneudrive.campaign.plan import Plan
    from pneudrive.rig.interface import Rig, Samples

#: Bytes that a sample may take on the disk while its cycle is written, and those of a cycle beside its samples.
SAMPLE_BYTES, CYCLE_BYTES = 60, 100_000
#: What a connection that is lost or does not answer raises, up to Python 3.10 in three forms.
LOST = (ConnectionError, TimeoutError, asyncio.TimeoutError, concurrent.futures.TimeoutError)


class Session:
    """A campaign while it runs.

    Parameters
    ----------
    campaign : Campaign
    plan : Plan
    rig : Rig
    options : Options
    lock : FolderLock
    journal : Journal
    display : Display
    files : sequence of CycleFile
        Finished cycles that are there already.
    """

    name, parent = "campaign", None

    def __init__(
        self,
        campaign: Campaign,
        plan: Plan,
        rig: Rig,
        options: Options,
        lock: FolderLock,
        journal: Journal,
        display: Display,
        files: Sequence[CycleFile],
    ) -> None:
        self.campaign, self.plan, self.options = campaign, plan, options
        self.lock, self.journal, self.display = lock, journal, display
        ambient = plan.identity.ambient_pressure_pa
        self.bounds = Bounds.of(plan.protocol, plan.envelope, ambient)
        self.thread = RigThread(rig)
        self.axis = Axis(self.thread, self.bounds.during, display.part)
        self.chambers = Chambers(self.thread, self.axis)
        self.wants_points = plan.protocol.adaptive is not None or display.wants_points
        self.finished: list[Finished] = [self._finished(file) for file in files]
        self.paths: list[Path] = [file.path for file in files]
        self.index = max((_number(path) for path in _all_files(campaign)), default=0)
        self.conditions = Conditions(self.thread, lambda rig: look(rig, self.bounds))
        if files:
            last = files[-1].head
            self.axis.past, cycle = dict(last.memory), last.cycle
            self.axis.past_pressures_pa = (cycle.pressure_a_pa, cycle.pressure_b_pa)
        self.question = ""  # what the operator is asked; empty where nothing is
        self.answer: dict[str, str] = {}
        self.leaving = False  # nobody will be there to end a pause
        self._bad = 0
        self._failures: dict[str, int] = {}

    def _finished(self, file: CycleFile) -> Finished:
        cycle = file.head.cycle
        point = Point()
        if self.wants_points and cycle.kind in (*LEVELS, "stop"):
            point = measure(file.samples(), cycle, self.campaign.identity)
        return Finished(cycle, file.head.flags, point)

    @property
    def now(self) -> str:
        """What to call the present: so many cycles of so many."""
        return f"{len(self.finished)} of {self.total} cycles"

    @property
    def total(self) -> int:
        """How many cycles there will be, as far as is known now."""
        done = {one.cycle.key for one in self.finished} | needless(self.plan, self.finished)
        return len(self.finished) + sum(p.cycle.key not in done for p in self.plan.planned)

    def tell(self, text: str) -> None:
        """Write a line into the journal and onto the display."""
        self.journal.write(text)
        self.display.say(text)

    def state(self, state: str, text: str = "") -> None:
        """Tell other processes what this one is doing."""
        self.lock.tell(state=state, text=text)

    # -- the plan ---------------------------------------------------------------------------------------------

    def messages(self) -> Generator[Msg, Any, None]:
        """Yield the messages of the whole campaign: a plan of bluesky.

        The cycle that is next depends on plan and finished cycles alone. Between two checkpoints lies what is done
        again after an immediate pause: one attempt at one cycle. A cycle is written in one go, between messages.
        """
        yield Msg("open_run", None, **self._metadata())
        while (following := next_cycle(self.plan, self.finished)) is not None:
            cycle, reason = following
            self.state("running")
            self.lock.tell(cycle=cycle.key)
            self.display.cycle(cycle, reason, len(self.finished), self.total)
            if reason:
                self.journal.write(f"{cycle.key} {reason}")
            confirmed = (yield from self._confirmed(cycle)) if cycle.text else {}
            samples = yield from self._attempts(cycle)
            head = self._write(cycle, reason, samples, confirmed)
            yield Msg("checkpoint")
            yield Msg("create", None, name="primary")
            yield Msg("read", self)
            yield Msg("save", None)
            yield Msg("checkpoint")
            self._stop_where_all_is_bad(head)
        yield Msg("close_run", None, exit_status="success", reason="")

    def _metadata(self) -> dict[str, Any]:
        about = self.campaign.about
        return {
            "plan_name": "friction campaign",
            "campaign": str(about.get("name", "")),
            "folder": str(self.campaign.path),
            "operator": self.options.operator,
            "synthetic": self.campaign.synthetic,
            "num_points": len(self.plan.planned),
        }

    def _confirmed(self, cycle: Cycle) -> Generator[Msg, Any, dict[str, str]]:
        """Have the operator do something, and say who confirmed it."""
        if self.options.yes:
            self.journal.write(f"{cycle.key}: {cycle.text} (taken as done: --yes)")
            return {"name": self.options.operator or user(), "time": now(), "how": "--yes"}
        yield from self._rest()  # there will be hands in the rig
        self.answer = {}
        while not self.answer:  # whoever goes on without an answer is asked again
            self.question = cycle.text
            yield Msg("checkpoint")
            yield Msg("pause", None, defer=False)
        self.question = ""
        self.journal.write(f"{cycle.key}: {cycle.text} (confirmed by {self.answer['name']})")
        return self.answer

    def _attempts(self, cycle: Cycle) -> Generator[Msg, Any, Samples]:
        """Run a cycle until it is whole; wait meanwhile for conditions that are not met."""
        while True:
            yield from self._good_conditions(cycle)
            self._room_for(cycle)
            yield Msg("checkpoint")
            if cycle.steps:
                yield Msg("set", self.chambers, cycle, self.plan.protocol.pressure.settling_s, group="ready")
                yield Msg("wait", None, group="ready")
            yield Msg("set", self.axis, cycle, group="cycle")
            yield Msg("wait", None, group="cycle")
            if self.axis.outcome.samples is not None:
                return self.axis.outcome.samples
            yield from self._explained(cycle)

    def _explained(self, cycle: Cycle) -> Generator[Msg, Any, None]:
        """Say what became of an attempt that failed, and go on where another one makes sense.

        Raises
        ------
        PneudriveError
            What the rig raised, or why there are no more attempts.
        """
        outcome = self.axis.outcome
        error = whats_wrong(outcome.error) if outcome.error is not None else None
        reason = outcome.out_of_bounds or (str(error).splitlines()[0].strip() if error else "the axis was stopped")
        yield Msg("checkpoint")
        yield from self._rest()
        self.tell(f"{cycle.key} was given up: {reason}")
        failures = self._failures[cycle.key] = self._failures.get(cycle.key, 0) + 1
        if error is not None and not isinstance(error, ConnectionLostError) and not _lost(error):
            yield from self._looked()
            if not self.conditions.wrong.startswith((FAULT, NO_ANSWER)):
                raise error
        if failures >= self.options.attempts:
            raise CampaignError(
                f"cycle {cycle.key} was given up {failures} times",
                value=reason,
                rule=f"a cycle is begun {self.options.attempts} times",
                remedy="See to the rig, then resume: what is finished is kept.",
            ) from error

    def _looked(self) -> Generator[Msg, Any, None]:
        yield Msg("trigger", self.conditions, group="look")
        yield Msg("wait", None, group="look")

    def _rest(self) -> Generator[Msg, Any, None]:
        yield Msg("stop", self.axis)
        if self.axis.trouble:
            self.tell(f"the rig may not be at rest: {self.axis.trouble}")

    def _good_conditions(self, cycle: Cycle) -> Generator[Msg, Any, None]:
        """Wait until measuring can go on: out of bounds, a fault, a lost connection; not for ever."""
        options = self.options
        waited = good_for = 0.0
        told = ""
        while True:
            yield Msg("checkpoint")
            yield from self._looked()
            wrong = self.conditions.wrong
            if not wrong and (not told or good_for >= options.steady_s):
                break
            good_for = 0.0 if wrong else good_for + options.look_s
            if wrong and _without_numbers(wrong) != _without_numbers(told):
                self.tell(f"waiting before {cycle.key}: {wrong}")
                self.state("waiting", wrong)
            if wrong.startswith((FAULT, NO_ANSWER)):
                self.axis.go_home_first()
            if wrong and not told:
                yield from self._rest()
            told = wrong or told
            if waited >= options.patience_s:
                raise CampaignError(
                    f"the campaign has waited for {options.patience_s:g} s in vain",
                    value=told,
                    remedy="See to it, then resume: what is finished is kept.",
                )
            yield Msg("sleep", None, options.look_s)
            waited += options.look_s
        if told:
            self.tell(f"going on after {waited:.3g} s: conditions are met again")
            self.state("running")

    def _room_for(self, cycle: Cycle) -> None:
        """Refuse to begin a cycle that the disk has no room for."""
        of_plan = {p.cycle.key: p.samples for p in self.plan.planned}
        samples = of_plan.get(cycle.key, max(of_plan.values(), default=0))
        needed = samples * SAMPLE_BYTES + CYCLE_BYTES
        free = shutil.disk_usage(self.campaign.path).free
        if free < needed:
            raise CampaignError(
                "the disk is full",
                where=str(self.campaign.path),
                value=f"{free / 1e6:.3g} MB are free, the next cycle may need {needed / 1e6:.3g} MB",
                remedy=REMEDIES[errno.ENOSPC],
            )

    # -- finished cycles ----------------------------------------------------------------------------------------

    def _write(self, cycle: Cycle, reason: str, samples: Samples, confirmed: dict[str, str]) -> Head:
        """Put a cycle on the disk; nothing comes between this and the cycle's being finished."""
        outcome, identity = self.axis.outcome, self.campaign.identity
        assert all(one.cycle.key != cycle.key for one in self.finished), f"{cycle.key} is finished already"
        head = Head(
            index=self.index + 1,
            cycle=cycle,
            began_s=outcome.began_s,
            started=outcome.started,
            flags=arrival_flags(samples, cycle, identity) if cycle.steps else {},
            memory=outcome.memory,
            confirmed=confirmed,
            attempts=self.axis.attempts.get(cycle.key, 1),
            reason=reason,
        )
        if outcome.truth:
            write_truth(self.campaign.path, head, outcome.truth)
        self.paths.append(write_cycle(self.campaign.path, head, samples))
        self.index += 1
        self.axis.finished(cycle)
        point = measure(samples, cycle, identity) if self.wants_points else Point()
        self.finished.append(Finished(cycle, head.flags, point))
        found = ", ".join(f"{flag} {count}" for flag, count in head.flags.items())
        self.journal.write(f"{cycle.key} is finished, {len(samples)} samples" + (f"; flags: {found}" if found else ""))
        self.display.finished(self.finished[-1])
        return head

    def _stop_where_all_is_bad(self, head: Head) -> None:
        self._bad = self._bad + 1 if serious(head.flags) else 0
        if self._bad >= self.options.bad_in_a_row:
            raise CampaignError(
                f"{self._bad} cycles in a row have samples that mean little",
                value=", ".join(f"{flag} {count}" for flag, count in head.flags.items()),
                where=str(self.paths[-1]),
                remedy="See to the sensors, then resume. The cycles are kept, with their flags.",
            )

    # -- as a device of bluesky: one event a cycle, for whoever subscribes ----------------------------------------

    def describe(self) -> dict[str, dict[str, Any]]:
        """Say what an event of a finished cycle holds."""
        source = f"campaign:{self.campaign.path.name}"
        return {
            name: {"source": source, "dtype": "string" if isinstance(value, str) else "number", "shape": []}
            for name, value in self._event().items()
        }

    def read(self) -> dict[str, dict[str, Any]]:
        """Give the event of the cycle that was finished last."""
        return {name: {"value": value, "timestamp": time.time()} for name, value in self._event().items()}

    def _event(self) -> dict[str, Any]:
        last = self.finished[-1]
        return {
            "index": self.index,
            "key": last.cycle.key,
            "kind": last.cycle.kind,
            "speed_m_s": float("nan") if last.cycle.speed_m_s is None else last.cycle.speed_m_s,
            "pressure_a_pa": last.cycle.pressure_a_pa,
            "pressure_b_pa": last.cycle.pressure_b_pa,
            "flags": " ".join(last.flags),
            "file": self.paths[-1].name,
        }


def _without_numbers(text: str) -> str:
    """Give what a message says beside its numbers: told once, not each time that they change."""
    return re.sub(r"\d[\d.e+-]*", "", text)


def _lost(error: BaseException | None) -> bool:
    """Whether a lost connection is behind an error."""
    while error is not None:
        if isinstance(error, LOST):
            return True
        error = error.__cause__ or error.__context__
    return False


def _all_files(campaign: Campaign) -> list[Path]:
    """Give every file of the cycles, those that were put aside too: an index is used once."""
    return list((campaign.path / "cycles").glob("[0-9]*"))


def _number(path: Path) -> int:
    digits = path.name.partition("-")[0]
    return int(digits) if digits.isdigit() else 0

"""A running campaign: one cycle after the other, with pauses, requests and failures in between."""

from __future__ import annotations

import asyncio
import concurrent.futures
import errno
import re
import select
import shutil
import sys
import uuid
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass, replace
from functools import partial
from time import monotonic, time
from typing import Any, TypeAlias

from pneudrive import __version__
from pneudrive.arrays import Plain
from pneudrive.campaign.cycle import WORDS, Cycle, Head
from pneudrive.campaign.planning.preflight import Plan, Planned
from pneudrive.campaign.running import attempt
from pneudrive.campaign.running.live import Display, LiveFiles, counted
from pneudrive.campaign.storage import control
from pneudrive.campaign.storage.folder import CYCLES, LOG, Campaign, tidy, write_cycle
from pneudrive.errors import CampaignError, ConnectionLostError, RigError
from pneudrive.rig.interface import Rig, Samples

#: Functions that are called with the name and the content of each document.
Subscribers: TypeAlias = "Sequence[Callable[[str, dict], None]]"


class Terminal:
    """Source of answers to prompts: the user at the terminal of this process, if there is a terminal."""

    def __init__(self) -> None:
        self._open = True

    @property
    def there(self) -> bool:
        """Whether a user can answer, i.e. standard input is a terminal."""
        try:
            return self._open and sys.stdin.isatty() and sys.stdout.isatty()
        except (AttributeError, ValueError):  # closed or missing
            return False

    def show(self, text: str) -> None:
        """Show a text."""
        try:
            sys.stdout.write(text)
            sys.stdout.flush()
        except (OSError, ValueError):
            self._open = False

    def line(self, seconds: float) -> str | None:
        """Wait for a line; return None if no line arrived."""
        ready, _, _ = select.select([sys.stdin], [], [], seconds)
        if not ready:
            return None
        text = sys.stdin.readline()
        self._open = bool(text)
        return text.strip() if text else None


#: The stream of the events, and the name of a campaign as a device.
STREAM, DEVICE = "primary", "campaign"


class Documents:
    """Publisher of the documents of one run in bluesky's event model.

    Parameters
    ----------
    subscribers : sequence of callable
        Called as ``subscriber(name, document)``, in the thread that runs the campaign.
    source : str
        Source of the data of an event.
    metadata : dict
        Metadata of the start document.
    """

    def __init__(self, subscribers: Subscribers, source: str, metadata: Plain) -> None:
        self._subscribers, self._source = tuple(subscribers), source
        self._descriptor, self._events = "", 0
        self._run = self._publish("start", {**metadata, "scan_id": 1})

    def _publish(self, name: str, content: Plain) -> str:
        document = {"uid": str(uuid.uuid4()), "time": time(), **content}
        for subscriber in self._subscribers:
            subscriber(name, document)
        return document["uid"]

    def event(self, data: Plain) -> None:
        """Publish an event for a finished cycle. Before the first event, publish the descriptor of its keys."""
        if not self._descriptor:
            about = {"source": self._source, "shape": [], "object_name": DEVICE}
            keys = {name: about | {"dtype": "string" if isinstance(v, str) else "number"} for name, v in data.items()}
            content = {
                "run_start": self._run,
                "name": STREAM,
                "data_keys": keys,
                "object_keys": {DEVICE: list(keys)},
                "configuration": {DEVICE: {"data": {}, "timestamps": {}, "data_keys": {}}},
                "hints": {},
            }
            self._descriptor = self._publish("descriptor", content)
        self._events += 1
        times = dict.fromkeys(data, time())
        content = {"descriptor": self._descriptor, "seq_num": self._events, "data": data, "timestamps": times}
        self._publish("event", {**content, "filled": {}})

    def stop(self, exit_status: str, reason: str = "") -> None:
        """Publish the end of the run: ``success``, ``abort`` or ``fail``."""
        count = {STREAM: self._events} if self._events else {}
        content = {"run_start": self._run, "exit_status": exit_status, "reason": reason, "num_events": count}
        self._publish("stop", content)


#: Bytes on disk per sample, and per cycle without its samples, while a cycle is written.
SAMPLE_BYTES, CYCLE_BYTES = 60, 100_000
#: Errors of a lost or unresponsive connection. Up to Python 3.10, the three timeouts are different types.
LOST = (ConnectionLostError, ConnectionError, TimeoutError, asyncio.TimeoutError, concurrent.futures.TimeoutError)
#: Numbers after which the campaign ends: attempts at a cycle, and cycles in a row with serious flags, which show a
#: broken sensor (both assumed).
MOST_ATTEMPTS, MOST_BAD = 5, 3
#: Results of a run without an error.
DONE, ENDED = "done", "ended"


class EndedError(Exception):
    """The campaign was ended; the message names the person or the reason."""


@dataclass(frozen=True)
class Options:
    """Options of a campaign run.

    Parameters
    ----------
    operator : str
        Name of the person at the rig.
    yes : bool
        Whether operator's steps count as done without a question to the operator.
    patience_s : float
        Longest wait for the conditions for measuring. After this time the campaign ends.
    steady_s : float
        Time for which all conditions must be met before the campaign continues.
    look_s : float
        Interval between queries of the rig's state while waiting.
    display : Display, optional
        Default: nothing is shown.
    prompt : Terminal, optional
        Source of answers in pauses and for operator's steps. Default: the terminal.
    """

    operator: str = ""
    yes: bool = False
    patience_s: float = 600.0
    steady_s: float = 3.0
    look_s: float = 1.0
    display: Display | None = None
    prompt: Terminal | None = None


class CampaignRun:
    """A running campaign: runs the cycles, serves requests and stores results.

    The thread that calls `run` controls the campaign and stores the cycles. The rig's methods run on another thread.
    While the first thread waits for the rig, it serves requests to pause, stop and end. Requests do not interrupt the
    writing of a cycle.

    Parameters
    ----------
    campaign : Campaign
    plan : Plan
    rig : Rig
    options : Options
    lock : FolderLock
    subscribers : sequence of callable
        As in `pneudrive.campaign.run.run_campaign`.
    """

    def __init__(
        self,
        campaign: Campaign,
        plan: Plan,
        rig: Rig,
        options: Options,
        lock: control.FolderLock,
        subscribers: Subscribers,
    ) -> None:
        self.campaign, self.plan, self.options = campaign, plan, options
        self._lock, self._prompt, self._subscribers = lock, options.prompt or Terminal(), subscribers
        self._log = partial(control.append_line, campaign.path / LOG)
        self._displays = (options.display or Display(), LiveFiles(campaign.path))
        files, tidied = tidy(campaign)
        for line in tidied:
            self._tell(line)
        self._requests = control.Requests(campaign.path)
        # The tighter of the bounds of protocol and rig for each condition.
        force_n = plan.protocol.conditions.force_share * plan.allowed.force_n
        self._bounds = replace(plan.allowed, force_n=force_n)
        self._attempts = attempt.Attempts(rig, self._bounds, partial(self._show, "part"))
        self.finished = {file.cycle.key: file.head.flags for file in files}
        numbers = (path.name.partition("-")[0] for path in (campaign.path / CYCLES).glob("[0-9]*"))
        self._index = max((int(number) for number in numbers if number.isdigit()), default=0)
        if files:
            self._attempts.finished(files[-1].head)
        self._pausing = ""  # PAUSE: after the cycle; STOP: now
        self._leaving = False  # whether a pause ends the campaign

    @property
    def total(self) -> int:
        """Total number of cycles."""
        return len(self.finished.keys() | {cycle.key for cycle in self.plan.cycles})

    @property
    def now(self) -> str:
        """Progress as text: number of finished cycles, and total number."""
        return f"{len(self.finished)} of {self.total} cycles"

    def _tell(self, text: str) -> None:
        self._log(text)
        self._show("say", text)

    def _show(self, what: str, *arguments: Any) -> None:  # noqa: ANN401 - as the method of a display has them
        """Call a method of each display. Errors of a display go to the log and do not end the campaign."""
        for display in self._displays:
            try:
                getattr(display, what)(*arguments)
            except Exception as error:  # noqa: PERF203 - the terminal is gone, or a display is wrong
                self._log(f"the display failed: {type(error).__name__}: {error}")

    def run(self) -> str:
        """Run the remaining cycles of the plan, with pauses, and bring the rig to rest.

        Returns
        -------
        str
            `DONE`, or `ENDED` if a person ended the campaign, which can then be resumed.
        """
        self._log(f"{'resumed' if self.finished else 'began'} after {self.now}; rig {self.campaign.identity.name}")
        self._show("began", self.plan, self.finished.keys())
        for note in self.plan.notes:
            self._show("say", f"note: {note}")
        ended = "failed"
        with self._requests.signals():  # to the end: another Ctrl-C must not interrupt bringing the rig to rest
            try:
                ended = self._cycles()
            except BaseException as error:
                self._log(f"{type(error).__name__}: {error}")
                mark(error)
                raise
            finally:
                trouble = self._attempts.rest() and self._attempts.rest()  # a second attempt if the first failed
                self._attempts.close()
                self._show("ended")
                restless = f"; the rig may not be at rest: {trouble}" if trouble else ""
                self._log(f"{ended} after {self.now}{restless}")
                if trouble:
                    self._show("say", f"THE RIG MAY NOT BE AT REST: {trouble}")
        if trouble:
            error = RigError("the rig could not be brought to rest", value=trouble, remedy="Stop it by hand.")
            mark(error)
            raise error
        return ended

    def _cycles(self) -> str:
        """Run the remaining cycles, and publish their documents."""
        about = {
            "plan_name": "friction campaign",
            "campaign": str(self.campaign.about.get("name", "")),
            "folder": str(self.campaign.path),
            "operator": self.options.operator,
            "synthetic": self.campaign.synthetic,
            "num_points": len(self.plan.planned),
            "versions": {"pneudrive": __version__},
        }
        documents = Documents(self._subscribers, f"campaign:{self.campaign.path.name}", about)
        bad = 0
        try:
            for planned in self.plan.planned:
                key = planned.cycle.key
                if key in self.finished:
                    continue
                data = self._cycle(planned)
                documents.event(data)
                self._checkpoint()
                flags = self.finished[key]
                bad = bad + 1 if attempt.SERIOUS & flags.keys() else 0
                if bad >= MOST_BAD:
                    where = str(self.campaign.path / CYCLES / data["file"])
                    raise CampaignError.of("campaign.bad-cycles", where=where, value=counted(flags), count=bad)
        except EndedError as ended:
            documents.stop("abort", str(ended))
            return ENDED
        except BaseException as error:
            documents.stop("fail", str(error))
            raise
        documents.stop("success")
        return DONE

    # -- requests ---------------------------------------------------------------------------------------------

    def _on_rig(self, job: Callable[[Rig], Any], *, moves: bool = True) -> Future[Any]:
        """Run a job on the rig's thread to its end, and serve requests during this time."""
        future = self._attempts.start(job, moves=moves)
        future.add_done_callback(lambda _: self._requests.wake())
        while not future.done():
            self._requests.wait()
            self._serve()
        return future

    def _serve(self) -> None:
        """Serve the requests since the last call.

        Raises
        ------
        EndedError
            If the campaign must end.
        """
        request = self._requests.take()
        if request is None:
            return
        word = request.word
        self._leaving = request.by == control.CTRL_C and not self._prompt.there  # nobody could end a pause
        if word == control.RESUME:
            self._tell(f"{request.by} asked to continue, but nothing is paused")
            return
        about = WORDS["requests"][word]
        self._lock.tell(state=about["state"], text=about["text"])
        self._tell(about["line"].format(action="ending" if self._leaving else "pausing", by=request.by))
        if word != control.ABORT:
            self._pausing = word
        if word != control.PAUSE:
            self._rest()
        if word == control.ABORT:
            raise EndedError(request.by)

    def _checkpoint(self) -> None:
        """Serve the requests, and pause if one asks for it."""
        self._serve()
        if self._pausing:
            self._pause()

    def _pause(self, question: str = "") -> dict[str, str]:
        """Stop the axis and wait until a person resumes the campaign or confirms the operator's step.

        Returns
        -------
        dict
            Name of the person who answered, time, and ``how``: at the terminal or by another process.

        Raises
        ------
        EndedError
            If the campaign must end.
        """
        self._pausing = ""
        self._rest()
        if self._leaving:
            raise EndedError("the process ends and cannot wait for an answer")
        operator = self.options.operator or control.user()
        if question:
            text = f"Operator's step: {question}"
            keys = f"Enter: done (by {operator}), another name: done by that person, a: end > "
            self._lock.tell(state="operator", text=question)
        else:
            text = f"Paused after {self.now}; the axis is at rest, the pressure released."
            keys = "Enter: continue, a: end the campaign > "
            self._lock.tell(state="paused", text=f"after {self.now}")
        self._log(f"paused{': ' + question if question else ''}")
        self._show("suspend")
        if self._prompt.there:
            self._prompt.show(f"{text}\n{keys}")
        else:
            self._show("say", f"{text} To resume: pneudrive campaign resume {self.campaign.path}")
        goes_on, name, how = self._answer(operator)
        answer = f"{'resumed' if goes_on else 'ended'} {'at the keyboard' if how == 'terminal' else f'by {name}'}"
        if not goes_on:
            self._tell(answer)
            raise EndedError("ended while paused")
        self._log(answer)
        self._show("go_on")
        self._requests.presses = 0
        self._lock.tell(state="running", text="")
        return {"name": name, "time": control.now(), "how": how}

    def _answer(self, operator: str) -> tuple[bool, str, str]:
        """Wait for the answer to a pause, at the terminal or from another process.

        Returns
        -------
        bool, str, str
            Whether the campaign continues, who answered, and how. At the terminal, Enter continues.
        """
        while True:
            request = self._requests.take()
            if request is not None and (
                request.word in (control.ABORT, control.RESUME) or request.by == control.CTRL_C
            ):
                return request.word == control.RESUME, request.by, "another process"
            if not self._prompt.there:
                self._requests.wait()
            elif (line := self._prompt.line(control.LOOK_S)) is not None:
                return line.lower() not in ("a", "abort", "end"), line or operator, "terminal"

    # -- a cycle ----------------------------------------------------------------------------------------------

    def _cycle(self, planned: Planned) -> Plain:
        """Run a cycle, store it, and return the data of its event."""
        cycle = planned.cycle
        self._lock.tell(state="running", text="", cycle=cycle.key)
        self._show("cycle", cycle)
        confirmed: dict[str, str] = {}
        if cycle.text:  # a step of the operator
            confirmed = {"name": self.options.operator or control.user(), "time": control.now(), "how": "--yes"}
            if not self.options.yes:
                confirmed = self._pause(cycle.text)  # at rest: somebody will reach into the rig
            by = "assumed done: --yes" if self.options.yes else f"confirmed by {confirmed['name']}"
            self._log(f"{cycle.key}: {cycle.text} ({by})")
        return self._write(*self._measured(cycle, planned.samples * SAMPLE_BYTES + CYCLE_BYTES), confirmed)

    def _measured(self, cycle: Cycle, needed: int) -> tuple[Head, Samples]:
        """Run a cycle until it is complete. Wait while conditions are not met. The disk needs `needed` free bytes."""
        settling_s, number, failures = self.plan.protocol.pressure.settling_s, 0, 0
        while True:
            self._await_conditions(cycle)
            if (free := shutil.disk_usage(self.campaign.path).free) < needed:
                sizes = {"free": free / 1e6, "needed": needed / 1e6, "remedy": control.REMEDIES[errno.ENOSPC]}
                raise CampaignError.of("campaign.disk-full", where=self.campaign.path, **sizes)
            self._checkpoint()
            number += 1
            run = self._on_rig(partial(self._attempts.run, cycle=cycle, settling_s=settling_s, number=number))
            error = run.exception()
            if error is None:
                return run.result()
            if self._pausing != control.STOP:  # this request ended the cycle
                failures += 1
                self._give_up(cycle, error, failures)
            self._checkpoint()
            self._show("cycle", cycle)  # another attempt

    def _give_up(self, cycle: Cycle, error: BaseException, failures: int) -> None:
        """Handle a failed attempt. `failures` counts the failed attempts at the cycle.

        Raises
        ------
        PneudriveError
            Error of the rig, or the message that no attempts are left.
        """
        of_rig = None if isinstance(error, attempt.GiveUpError) else attempt.rig_error(error)
        reason = str(of_rig or error).splitlines()[0].strip()
        self._rest()
        self._tell(f"{cycle.key} was given up: {reason}")
        lost = of_rig is None or _lost(of_rig)
        if not lost and not self._trouble().startswith(attempt.FAILURES):
            raise of_rig  # type: ignore[misc] - not None if the connection is not lost
        if failures >= MOST_ATTEMPTS:
            counts = {"key": cycle.key, "times": failures, "most": MOST_ATTEMPTS}
            raise CampaignError.of("campaign.given-up", value=reason, **counts) from of_rig

    def _trouble(self) -> str:
        """Return the reason why measuring cannot continue; empty if it can."""
        return self._on_rig(partial(attempt.trouble_of, self._bounds), moves=False).result()

    def _rest(self) -> None:
        trouble = self._attempts.rest()
        if trouble:
            self._tell(f"the rig may not be at rest: {trouble}")

    def _await_conditions(self, cycle: Cycle) -> None:
        """Wait for a limited time until conditions, rig and connection allow measuring."""
        options = self.options
        waited = good_for = 0.0
        last_wrong = ""
        while True:
            self._checkpoint()
            wrong = self._trouble()
            if not wrong and (not last_wrong or good_for >= options.steady_s):
                break
            good_for = 0.0 if wrong else good_for + options.look_s
            if wrong and _without_numbers(wrong) != _without_numbers(last_wrong):
                self._tell(f"waiting before {cycle.key}: {wrong}")
                self._lock.tell(state="waiting", text=wrong)
            if wrong.startswith(attempt.FAILURES):
                self._attempts.homed = False
            if wrong and not last_wrong:
                self._rest()
            last_wrong = wrong or last_wrong
            if waited >= options.patience_s:
                raise CampaignError.of("campaign.waited", value=last_wrong, seconds=options.patience_s)
            until = monotonic() + options.look_s
            while (left := until - monotonic()) > 0.0 and not self._pausing:
                self._requests.wait(left)
                self._serve()
            waited += options.look_s
        if last_wrong:
            self._tell(f"continued after {waited:.3g} s: conditions are met again")
            self._lock.tell(state="running", text="")

    # -- finished cycles ----------------------------------------------------------------------------------------

    def _write(self, head: Head, samples: Samples, confirmed: dict[str, str]) -> Plain:
        """Store a cycle, which is then finished. Requests do not interrupt the writing."""
        cycle = head.cycle
        assert cycle.key not in self.finished, f"{cycle.key} is finished already"
        self._index += 1
        flags = attempt.arrival_flags(samples, cycle, self.campaign.identity) if cycle.steps else {}
        head = replace(head, index=self._index, flags=flags, confirmed=confirmed)
        path = write_cycle(self.campaign.path, head, samples)
        self._attempts.finished(head)
        self.finished[cycle.key] = flags
        flagged = f"; flags: {counted(flags)}" if flags else ""
        self._log(f"{cycle.key} is finished, {len(samples)} samples{flagged}")
        self._show("finished", cycle, flags)
        return {
            "index": self._index,
            "key": cycle.key,
            "kind": cycle.kind,
            "speed_m_s": float("nan") if cycle.speed_m_s is None else cycle.speed_m_s,
            "pressure_a_pa": cycle.pressure_a_pa,
            "pressure_b_pa": cycle.pressure_b_pa,
            "flags": " ".join(flags),
            "file": path.name,
        }


def mark(error: BaseException) -> None:
    """Mark an error that ended a campaign after its start, see `pneudrive.campaign.run.can_be_resumed`."""
    error.while_running = True  # type: ignore[attr-defined]


def _without_numbers(text: str) -> str:
    """Return a message without its numbers, so that repeated messages are logged only once."""
    return re.sub(r"\d[\d.e+-]*", "", text)


def _lost(error: BaseException | None) -> bool:
    """Return whether a lost connection caused an error."""
    while error is not None:
        if isinstance(error, LOST):
            return True
        error = error.__cause__ or error.__context__
    return False

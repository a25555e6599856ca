"""A campaign runs by itself: interrupted anywhere, it goes on to the same samples, and the axis is always at rest."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import threading
import time
from collections import namedtuple
from dataclasses import replace
from pathlib import Path

import pytest
from event_model import DocumentNames, schema_validators

from campaign.fake_rig import QUICK, FakeRig, at_rest, contents, on_part, press, protocol
from oracle.rig_faults import Fault, FaultyRig
from pneudrive.campaign.run import DONE, ENDED, resume_campaign, run_campaign
from pneudrive.campaign.running import campaign_run
from pneudrive.campaign.running.live import Display
from pneudrive.campaign.storage import control as storage
from pneudrive.campaign.storage.control import ABORT, PAUSE, RESUME, STOP, FolderLock, ask, holder, wait_for
from pneudrive.campaign.storage.folder import Campaign, status_of
from pneudrive.errors import CampaignError, ConnectionLostError, ProtocolError, RigError

HERE = Path(__file__).parent


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """Run the campaign that all others must equal."""
    folder = tmp_path_factory.mktemp("undisturbed") / "c"
    return done(folder, FakeRig())


def finish(folder, undisturbed):
    """Resume and compare."""
    assert resume_campaign(folder, FakeRig(), options=QUICK).ended == DONE
    assert contents(folder) == undisturbed


def done(folder, rig, **further):
    """Run a campaign to its end; return what it holds."""
    assert run_campaign(protocol(), rig, folder, options=replace(QUICK, **further)).ended == DONE
    return contents(folder)


def failed(folder, rig, error, said):
    """Run a campaign that ends with an error and leaves the axis at rest; return the message."""
    with pytest.raises(error, match=said) as caught:
        run_campaign(protocol(), rig, folder, options=QUICK)
    assert at_rest(rig)
    return str(caught.value)


def test_a_campaign_is_run_told_and_left_at_rest(tmp_path):
    rig, documents = FakeRig(), []
    result = run_campaign(
        protocol(), rig, tmp_path / "c", options=QUICK, subscribers=[lambda name, doc: documents.append((name, doc))]
    )
    assert (result.finished, result.ended) == (10, DONE)
    assert at_rest(rig)
    assert [name for name, _ in documents] == ["start", "descriptor", *["event"] * 10, "stop"]
    assert documents[0][1]["synthetic"] is True
    assert documents[3][1]["data"]["key"] == "b1/tare"
    for name, document in documents:
        schema_validators[DocumentNames[name]].validate(document)
    assert (documents[-1][1]["exit_status"], documents[-1][1]["num_events"]) == ("success", {"primary": 10})
    found = status_of(tmp_path / "c")
    assert (len(found.files), found.planned, found.to_do, found.remaining_s, found.problems) == (10, 10, 0, 0.0, ())
    assert found.holder is None


def test_running_again_does_nothing_and_another_protocol_is_refused(tmp_path, undisturbed):
    run_campaign(protocol(), FakeRig(), tmp_path / "c", options=QUICK)
    again = FakeRig()
    run_campaign(protocol(), again, tmp_path / "c", options=QUICK)
    assert "acquire" not in again.calls
    assert contents(tmp_path / "c") == undisturbed
    with pytest.raises(CampaignError, match="another protocol"):
        run_campaign(protocol(repeats=2), FakeRig(), tmp_path / "c", options=QUICK)


def test_another_rig_is_refused(tmp_path):
    run_campaign(protocol(), FakeRig(), tmp_path / "c", options=QUICK)
    rig = FakeRig()
    identity = replace(rig.identity(), area_a_m2=5e-4)
    rig.identity = lambda: identity
    with pytest.raises(CampaignError, match="area_a_m2"):
        resume_campaign(tmp_path / "c", rig, options=QUICK)


def test_a_protocol_beyond_the_rig_makes_no_folder(tmp_path):
    rig = FakeRig()
    limits = replace(rig.limits(), speed_m_s=0.1)
    rig.limits = lambda: limits
    with pytest.raises(ProtocolError):
        run_campaign(protocol(), rig, tmp_path / "c", options=QUICK)
    assert not (tmp_path / "c").exists()
    assert "acquire" not in rig.calls


# -- requests -----------------------------------------------------------------------------------------------------


def in_background(folder, rig):
    """Run a campaign in a thread; give the thread and where its result will be."""
    result = []
    thread = threading.Thread(target=lambda: result.append(run_campaign(protocol(), rig, folder, options=QUICK)))
    thread.start()
    deadline = time.monotonic() + 10.0
    while rig.calls.count("part") < 3 and time.monotonic() < deadline:
        time.sleep(0.005)
    return thread, result


def test_pause_resume_and_abort_from_another_process(tmp_path, undisturbed):
    rig = FakeRig(hold_up_s=0.2)
    thread, result = in_background(tmp_path / "c", rig)
    for word in (PAUSE, STOP):
        ask(tmp_path / "c", word, "eve")
        paused = wait_for(tmp_path / "c", ("paused",), 10.0)
        assert paused is not None
        assert paused.state == "paused"
        assert at_rest(rig)
        before = len(rig.calls)
        time.sleep(0.3)
        assert len(rig.calls) == before
        ask(tmp_path / "c", RESUME, "eve")
        assert wait_for(tmp_path / "c", ("running",), 10.0).state == "running"
    ask(tmp_path / "c", ABORT, "eve")
    thread.join(20.0)
    assert result[0].ended == ENDED
    assert at_rest(rig)
    assert "resumed by eve" in (tmp_path / "c" / "campaign.log").read_text(encoding="utf-8")
    finish(tmp_path / "c", undisturbed)


def test_requests_to_nobody_and_from_before_are_harmless(tmp_path, undisturbed):
    with pytest.raises(CampaignError, match="no process works"):
        ask(tmp_path, ABORT, "eve")
    with pytest.raises(RigError):
        run_campaign(protocol(), FakeRig(trouble=on_part(4, fail)), tmp_path / "c", options=QUICK)
    (tmp_path / "c" / "control" / "1-abort").write_text('{"word": "abort", "by": "a process that is gone"}')
    (tmp_path / "c" / "control" / "2-x").write_text("no JSON")
    finish(tmp_path / "c", undisturbed)


def fail(rig):
    raise RigError("following error")


def test_the_second_process_is_refused(tmp_path):
    run_campaign(protocol(), FakeRig(), tmp_path / "c", options=QUICK)
    code = (
        "import sys\n"
        "from pneudrive.campaign.run import resume_campaign\n"
        "from campaign.fake_rig import FakeRig\n"
        "resume_campaign(sys.argv[1], FakeRig())\n"
    )
    with FolderLock(tmp_path / "c"):
        before = {path: path.stat().st_mtime_ns for path in (tmp_path / "c" / "cycles").iterdir()}
        other = subprocess.run(
            [sys.executable, "-c", code, str(tmp_path / "c")],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE.parent), *sys.path])},
        )
    assert other.returncode != 0
    assert f"another process works in this campaign folder.   {tmp_path / 'c'}" in other.stderr
    assert f"process {os.getpid()} of" in other.stderr
    assert before == {path: path.stat().st_mtime_ns for path in (tmp_path / "c" / "cycles").iterdir()}


@pytest.fixture(autouse=True)
def signals_of_a_terminal():
    """Take Ctrl-C as a terminal's process does, whatever the tests were started from."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_signals_that_are_ignored_stay_ignored(tmp_path):
    """As nohup asks for."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        rig = FakeRig(trouble=on_part(4, lambda rig: os.kill(os.getpid(), signal.SIGHUP)))
        assert run_campaign(protocol(), rig, tmp_path / "c", options=QUICK).ended == DONE
    finally:
        signal.signal(signal.SIGHUP, before)


class Answers:
    """Somebody who answers what was written down."""

    there = True

    def __init__(self, *lines):
        self.lines, self.shown = list(lines), []

    def show(self, text):
        self.shown.append(text)

    def line(self, seconds):
        return self.lines.pop(0) if self.lines else None


def test_ctrl_c_finishes_the_cycle_and_asks_and_twice_stops_at_once(tmp_path, undisturbed):
    def twice(rig):
        press(rig)
        press(rig)

    rig, prompt = FakeRig(trouble=on_part(4, press)), Answers("")
    assert run_campaign(protocol(), rig, tmp_path / "a", options=replace(QUICK, prompt=prompt)).ended == DONE
    assert "Paused after 3 of 10 cycles" in prompt.shown[0]
    assert rig.calls.count("home") == 1  # nothing was broken off
    assert contents(tmp_path / "a") == undisturbed
    rig, prompt = FakeRig(trouble=on_part(4, twice)), Answers("a")
    assert run_campaign(protocol(), rig, tmp_path / "b", options=replace(QUICK, prompt=prompt)).ended == ENDED
    assert "Paused after 2 of 10 cycles" in prompt.shown[0]
    assert at_rest(rig)
    finish(tmp_path / "b", undisturbed)


def test_ctrl_c_in_a_pause_ends_the_campaign(tmp_path):
    class Presses(Answers):
        def line(self, seconds):
            press(None)

    rig = FakeRig(trouble=on_part(4, press))
    assert run_campaign(protocol(), rig, tmp_path / "c", options=replace(QUICK, prompt=Presses())).ended == ENDED
    assert at_rest(rig)


def test_ctrl_c_does_not_break_off_coming_to_rest(tmp_path):
    class Reluctant(FakeRig):
        def stop(self):
            tries.append(self)
            if len(tries) == 1:
                raise OSError("the bus is busy")
            press(self)  # while the campaign, at its end, tries once more
            super().stop()

    tries, rig = [], Reluctant()
    assert run_campaign(protocol(), rig, tmp_path / "c", options=QUICK).ended == DONE
    assert at_rest(rig)


def test_a_display_that_fails_does_not_end_the_campaign(tmp_path, undisturbed):
    class Broken(Display):
        def part(self, samples):
            raise OSError("the terminal is gone")

        cycle = finished = say = part

    assert done(tmp_path / "c", FakeRig(), display=Broken()) == undisturbed


def test_a_rig_that_ends_early_when_it_is_stopped_has_not_finished_the_cycle(tmp_path, undisturbed):
    class Obedient(FakeRig):
        def acquire(self, steps, sampling):
            for part in super().acquire(steps, sampling):
                yield part
                if self.calls[-1] == "stop":
                    return

    rig = Obedient(trouble=on_part(4, lambda rig: (press(rig), press(rig))))
    assert done(tmp_path / "c", rig, prompt=Answers("")) == undisturbed
    assert rig.calls.count("home") == 2


def test_ctrl_c_where_nobody_would_answer_ends_after_the_cycle(tmp_path, undisturbed):
    rig = FakeRig(trouble=on_part(4, press))
    nobody = Answers()
    nobody.there = False
    result = run_campaign(protocol(), rig, tmp_path / "c", options=replace(QUICK, prompt=nobody))
    assert (result.finished, result.ended) == (3, ENDED)
    assert at_rest(rig)
    finish(tmp_path / "c", undisturbed)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_to_end_leaves_the_axis_at_rest(tmp_path, number):
    """In a process of its own, which also tells that nothing of it stays behind."""
    folder, calls = tmp_path / "c", tmp_path / "calls"
    code = (
        "import sys\n"
        "from campaign.fake_rig import FakeRig, protocol\n"
        "from pneudrive.campaign.run import run_campaign\n"
        "rig = FakeRig(hold_up_s=0.1)\n"
        "ended = run_campaign(protocol(), rig, sys.argv[1]).ended\n"
        "open(sys.argv[2], 'w').write(' '.join([ended, *rig.calls]))\n"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", code, str(folder), str(calls)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE.parent), *sys.path])},
        # Who runs the tests may ignore the signal, as nohup does, and what is ignored stays so in a new process.
        preexec_fn=lambda: signal.signal(number, signal.SIG_DFL),  # noqa: PLW1509 (no threads here)
    )
    deadline = time.monotonic() + 30.0
    while not (folder / "cycles").is_dir() or len(list((folder / "cycles").iterdir())) < 3:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(number)
    assert process.wait(20.0) == 0
    ended, *done = calls.read_text().split()
    assert ended == ENDED
    assert "stop" in done[-3:]
    assert Campaign.open(folder).checked()[1] == []
    assert holder(folder) is None


# -- the operator ---------------------------------------------------------------------------------------------------

MOUNTING = '[mounting]\nlevels = ["foot", "flange"]\nask = "Mount the drive by its {level}."\n'


def test_operators_steps_are_confirmed_and_kept(tmp_path):
    class AtRest(Answers):
        def show(self, text):
            super().show(text)
            assert at_rest(rig)

    rig, prompt = FakeRig(), AtRest("", "bob")
    run_campaign(protocol(MOUNTING), rig, tmp_path / "c", options=replace(QUICK, prompt=prompt))
    assert [text.splitlines()[0] for text in prompt.shown] == [
        "Operator's step: Mount the drive by its foot.",
        "Operator's step: Mount the drive by its flange.",
    ]
    steps = [file for file in Campaign.open(tmp_path / "c").cycles() if file.head.cycle.kind == "operator"]
    assert [step.head.confirmed["name"] for step in steps] == ["anna", "bob"]
    assert all(step.head.confirmed["time"] and len(step.samples()) == 0 for step in steps)
    unattended = replace(QUICK, yes=True)
    run_campaign(protocol(MOUNTING), FakeRig(), tmp_path / "d", options=unattended)
    step = next(Campaign.open(tmp_path / "d").cycles())
    assert step.head.confirmed["how"] == "--yes"
    sweeps = {key: value[-1] for key, value in contents(tmp_path / "d").items()}
    assert sweeps == {key: value[-1] for key, value in contents(tmp_path / "c").items()}


# -- conditions and faults ------------------------------------------------------------------------------------------


def for_a_while(name, bad, good, looks=30):
    """Give the trouble that makes a state bad with part 8, and good again after so many looks at it."""
    since = []

    def trouble(rig, word):
        if word == "part" and rig.calls.count("part") == 8 and not since:
            setattr(rig, name, bad)
            since.append(rig.calls.count("state"))
        elif since and rig.calls.count("state") >= since[0] + looks:
            setattr(rig, name, good)

    return trouble


@pytest.mark.parametrize(
    ("name", "bad", "good", "said"),
    [
        ("supply_pa", 4e5, 7e5, "the supply pressure is 4 bar absolute, less than 5 bar"),
        ("fault", "emergency stop", None, "fault of the rig: emergency stop"),
    ],
)
def test_a_campaign_waits_for_conditions_and_goes_on(tmp_path, undisturbed, name, bad, good, said):
    rig = FakeRig(trouble=for_a_while(name, bad, good))
    assert run_campaign(protocol(), rig, tmp_path / "c", options=QUICK).ended == DONE
    log = (tmp_path / "c" / "campaign.log").read_text(encoding="utf-8")
    assert f"waiting before b1/sweep/v50/a0/b0/r1: {said}" in log
    assert "continued after" in log
    assert contents(tmp_path / "c") == undisturbed


def test_conditions_that_stay_away_end_the_campaign(tmp_path, undisturbed):
    rig = FakeRig(trouble=for_a_while("supply_pa", 4e5, 7e5, looks=10_000))
    failed(tmp_path / "c", rig, CampaignError, r"after a wait of 0.5 s")
    finish(tmp_path / "c", undisturbed)


def test_a_force_near_the_limit_gives_the_cycle_up(tmp_path):
    def heavy(key, part):
        return replace(part, force_n=part.force_n + (170.0 if key == "b1/sweep/v50/a0/b0/r1" else 0.0))

    rig = FakeRig(spoil=heavy)
    assert "the limit is 180 N" in failed(tmp_path / "c", rig, CampaignError, "failed 5 times")
    assert rig.calls.count("closed") == 4 + 5


def lose(rig):
    raise ConnectionResetError("peer is gone")


def lose_and_find(rig):
    raise ConnectionLostError("the connection was lost and is back")


@pytest.mark.parametrize("act", [lose, lose_and_find])
def test_a_lost_connection_costs_the_running_cycle(tmp_path, undisturbed, act):
    rig = FakeRig(trouble=on_part(8, act))
    assert done(tmp_path / "c", rig) == undisturbed


def bug(rig):
    return None + 1


@pytest.mark.parametrize(("act", "said"), [(fail, "following error"), (bug, "code of the rig failed: TypeError")])
def test_what_the_rig_cannot_do_ends_the_campaign_at_rest(tmp_path, undisturbed, act, said):
    rig = FakeRig(trouble=on_part(8, act))
    failed(tmp_path / "c", rig, RigError, said)
    assert len(contents(tmp_path / "c")) == 4
    finish(tmp_path / "c", undisturbed)


def test_a_rig_that_cannot_be_stopped_is_told(tmp_path):
    def trouble(rig, word):
        if word == "stop":
            raise OSError("no route to the drive")

    with pytest.raises(RigError, match="could not be brought to rest"):
        run_campaign(protocol(), FakeRig(trouble=trouble), tmp_path / "c", options=QUICK)
    assert "may not be at rest: no route" in (tmp_path / "c" / "campaign.log").read_text(encoding="utf-8")


FAULTS = {
    "non_finite": Fault("nan", cycles=(3,), begin_s=1.0, end_s=5.0),
    "stuck": Fault("stuck", cycles=(3,), begin_s=1.0, end_s=40.0),
    "dropped": Fault("dropped", cycles=(3,), begin_s=10.0, end_s=12.0),
    "duplicated": Fault("duplicated", cycles=(3,), begin_s=10.0, end_s=12.0),
    "time_runs_back": Fault("clock", cycles=(3,), begin_s=20.0, value=30.0),
    "saturated": Fault("saturated", cycles=(3,), begin_s=10.0, end_s=10.5),
}


@pytest.mark.parametrize("flag", FAULTS)
def test_a_bad_sensor_is_a_named_flag_of_its_cycle_alone(tmp_path, undisturbed, flag):
    result = run_campaign(protocol(), FaultyRig(FakeRig(), [FAULTS[flag]]), tmp_path / "c", options=QUICK)
    assert result.ended == DONE
    flags = {file.head.cycle.key: file.head.flags for file in result.campaign.cycles() if file.head.flags}
    assert list(flags) == ["b1/sweep/v2/a0/b0/r1"]
    assert flags["b1/sweep/v2/a0/b0/r1"][flag] > 0
    assert result.campaign.checked()[1] == []
    others = contents(tmp_path / "c")
    assert all(others[key] == undisturbed[key] for key in others if key not in flags)


def test_a_broken_sensor_does_not_go_on_for_ever(tmp_path):
    rig = FaultyRig(FakeRig(), [Fault("nan")])
    with pytest.raises(CampaignError, match="3 cycles in a row"):
        run_campaign(protocol(), rig, tmp_path / "c", options=QUICK)
    assert len(contents(tmp_path / "c")) == 3


# -- disks ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EACCES, errno.EIO])
def test_a_disk_that_refuses_ends_the_campaign_and_spoils_nothing(tmp_path, undisturbed, monkeypatch, number):
    written, fsync = [], os.fsync

    def refuse(descriptor):
        written.append(descriptor)
        if len(written) == 16:  # in the middle of a cycle's file
            raise OSError(number, os.strerror(number))
        fsync(descriptor)

    monkeypatch.setattr(storage.os, "fsync", refuse)
    rig = FakeRig()
    assert os.strerror(number) in failed(tmp_path / "c", rig, CampaignError, "cannot be written")
    monkeypatch.undo()
    assert Campaign.open(tmp_path / "c").checked()[1] == []
    assert not list((tmp_path / "c").rglob("*.part"))
    finish(tmp_path / "c", undisturbed)


def test_a_cycle_that_has_no_room_is_not_begun(tmp_path, monkeypatch):
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(campaign_run.shutil, "disk_usage", lambda path: usage(1, 1, 1000))
    rig = FakeRig()
    with pytest.raises(CampaignError, match="the disk is full"):
        run_campaign(protocol(), rig, tmp_path / "c", options=QUICK)
    assert "acquire" not in rig.calls


def test_a_damaged_cycle_is_put_aside_and_run_again(tmp_path, undisturbed):
    run_campaign(protocol(), FakeRig(), tmp_path / "c", options=QUICK)
    path = Campaign.open(tmp_path / "c").files()[4]
    path.write_bytes(path.read_bytes()[:-100])
    assert resume_campaign(tmp_path / "c", FakeRig(), options=QUICK).finished == 10
    assert path.with_name(f"{path.name}.damaged").exists()
    again = contents(tmp_path / "c")
    assert again.keys() == undisturbed.keys()
    assert again["b1/sweep/v50/a0/b0/r1"][0] == 11
    others = set(again) - {"b1/sweep/v50/a0/b0/r1"}
    assert all(again[key] == undisturbed[key] for key in others)

"""The study of the source paper, made once: by `pneudrive demo`, so that its own test and others look at one run."""

import contextlib
import io
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest
from xdist.scheduler import LoadFileScheduling

from pneudrive.cli.main import run
from pneudrive.report.page import Report
from pneudrive.studies.bracha import reproduction
from pneudrive.views import ShownFigure

ROOT = Path(__file__).resolve().parents[1]
#: Files whose tests look at the study: on one worker, for each worker makes what a session shares for itself.
STUDY = (
    "tests/acceptance/test_demo.py",
    "tests/unit/paper/test_paper_figures.py",
    "tests/unit/report/test_report.py",
    "tests/unit/report/test_campaign_report.py",
)
#: Tests that wait for a browser more than they compute: one after the other, while other workers compute.
PAGE = tuple(f"tests/page/test_{name}.py" for name in ("journeys", "model_journeys", "control", "beside", "explore"))
#: What takes longest begins first, so that no worker is left alone at the end with a long file: the files that took
#: more than about 2 % of the time, dearest first. One that is not named here runs later; nothing else depends on it.
DEAREST = (
    *STUDY,
    *PAGE,
    *(f"tests/page/test_{name}.py" for name in ("journeys_drive", "journeys_measured", "views", "workspace")),
    "tests/acceptance/test_real_spring.py",
    "tests/unit/identify/test_dynamic.py",
    "tests/unit/datasheet/test_characteristics.py",
    "tests/acceptance/test_sizing_ready.py",
    "tests/acceptance/test_cli_control.py",
    "tests/unit/friction/campaign/test_hidden.py",
    "tests/acceptance/test_chain.py",
    "tests/unit/validate/test_diagnosis.py",
    "tests/unit/identify/test_follow.py",
    "tests/connect/test_opcua_campaign.py",
    "tests/page/test_journey_platform.py",
    "tests/acceptance/test_damaged_files.py",
    "tests/acceptance/test_cli_validate.py",
    "tests/unit/validate/test_validate.py",
    "tests/unit/friction/campaign/test_stops.py",
    "tests/acceptance/test_random_runs.py",
    "tests/campaign/test_killed.py",
    "tests/acceptance/test_cli_fit.py",
)


class ByFile(LoadFileScheduling):
    """A file's tests on one worker, in the order of `pytest_collection_modifyitems`.

    Those of the study too, and those of the page unless nothing else is tested.
    """

    def __init__(self, config, log=None):
        config.option.loadscopereorder = False
        super().__init__(config, log)
        self.page_is_one = not all(Path(one.partition("::")[0]).is_relative_to("tests/page") for one in config.args)

    def _split_scope(self, nodeid):
        file = super()._split_scope(nodeid)
        if file in PAGE and self.page_is_one:
            return "page"
        return "study" if file in STUDY else file


def pytest_xdist_make_scheduler(config, log):
    return ByFile(config, log)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items):
    """Put the dearest files first."""
    rank = {file: place for place, file in enumerate(DEAREST)}
    items.sort(key=lambda item: rank.get(item.nodeid.partition("::")[0], len(rank)))


@dataclass(frozen=True)
class Demonstration:
    """What `pneudrive demo` returned, printed, wrote, and reproduced on the way."""

    status: int
    printed: str
    folder: Path
    made: reproduction.Reproduction


@pytest.fixture(scope="session")
def demonstration(tmp_path_factory):
    """Return a run of `pneudrive demo` in the project's folder."""
    folder, reproduce, made = tmp_path_factory.mktemp("demo") / "out", reproduction.reproduce, []

    def kept(*given):
        made.append(reproduce(*given))
        return made[-1]

    out = io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out):
        patch.chdir(ROOT)
        patch.setattr(reproduction, "reproduce", kept)
        status = run(["demo", "--out", str(folder)])
    return Demonstration(status, out.getvalue(), folder, made[0])


@pytest.fixture(scope="session")
def made(demonstration):
    """Return the source paper, reproduced."""
    return demonstration.made


@dataclass(frozen=True)
class Reproduced:
    """What `pneudrive reproduce` returned, printed and wrote."""

    status: int
    printed: str
    folder: Path


@contextlib.contextmanager
def without_pictures():
    """Leave the pictures of reports empty."""

    def draw(report, folder=None):
        blocks = [block for part in report.sections for block in part.blocks if isinstance(block, ShownFigure)]
        report.pictures |= {block.name: "<svg></svg>" for block in blocks}

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Report, "draw", draw)
        yield


@pytest.fixture(scope="session")
def reproduced(demonstration, tmp_path_factory):
    """Return a run of `pneudrive reproduce` beside the campaigns of the demonstration, which drew the same pictures."""
    folder, out = tmp_path_factory.mktemp("reproduced") / "out", io.StringIO()
    shutil.copytree(demonstration.folder / reproduction.FOLDER, folder / reproduction.FOLDER)
    with contextlib.redirect_stdout(out), without_pictures():
        status = run(["reproduce", "--out", str(folder)])
    return Reproduced(status, out.getvalue(), folder)


@pytest.fixture(scope="module")
def undrawn():
    """Write reports with empty pictures, for tests of words and numbers: drawing takes half the time of a report."""
    with without_pictures():
        yield


@pytest.fixture
def printed(capsys):
    """Run a command that succeeds; return what it prints."""

    def output(arguments):
        assert run([str(word) for word in arguments]) == 0
        return capsys.readouterr().out

    return output


@pytest.fixture
def refusal(capsys):
    """Run a command of bad input, which gets status 2 and one message with all these words; return the message."""

    def message(arguments, *words):
        capsys.readouterr()
        assert run([str(word) for word in arguments]) == 2
        out, error = capsys.readouterr()
        assert not out
        assert len(re.findall(r"(?m)^(?:\w*Error|pneudrive): ", error)) == 1  # the latter of an unknown command
        assert "Traceback" not in error
        for word in words:
            assert word in error
        return error

    return message

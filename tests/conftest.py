"""The study of the source paper, made once: by `pneudrive demo`, so that its own test and others look at one run."""

import contextlib
import io
from dataclasses import dataclass
from pathlib import Path

import pytest
from xdist.scheduler import LoadFileScheduling

from pneudrive.cli.main import run
from pneudrive.studies.bracha import reproduction

ROOT = Path(__file__).resolve().parents[1]
#: Files whose tests look at the study: on one worker, for each worker makes what a session shares for itself.
STUDY = (
    "tests/acceptance/test_demo.py",
    "tests/unit/paper/test_paper_figures.py",
    "tests/unit/report/test_figures.py",
    "tests/unit/report/test_reproduction.py",
)


class ByFile(LoadFileScheduling):
    """A file's tests on one worker, in the order in which files are found: the long ones are among the first."""

    def __init__(self, config, log=None):
        config.option.loadscopereorder = False
        super().__init__(config, log)

    def _split_scope(self, nodeid):
        file = super()._split_scope(nodeid)
        return "study" if file in STUDY else file


def pytest_xdist_make_scheduler(config, log):
    return ByFile(config, log)


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

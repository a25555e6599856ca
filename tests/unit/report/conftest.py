"""What the tests of reports share: real recordings, and a check that a page loads nothing."""

import re
from pathlib import Path

import pytest

from pneudrive.characterise import characterise_recordings
from pneudrive.identify.static.fit import fit_characterisation

DATA = Path(__file__).resolve().parents[3] / "data" / "measurements" / "zillen-2021-pneumatic-piston"
SOME = ["friction/Kidney_lc_1bar", "friction/Kidney_lc_4bar", "friction/Kidney_lc_7bar", "friction/O-ring_1bar"]
RUNS = ["1_O-ring257_1bar", "3_O-ring257_1bar", "1_O-ring257_5bar", "3_O-ring257_5bar"]


@pytest.fixture(scope="session")
def real():
    """Return the characterisation of some real recordings, runs among them, and its fits."""
    found = characterise_recordings([DATA / f"{n}.csv.xz" for n in [*SOME, *(f"repeatability/{n}" for n in RUNS)]])
    return found, fit_characterisation(found)[0]


@pytest.fixture(scope="session")
def loads_from_elsewhere():
    """Return a function that lists what a page would load; links that a reader may follow do not count."""

    def listed(page):
        loads = re.findall(r"<(?:script|link|img|iframe|object|embed|source|use|image)\b[^>]*>", page)
        loads = [tag for tag in loads if not re.search(r"""href=["']#""", tag)]
        return loads + re.findall(r"@import|url\((?!#)[^)]*\)", page)

    return listed

"""Long random trials against independent models: `make trials`, or `python -m trials.NAME --count N --seed S`.

`make test` runs a small sample of each. Recordings, campaigns and models come from `tests/oracle`.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

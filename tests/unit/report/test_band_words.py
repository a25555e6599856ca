"""A figure says what the text says: the band of a line over pressure holds a further run only where one was seen."""

import pytest

from pneudrive.friction.pressure import LevelPoint, fit_pressure_lines
from pneudrive.report.recordings import pressure_panel


@pytest.mark.parametrize("runs", [("1",), ("1", "2")])
def test_the_legend_promises_no_further_run_where_nothing_was_run_twice(runs):
    points = [
        LevelPoint(f"{run} at {bar} bar", "seal", run, 1e5 * bar, 0.1, 10.0 + 2.0 * bar + off, 0.1)
        for run, more in zip(runs, (0.0, 0.8), strict=False)
        for bar, off in zip((1, 2, 4, 6), (more, more + 0.1, more - 0.1, more), strict=True)
    ]
    (line,) = fit_pressure_lines(points)
    label = pressure_panel(points, line, runs).marks[0].label
    assert ("for a further run" in label) == (len(runs) > 1)
    assert ('two values of the label "run"' in line.statement) == (len(runs) == 1)
    assert "+-0.00" not in line.statement

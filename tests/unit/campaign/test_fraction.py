"""A fraction keeps every level and what it says can be told, and what it gives up is said."""

import numpy as np
import pytest

from pneudrive.campaign.planning.fraction import propose, write_fraction
from pneudrive.campaign.planning.plan import cell_name, lay_out
from pneudrive.campaign.planning.protocol import parse_protocol, read_protocol
from pneudrive.errors import ProtocolError

TEXT = """\
repeats = 2
directions = "+x"
[stop]
durations = ["0.1 s", "1 s", "10 s", "100 s"]
restart_speed = ["1 mm/s", "10 mm/s"]
approach = "2 mm"
recovery = "2 mm"
[pressure]
both = ["0 bar gauge", "1 bar gauge", "2 bar gauge"]
[mounting]
levels = ["x", "y", "z"]
"""


@pytest.fixture(scope="module")
def eighteen_days(planned):
    return planned(read_protocol("stops-pressure-mounting").text)


@pytest.fixture(scope="module")
def day(eighteen_days):
    return propose(eighteen_days, 86400.0)


def run(plan, proposal):
    """Lay the fraction out as a user would: write its file, read it, plan it."""
    return lay_out(parse_protocol(write_fraction(plan.protocol, proposal)), plan.identity, plan.envelope)


def levels_of(plan):
    return [one.cell.levels() | one.cycle.levels for one in plan.planned if one.cell is not None]


def test_the_full_factorial_takes_18_days_and_its_fraction_a_day(eighteen_days, day):
    assert 17.0 < eighteen_days.time_s / 86400.0 < 19.0
    part = run(eighteen_days, day)
    assert 0.9 * 86400.0 < part.time_s <= 86400.0
    assert {cell_name(one.cycle.levels, one.cell) for one in part.planned if one.cell is not None} == set(day.names)
    assert len(levels_of(part)) == 5 * len(day.names)  # every repeat of every cell that is kept


def test_every_level_of_every_factor_is_kept_at_least_twice(eighteen_days, day):
    whole, part = levels_of(eighteen_days), levels_of(run(eighteen_days, day))
    for factor in ("stop", "pressure", "restart", "position", "mounting"):
        kept = [cell[factor] for cell in part]
        for level in {cell[factor] for cell in whole}:
            assert kept.count(level) >= 2 * 5


def test_main_effects_and_the_slope_at_each_pressure_can_be_estimated(eighteen_days, day):
    """An independent model, dummy-coded: its rank over the chosen cells is the number of its parameters."""
    cells = levels_of(run(eighteen_days, day))
    columns = [np.ones(len(cells))]
    for factor in ("stop", "pressure", "restart", "position", "mounting"):
        levels = sorted({cell[factor] for cell in cells}, key=str)
        columns += [np.array([cell[factor] == level for cell in cells], float) for level in levels[1:]]
    decades = np.log10([cell["stop"] for cell in cells])
    pressures = sorted({cell["pressure"] for cell in cells})
    columns += [decades * np.array([cell["pressure"] == level for cell in cells]) for level in pressures[1:]]
    design = np.column_stack(columns)
    assert design.shape[1] == day.families[0].parameters == 1 + 9 + 4 + 2 + 2 + 2 + 4
    assert np.linalg.matrix_rank(design) == design.shape[1]


def test_what_is_given_up_is_what_the_chosen_cells_cannot_tell(eighteen_days, day):
    """Degrees of freedom of stop x restart, counted anew from the cells."""
    cells = levels_of(run(eighteen_days, day))

    def dummies(*factors):
        values = [tuple(cell[f] for f in factors) for cell in cells]
        return np.array([[value == level for level in sorted(set(values))] for value in values], float)

    alone = np.hstack([dummies("stop"), dummies("restart")])
    rest = [dummies("pressure"), dummies("position"), dummies("mounting")]
    slopes = np.log10([cell["stop"] for cell in cells])[:, None] * dummies("pressure")
    base = np.linalg.matrix_rank(np.hstack([alone, *rest, slopes]))
    both = np.linalg.matrix_rank(np.hstack([alone, *rest, slopes, dummies("stop", "restart")]))
    assert day.families[0].lost["stop x restart"] == (both - base, 9 * 2)


def test_a_fraction_is_better_than_a_random_one_of_the_same_time(planned):
    plan = planned(TEXT)
    limit = 0.4 * plan.time_s
    proposal = propose(plan, limit)
    cells = {cell_name(o.cycle.levels, o.cell): o.cell.levels() | o.cycle.levels for o in plan.planned if o.cell}
    names = sorted(cells)
    time = {
        name: sum(o.time_s for o in plan.planned if o.cell and cell_name(o.cycle.levels, o.cell) == name)
        for name in names
    }

    def information(chosen):
        rows = []
        for name in chosen:
            cell = cells[name]
            row = [1.0]
            for factor in ("stop", "pressure", "restart", "mounting"):
                known = sorted({c[factor] for c in cells.values()}, key=str)
                row += [float(cell[factor] == level) for level in known[1:]]
            row += [np.log10(cell["stop"]) * row[4], np.log10(cell["stop"]) * row[5]]
            rows.append(row)
        return np.linalg.slogdet(np.array(rows).T @ np.array(rows))[1]

    budget = sum(time[name] for name in proposal.names)
    rng = np.random.default_rng(0)
    for _ in range(200):
        shuffled, used, chosen = rng.permutation(names), 0.0, []
        for name in shuffled:
            if used + time[name] <= budget:
                chosen.append(name)
                used += time[name]
        assert information(chosen) < information(proposal.names)


def test_the_same_plan_gives_the_same_fraction(planned):
    assert propose(planned(TEXT), 7200.0) == propose(planned(TEXT), 7200.0)


def test_where_no_fraction_fits_the_smallest_is_given(planned):
    plan = planned(TEXT)
    proposal = propose(plan, 60.0)
    part = run(plan, proposal)
    assert part.time_s > 60.0
    assert len(proposal.names) >= proposal.families[0].parameters
    assert len(proposal.names) < proposal.families[0].of


def test_a_cell_that_does_not_exist_is_refused(planned):
    with pytest.raises(ProtocolError) as caught:
        planned(TEXT + '[fraction]\ncells = ["mounting = x: stop/t2/a0/b0/v1/held/x50pc/+x"]\n')
    assert "there is no cell" in str(caught.value)
    assert "Did you mean 'mounting = x: stop/t" in str(caught.value)


def test_an_interaction_of_a_factor_that_does_not_vary_is_refused(planned):
    plan = planned(TEXT + '[design]\ninteraction = ["stop", "seal"]\n')
    with pytest.raises(ProtocolError, match="stop x seal cannot be estimated"):
        propose(plan, 3600.0)

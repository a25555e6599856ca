"""Whatever a map holds, a fit ends in a result whose parts fit together, or in one clear message."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pneudrive.errors import FitError
from pneudrive.identify import fit_friction

FRICTION = st.one_of(st.floats(-100.0, 100.0), st.floats(1e-9, 1e6), st.just(0.0), st.just(float("nan")))
STDERR = st.one_of(st.floats(1e-9, 1e3), st.just(0.0), st.just(float("nan")))
ROW = st.tuples(st.floats(1e-4, 1.0), FRICTION, STDERR, st.sampled_from((0.0, 1e5, 3e5)), st.sampled_from((0.0, 1e5)))


@settings(max_examples=60, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    rows=st.lists(ROW, min_size=1, max_size=14),
    law=st.sampled_from(("coulomb", "stribeck")),
    pressure=st.booleans(),
    robust=st.booleans(),
    strokes=st.integers(1, 20),
)
def test_fit_or_message(make_map, rows, law, pressure, robust, strokes):
    speed, friction, stderr, gauge_a, gauge_b = (np.array(column) for column in zip(*rows, strict=True))
    data = make_map(speed, friction, stderr, gauge_a=gauge_a, gauge_b=gauge_b, strokes=strokes)
    try:
        fit = fit_friction(data, law, pressure_dependence=pressure, robust=robust)
    except FitError:
        return
    assert np.isfinite(fit.covariance).all()
    np.testing.assert_array_equal(fit.covariance, fit.covariance.T)
    for name, (low, high) in fit.intervals.items():
        assert low <= high
        if name in fit.parameters and np.isfinite(fit.parameters[name]):
            assert low <= fit.parameters[name] <= high
    assert set(fit.determined) <= set(fit.parameters)
    assert not set(fit.determined) & {statement.parameter for statement in fit.undetermined}
    assert np.isfinite(fit.predict([0.01, 0.1], 1e5, 1e5).friction_n).all()
    assert str(fit)

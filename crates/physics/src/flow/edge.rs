use math::Real;

/// How a position opens an edge of a valve: the share clip(offset + slope x, 0, 1) of its conductance.
#[inline(always)]
pub fn opened<S: Real>(offset: S, slope: S, x: S) -> S {
    slope.fma(x, offset).max(S::zero()).min(S::one())
}

/// Share of its conductance that leaks past an edge with the spool at x: l exp(-|x|/x_l), l at the centre (assumed shape).
#[inline(always)]
pub fn leaking<S: Real>(leak: S, width: S, x: S) -> S {
    leak * (-x.abs() / width).exp()
}

//! Location of an event within a step.

/// Interior points at which the event functions are evaluated. They detect a dip below zero within a step,
/// which a sign check at its ends would miss.
pub(crate) const LOOKOUTS: [f64; 4] = [0.25, 0.5, 0.75, 1.0];

/// Limit on the iterations of the search. Bisection alone would take 53.
const MOST_ROUNDS: u32 = 60;
/// Relative width at which a bracket counts as a point: a few rounding errors.
const BRACKET: f64 = 1e-14;

/// Returns the point in (low, high] where `g` falls below its target. The method is the Illinois form of
/// regula falsi, which is superlinear and never leaves the bracket. `g_low > target >= g_high`. `g` is
/// already shifted.
pub fn locate(
    mut low: f64,
    mut g_low: f64,
    mut high: f64,
    mut g_high: f64,
    mut g: impl FnMut(f64) -> f64,
) -> f64 {
    debug_assert!(g_low > 0.0 && g_high <= 0.0);
    let mut side = 0;
    for _ in 0..MOST_ROUNDS {
        let inside = |point: f64| point > low && point < high;
        let mut middle = (low * g_high - high * g_low) / (g_high - g_low);
        if !inside(middle) {
            // One end is so near the root that the secant rounds onto it. The other end must move.
            middle = 0.5 * (low + high);
        }
        if !inside(middle) {
            break;
        }
        let value = g(middle);
        if value > 0.0 {
            (low, g_low) = (middle, value);
            if side == 1 {
                g_high *= 0.5;
            }
            side = 1;
        } else {
            (high, g_high) = (middle, value);
            if side == -1 {
                g_low *= 0.5;
            }
            side = -1;
        }
        if high - low < BRACKET * high {
            break;
        }
    }
    high
}

/// Result of the search for events in a step.
pub(crate) enum Found {
    Nothing,
    /// The step ends on the event.
    AtEnd(usize),
    /// The event is at this fraction of the step.
    Inside(f64, usize),
}

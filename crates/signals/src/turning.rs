//! Reversals of a motion.

/// The most extreme value of a stretch, and the samples in a row that have it.
#[derive(Clone, Copy)]
struct Extreme {
    value: f64,
    begin: usize,
    end: usize,
}

impl Extreme {
    fn at(place: usize, value: f64) -> Self {
        Extreme { value, begin: place, end: place }
    }

    /// Takes the next sample. `beyond` states that it is further out than those before.
    #[inline(always)]
    fn take(&mut self, place: usize, value: f64, beyond: bool) {
        if beyond {
            *self = Extreme::at(place, value);
        } else if value == self.value && self.end + 1 == place {
            self.end = place;
        }
    }

    fn middle(&self) -> usize {
        usize::midpoint(self.begin, self.end)
    }
}

/// Finds the samples at which a motion reverses by at least `least`, the extremes at both ends included.
///
/// Among equal extremes the first one counts, and among equal consecutive samples the one in the middle. All values are
/// finite. If they never differ by `least`, the greatest and the least one are found.
pub fn turning_points(values: &[f64], least: f64) -> Vec<usize> {
    let mut points = Vec::new();
    let Some(&first) = values.first() else { return points };
    // Extremes since the last reversal. The direction is open before the first reversal.
    let (mut high, mut low) = (Extreme::at(0, first), Extreme::at(0, first));
    let mut rises = None;
    for (place, &value) in values.iter().enumerate().skip(1) {
        if rises != Some(false) {
            high.take(place, value, value > high.value);
            if value < high.value && high.value - value >= least {
                points.push(high.middle());
                (rises, low) = (Some(false), Extreme::at(place, value));
                continue;
            }
        }
        if rises != Some(true) {
            low.take(place, value, value < low.value);
            if value > low.value && value - low.value >= least {
                points.push(low.middle());
                (rises, high) = (Some(true), Extreme::at(place, value));
            }
        }
    }
    match rises {
        Some(true) => points.push(high.middle()),
        Some(false) => points.push(low.middle()),
        None => points.extend([high.middle().min(low.middle()), high.middle().max(low.middle())]),
    }
    points
}

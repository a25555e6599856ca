//! Means over bins of position.

use std::ops::Range;

/// Equal bins between two ends.
#[derive(Clone, Copy)]
pub struct Bins {
    /// Lower end of the first one.
    pub low: f64,
    /// Upper end of the last one.
    pub high: f64,
    /// Number of bins.
    pub count: usize,
}

/// Returns the mean of the values in each position bin, over some ranges of samples. If a choice is given, only the
/// chosen samples count. A bin without samples is NaN. A bin includes its lower end, but not its upper end.
///
/// # Panics
/// The columns differ in length, or a stretch ends behind them.
pub fn bin_means(
    position: &[f64],
    values: &[f64],
    chosen: Option<&[bool]>,
    stretches: &[Range<usize>],
    bins: Bins,
) -> Vec<f64> {
    let mut sums = vec![(0.0, 0_u64); bins.count];
    let (span, count) = (bins.high - bins.low, bins.count as f64);
    for stretch in stretches {
        let samples = position[stretch.clone()].iter().zip(&values[stretch.clone()]);
        let mut add = |x: f64, value: f64| {
            let place = (x - bins.low) / span * count;
            if place >= 0.0 && place < count {
                let (sum, number) = &mut sums[place as usize];
                *sum += value;
                *number += 1;
            }
        };
        match chosen {
            None => samples.for_each(|(x, value)| add(*x, *value)),
            Some(chosen) => samples.zip(&chosen[stretch.clone()]).for_each(|((x, value), chosen)| {
                if *chosen {
                    add(*x, *value);
                }
            }),
        }
    }
    sums.into_iter().map(|(sum, number)| if number > 0 { sum / number as f64 } else { f64::NAN }).collect()
}

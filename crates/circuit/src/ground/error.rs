//! Errors of descriptions and runs.

use physics::Bounds;

/// Errors of a description or a run.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The description or the request is refused, with the reason.
    #[error("{0}")]
    Specification(String),
    /// A run failed, with the reason.
    #[error("{0}")]
    Stopped(String),
    /// The user wants to stop.
    #[error("interrupted at t = {t} s")]
    Interrupted {
        /// Simulated time, s.
        t: f64,
    },
}

/// Refuses a description or a request with a reason.
pub(crate) fn refuse<T>(message: impl Into<String>) -> Result<T, Error> {
    Err(Error::Specification(message.into()))
}

/// Refuses a description or a request with a reason, written as in `format!`.
#[macro_export]
macro_rules! refuse {
    ($($reason:tt)*) => {
        Err($crate::Error::Specification(format!($($reason)*)))
    };
}

/// Refuses a number that is not finite or not within its bounds.
pub(crate) fn check_bounds(name: &str, value: f64, unit: &str, bounds: &Bounds) -> Result<(), Error> {
    if value.is_finite() && bounds.contain(value) {
        return Ok(());
    }
    let (unit, rule) = (if unit == "1" { String::new() } else { format!(" {unit}") }, bounds.rule(value));
    refuse!("{name} = {value}{unit} is out of bounds: it must be {rule}")
}

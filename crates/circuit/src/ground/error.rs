//! Errors of descriptions and runs.

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

/// Writes a number with its unit.
pub(crate) fn with_unit(value: f64, unit: &str) -> String {
    if unit == "1" { value.to_string() } else { format!("{value} {unit}") }
}

//! Why a call of a tool fails.

use circuit::Error;

/// Relative difference by which two tools may round the same instant.
pub const SAME_INSTANT: f64 = 1e-9;

/// Reason why an operation failed, and its severity.
#[derive(Clone, Debug, PartialEq)]
pub struct CallRefusal {
    pub message: String,
    /// Whether a shorter step or other values may succeed.
    pub discard: bool,
}

impl From<Error> for CallRefusal {
    fn from(error: Error) -> Self {
        CallRefusal { message: error.to_string(), discard: false }
    }
}

/// Refuses with a reason.
pub fn refuse<T>(message: impl Into<String>) -> Result<T, CallRefusal> {
    Err(CallRefusal { message: message.into(), discard: false })
}

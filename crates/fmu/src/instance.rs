//! An instance of an FMU: which calls are allowed in which phase, and which messages the tool receives.

use crate::model::FmuModel;
use crate::plan::FmuPlan;
use crate::refusal::{CallRefusal, refuse};
use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

/// Result of a call, the same numbers in FMI 2.0 and 3.0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub enum FmiStatus {
    Ok,
    Warning,
    Discard,
    Error,
    Fatal,
}

/// Phase of an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    Instantiated,
    Initialisation,
    Event,
    Continuous,
    Step,
    Terminated,
}

/// Phases in which the run continues.
pub const RUNNING: &[Phase] = &[Phase::Event, Phase::Continuous, Phase::Step];
/// All phases except the last.
pub const ALIVE: &[Phase] =
    &[Phase::Instantiated, Phase::Initialisation, Phase::Event, Phase::Continuous, Phase::Step];

/// Callback of the tool for messages.
#[derive(Clone, Copy)]
pub enum Logger {
    /// The caller reads the last message instead.
    None,
    Two(unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...)),
    Three(unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char)),
}

/// Receiver of error messages.
pub struct Listener {
    pub logger: Logger,
    pub environment: *mut c_void,
    pub name: CString,
}

/// Returns a text for C, cut at the first zero.
pub fn c_text(text: &str) -> CString {
    CString::new(text.split('\0').next().unwrap_or_default()).expect("it does not end with a zero")
}

impl Logger {
    /// Sends a text to the tool; for FMI 2.0, it is a format string.
    ///
    /// # Safety
    /// `environment` is that of the tool, and `name` ends with a zero.
    #[allow(unsafe_code)]
    pub unsafe fn send(
        self,
        environment: *mut c_void,
        name: *const c_char,
        status: FmiStatus,
        message: &CStr,
    ) {
        let (category, status) = (c"logStatusError".as_ptr(), status as c_int);
        // SAFETY: the tool's callback, used as its standard requires. All texts live until it returns.
        unsafe {
            match self {
                Logger::None => {}
                Logger::Two(log) => log(environment, name, status, category, message.as_ptr()),
                Logger::Three(log) => log(environment, status, category, message.as_ptr()),
            }
        }
    }
}

impl Listener {
    /// Sends a message to the tool.
    pub fn tell(&self, status: FmiStatus, message: &str) {
        let is_format = matches!(self.logger, Logger::Two(_));
        let message = c_text(&if is_format { message.replace('%', "%%") } else { message.into() });
        // SAFETY: the environment came with the logger.
        #[allow(unsafe_code)]
        unsafe {
            self.logger.send(self.environment, self.name.as_ptr(), status, &message);
        }
    }
}

/// State of an instance that a tool keeps.
#[derive(Clone)]
pub struct KeptState {
    pub model: FmuModel,
    pub phase: Phase,
}

/// An instance.
pub struct FmuInstance {
    pub kept: KeptState,
    pub listener: Listener,
    /// Last message.
    pub message: CString,
}

impl FmuInstance {
    /// Creates an instance from the text of a plan.
    pub fn new(
        text: &str,
        token: Option<&str>,
        outside: bool,
        listener: Listener,
    ) -> Result<Self, CallRefusal> {
        let plan: FmuPlan = serde_json::from_str(text)
            .or_else(|error| refuse(format!("the description cannot be read: {error}")))?;
        if let Some(token) = token.filter(|token| *token != plan.token) {
            return refuse(format!(
                "the token \"{token}\" is not that of this FMU, \"{}\": modelDescription.xml and resources/drive.json \
                 do not belong together. Export the drive again",
                plan.token
            ));
        }
        if plan.actuator.is_some() && !outside {
            return refuse(
                "an actuator is for model exchange: in co-simulation its motion within a step is unknown",
            );
        }
        if plan.law.is_some() && outside {
            return refuse("a controller is for co-simulation: it has no states that a tool could integrate");
        }
        let kept = KeptState { model: FmuModel::new(Arc::new(plan), outside), phase: Phase::Instantiated };
        Ok(FmuInstance { kept, listener, message: CString::default() })
    }

    /// Runs an operation in one of the allowed phases. An error is reported and becomes a status.
    pub fn call(
        &mut self,
        what: &str,
        phases: &[Phase],
        work: impl FnOnce(&mut Self) -> Result<(), CallRefusal>,
    ) -> FmiStatus {
        let phase = self.kept.phase;
        let done = if phases.contains(&phase) {
            catch_unwind(AssertUnwindSafe(|| work(self)))
        } else {
            Ok(refuse(format!("this call is not allowed in phase {phase:?}")))
        };
        self.conclude(what, done)
    }

    /// Reports the result of an operation. It is separate from [`FmuInstance::call`], which is compiled for each
    /// function of the standards.
    fn conclude(&mut self, what: &str, done: std::thread::Result<Result<(), CallRefusal>>) -> FmiStatus {
        let (status, message) = match done {
            Ok(Ok(())) => return FmiStatus::Ok,
            Ok(Err(refusal)) if refusal.discard => (FmiStatus::Discard, refusal.message),
            Ok(Err(refusal)) => (FmiStatus::Error, refusal.message),
            Err(panic) => {
                let why = panic.downcast_ref::<String>().map(String::as_str);
                let why = why.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("unknown");
                (FmiStatus::Fatal, format!("internal error: {why}"))
            }
        };
        let message = if what.is_empty() { message } else { format!("{what}: {message}") };
        self.listener.tell(status, &message);
        self.message = c_text(&message);
        status
    }

    /// Starts the run.
    pub fn begin(&mut self) -> Result<(), CallRefusal> {
        self.kept.model.begin()?;
        self.pass_to(if self.kept.model.outside { Phase::Event } else { Phase::Step })
    }

    /// Changes to another mode of model exchange.
    pub fn pass_to(&mut self, phase: Phase) -> Result<(), CallRefusal> {
        self.kept.phase = phase;
        Ok(())
    }

    /// Resets the instance to its original state.
    pub fn reset(&mut self) -> Result<(), CallRefusal> {
        self.kept.model.reset();
        self.pass_to(Phase::Instantiated)
    }

    /// Restores a state that the tool has kept.
    pub fn restore(&mut self, kept: &KeptState) -> Result<(), CallRefusal> {
        self.kept.clone_from(kept);
        Ok(())
    }

    /// Sets variables. Variables with a history change only while an event is handled.
    pub fn set(&mut self, references: &[u32], values: &[f64]) -> Result<(), CallRefusal> {
        for (&reference, &value) in references.iter().zip(values) {
            let known = self.kept.model.get(reference);
            if self.kept.phase == Phase::Continuous
                && self.kept.model.is_discrete(reference)
                && known.as_ref().is_ok_and(|known| *known != value)
            {
                return refuse("a discrete input can be set at an event only");
            }
            self.kept.model.set(reference, value)?;
        }
        Ok(())
    }

    /// Reads variables.
    pub fn get(&mut self, references: &[u32], values: &mut [f64]) -> Result<(), CallRefusal> {
        for (&reference, value) in references.iter().zip(values) {
            *value = self.kept.model.get(reference)?;
        }
        Ok(())
    }

    /// Returns a kept state as bytes.
    pub fn bytes(kept: &KeptState) -> Result<Vec<u8>, CallRefusal> {
        let mut bytes = kept.model.save()?;
        bytes.push(ALIVE.iter().position(|phase| *phase == kept.phase).unwrap_or(ALIVE.len()) as u8);
        Ok(bytes)
    }

    /// Returns a kept state from bytes.
    pub fn kept(&self, bytes: &[u8]) -> Result<KeptState, CallRefusal> {
        let Some((phase, bytes)) = bytes.split_last() else { return refuse("there are no bytes of a state") };
        let phase = ALIVE.get(usize::from(*phase)).copied().unwrap_or(Phase::Terminated);
        Ok(KeptState { model: self.kept.model.restored(bytes)?, phase })
    }
}

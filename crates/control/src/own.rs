//! Custom laws. They receive the signals of sensors and observer, and return a command.

use crate::model::Model;
use crate::observer::Observer;
use crate::reference::Reference;
use crate::types::Sample;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

macro_rules! signals {
    (|$model:ident, $sample:ident, $observer:ident| {
        $($name:ident: $unit:literal, $meaning:literal, $value:expr;)*
    }) => {
        /// Signals of sensors and observer at a sample.
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        pub struct Seen {
            $(#[doc = $meaning] pub $name: f64,)*
        }

        /// Name, unit in SI (`1` for a pure number) and meaning of each signal.
        pub const SIGNALS: &[(&str, &str, &str)] = &[$((stringify!($name), $unit, $meaning),)*];

        impl Seen {
            /// Returns the signals of a sample that the observer has processed.
            pub fn of($model: &Model, $sample: &Sample, $observer: &Observer) -> Self {
                Seen { $($name: $value,)* }
            }

            /// Returns the numbers in their order.
            pub fn values(&self) -> [f64; SIGNALS.len()] {
                [$(self.$name),*]
            }
        }
    };
}

signals! { |model, sample, observer| {
    time: "s", "time of the sample", sample.time;
    position: "m", "measured position", sample.position;
    velocity: "m/s", "velocity, estimated", observer.state.velocity;
    acceleration: "m/s2", "acceleration, estimated", model.acceleration(&observer.state);
    pressure_a: "Pa", "absolute pressure of chamber a: measured, or without a sensor from the model", observer.state.pressures[0];
    pressure_b: "Pa", "absolute pressure of chamber b: measured, or without a sensor from the model", observer.state.pressures[1];
    temperature_a: "K", "temperature of the gas in chamber a, estimated", observer.state.temperatures[0];
    temperature_b: "K", "temperature of the gas in chamber b, estimated", observer.state.temperatures[1];
    gas_force: "N", "force of the gas on the piston, in +x", model.gas_force(observer.state.pressures);
    friction: "N", "friction force without its viscous part, against +x, estimated", observer.state.friction;
    disturbance: "N", "unmodelled force, in +x, estimated", observer.state.disturbance;
    spool: "1", "position of the valve's spool, by the model", observer.spool.position();
} }

/// A custom law.
pub trait OwnLaw: Send {
    /// Returns the command of the valve, -1 .. 1, for a sample along a reference. Values beyond these are clipped. A
    /// command that is not a number is a failure of the law.
    fn step(&mut self, seen: &Seen, reference: &Reference) -> f64;
}

impl<F: FnMut(&Seen, &Reference) -> f64 + Send> OwnLaw for F {
    fn step(&mut self, seen: &Seen, reference: &Reference) -> f64 {
        self(seen, reference)
    }
}

/// A custom law, or a placeholder for a custom law. Clones use the same law object, with its memory.
#[derive(Clone, Default)]
pub struct Own(Option<Arc<Mutex<dyn OwnLaw>>>);

impl Own {
    /// Its word.
    pub const KEY: &'static str = "own";

    /// Wraps a law.
    pub fn new(law: impl OwnLaw + 'static) -> Self {
        Own(Some(Arc::new(Mutex::new(law))))
    }

    /// Returns its command, or NaN without a law.
    pub fn step(&self, seen: &Seen, reference: &Reference) -> f64 {
        let Some(law) = &self.0 else { return f64::NAN };
        law.lock().unwrap_or_else(PoisonError::into_inner).step(seen, reference).clamp(-1.0, 1.0)
    }
}

impl fmt::Debug for Own {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Own({})", if self.0.is_some() { "a law" } else { "no law" })
    }
}

//! Any law: one of the table, or a custom one.

use super::base::{Features, Law, Tick};
use super::{Fuzzy, Inversion, Nmpc, Pid, Sliding, SuperTwisting};
use crate::gains::{Gain, GainValues};
use crate::model::Model;
use crate::number::Memory;
use crate::own::Own;
use crate::types::Plant;

macro_rules! laws {
    ($($name:ident $key:literal),*) => {
        /// Any law.
        #[derive(Clone, Debug)]
        pub enum AnyLaw {
            $(#[doc = concat!("See [`", stringify!($name), "`].")] $name($name),)*
            /// A custom law of a user.
            Own(Own),
        }

        /// Gains of all laws, by the key of the law.
        pub const GAINS: &[(&str, &[Gain])] = &[$(($key, $name::GAINS)),*];

        /// Keys of all laws.
        pub const LAWS: &[&str] = &[$($key),*];

        impl AnyLaw {
            /// Returns the law of a key, with gains that are derived from the drive.
            pub fn tuned(key: &str, model: &Model, plant: &Plant) -> Option<Self> {
                $(if key == $key {
                    return Some(AnyLaw::$name($name::tuned(model, plant)));
                })*
                (key == Own::KEY).then(AnyLaw::default)
            }

            /// Key of the law in a controller file.
            pub fn key(&self) -> &'static str {
                match self { $(AnyLaw::$name(_) => $key,)* AnyLaw::Own(_) => Own::KEY }
            }

            /// Gains of the law, with their values.
            pub fn gains(&mut self) -> GainValues<'_> {
                match self { $(AnyLaw::$name(law) => law.gains(),)* AnyLaw::Own(_) => vec![] }
            }

            /// Whether it follows references only, and cannot follow a path back to a reference.
            pub(crate) fn needs_reference(&self) -> bool {
                matches!(self, AnyLaw::Own(_))
            }
        }

        impl Default for AnyLaw {
            fn default() -> Self {
                AnyLaw::Own(Own::default())
            }
        }

        impl Memory<f64> for AnyLaw {
            fn each(&mut self, see: &mut dyn FnMut(&mut f64)) {
                match self { $(AnyLaw::$name(law) => law.each(see),)* AnyLaw::Own(_) => () }
            }
        }

        impl Law for AnyLaw {
            fn features(&self) -> Features {
                match self { $(AnyLaw::$name(law) => law.features(),)* AnyLaw::Own(_) => Features::USUAL }
            }

            fn step(&mut self, tick: &Tick) -> f64 {
                match self { $(AnyLaw::$name(law) => law.step(tick),)* AnyLaw::Own(_) => 0.0 }
            }

            fn feedback(&self, tick: &Tick) -> [f64; 2] {
                match self { $(AnyLaw::$name(law) => law.feedback(tick),)* AnyLaw::Own(_) => [0.0; 2] }
            }

            fn given(&mut self, asked: f64, tick: &Tick) {
                match self { $(AnyLaw::$name(law) => law.given(asked, tick),)* AnyLaw::Own(_) => () }
            }
        }
    };
}

laws!(
    Pid "pid", Fuzzy "fuzzy", Sliding "sliding-mode", SuperTwisting "super-twisting", Inversion "inversion", Nmpc "nmpc"
);

//! Friction laws. A law is one file and one line in `laws!` below.

mod coulomb;
mod dry;
mod lugre;
mod seal_lips;
mod stribeck;

use crate::parameter::Parameter;
use math::{Lane, Over, Real};

pub use coulomb::Coulomb;
pub use lugre::LuGre;
pub use seal_lips::SealLips;
pub use stribeck::{Stribeck, weight};

/// Where a law is evaluated.
#[derive(Clone, Copy, Debug)]
pub struct At<S> {
    /// Sliding velocity, m/s.
    pub v: S,
    /// Position, m.
    pub x: S,
    /// Gauge pressure in chamber a, Pa.
    pub gauge_a: S,
    /// Gauge pressure in chamber b, Pa.
    pub gauge_b: S,
    /// Sum of all other forces in +x, N: what friction must balance in stick.
    pub applied: S,
    /// What [`Law::prepare`] gave for this velocity.
    pub prepared: S,
}

/// Levels that dependences act on, before the law is evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Levels<S> {
    /// Coulomb force Fc, N.
    pub coulomb: S,
    /// Breakaway force Fs, N.
    pub breakaway: S,
}

impl<S: Real> Levels<S> {
    /// The same force for starting and for sliding.
    fn equal(coulomb: S) -> Self {
        Levels { coulomb, breakaway: coulomb }
    }

    /// Fc + (Fs - Fc) weight, N.
    #[inline(always)]
    fn at(&self, weight: S) -> S {
        (self.breakaway - self.coulomb).fma(weight, self.coulomb)
    }
}

/// Steady sliding, N:  level sgn(v) + Fv v, where v = 0 counts as positive.
fn sliding<P: Real, S: Over<P>>(v: S, level: S, viscous: P) -> S {
    let sign = S::select(v.lt(S::zero()), -S::one(), S::one());
    sign * level + S::from(viscous) * v
}

/// An inner state of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InnerState {
    pub name: &'static str,
    pub unit: &'static str,
    /// Absolute error scale, in the unit.
    pub scale: f64,
}

/// A friction law.
pub trait Law<P: Real> {
    const KEY: &'static str;
    const TITLE: &'static str;
    /// Key in references.bib.
    const SOURCE: &'static str;
    const STATES: &'static [InnerState] = &[];
    /// The law sticks by a mode (-1, 0, +1), with located events.
    const STICKS: bool = false;

    /// Fc and Fs before any dependence.
    fn levels(&self) -> Levels<P>;

    /// What depends on the velocity alone (an exponential, mostly), computed ahead of the forces so
    /// that the processor works on both at once.
    fn prepare<S: Over<P>>(&self, _v: S) -> S {
        S::zero()
    }

    /// Friction force, N, positive where it opposes v > 0, and the rates of the inner states.
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], mode: P) -> S;

    /// Positive while the mode holds.
    fn event<S: Over<P>>(&self, _at: &At<S>, _levels: &Levels<S>, _mode: P) -> S {
        S::one()
    }

    /// The mode after the event, for velocity zero and the force applied, N.
    fn next_mode(&self, _mode: f64, _applied: f64, _levels: &Levels<f64>) -> f64 {
        0.0
    }

    /// Energy stored in the inner states, J.
    fn stored<S: Over<P>>(&self, _z: &[S]) -> S {
        S::zero()
    }

    /// Heat produced, W: the power of the force minus what the inner states store.
    fn heat<S: Over<P>>(&self, v: S, force: S, _z: &[S], _dz: &[S]) -> S {
        force * v
    }

    /// Steady sliding at velocity `v` (after any transient), N.
    fn steady<S: Over<P>>(&self, v: S, levels: &Levels<S>) -> S;
}

/// A law's entry in the registry.
#[derive(Clone, Copy, Debug)]
pub struct Meta {
    pub key: &'static str,
    pub title: &'static str,
    pub source: &'static str,
    pub parameters: &'static [Parameter],
    pub states: &'static [InnerState],
    pub sticks: bool,
}

macro_rules! laws {
    ($($name:ident),* $(,)?) => {
        /// Any registered law; dispatch is static.
        #[derive(Clone, Debug)]
        pub enum AnyLaw<P> {
            $($name($name<P>),)*
        }

        /// Every law that a description can name.
        pub const LAWS: &[Meta] = &[$(Meta {
            key: <$name<f64> as Law<f64>>::KEY,
            title: <$name<f64> as Law<f64>>::TITLE,
            source: <$name<f64> as Law<f64>>::SOURCE,
            parameters: <$name<f64>>::PARAMETERS,
            states: <$name<f64> as Law<f64>>::STATES,
            sticks: <$name<f64> as Law<f64>>::STICKS,
        },)*];

        impl AnyLaw<f64> {
            /// The law called `key`, its parameters from `value(name)`; None for an unknown key.
            pub fn build(key: &str, value: &mut dyn FnMut(&Parameter) -> f64) -> Option<Self> {
                $(if key == <$name<f64> as Law<f64>>::KEY {
                    let values: Vec<f64> = <$name<f64>>::PARAMETERS.iter().map(|p| value(p)).collect();
                    return Some(AnyLaw::$name($name::from_values(&values)));
                })*
                None
            }

            /// What the user should know about this parameter set with these levels, if anything.
            pub fn warning(&self, levels: &Levels<f64>) -> Option<String> {
                match self { $(AnyLaw::$name(law) => law.warning(levels),)* }
            }
        }

        impl<R: Lane> AnyLaw<R> {
            /// Lane `i` takes the law `each[i]`; all must be of one kind.
            pub fn gather(each: &[&AnyLaw<f64>]) -> Self {
                match each[0] {
                    $(AnyLaw::$name(_) => AnyLaw::$name($name::gather(&each.iter().map(|law| match law {
                        AnyLaw::$name(law) => law,
                        _ => panic!("lanes must share one friction law"),
                    }).collect::<Vec<_>>())),)*
                }
            }
        }

        impl<P: Real> AnyLaw<P> {
            pub fn meta(&self) -> &'static Meta {
                let key = match self { $(AnyLaw::$name(_) => <$name<P> as Law<P>>::KEY,)* };
                LAWS.iter().find(|meta| meta.key == key).expect("every law is registered")
            }
            #[inline(always)]
            pub fn levels(&self) -> Levels<P> {
                match self { $(AnyLaw::$name(law) => law.levels(),)* }
            }
            #[inline(always)]
            pub fn prepare<S: Over<P>>(&self, v: S) -> S {
                match self { $(AnyLaw::$name(law) => law.prepare(v),)* }
            }
            #[inline(always)]
            pub fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], mode: P) -> S {
                match self { $(AnyLaw::$name(law) => law.force(at, levels, z, dz, mode),)* }
            }
            pub fn event<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, mode: P) -> S {
                match self { $(AnyLaw::$name(law) => law.event(at, levels, mode),)* }
            }
            pub fn next_mode(&self, mode: f64, applied: f64, levels: &Levels<f64>) -> f64 {
                match self { $(AnyLaw::$name(law) => law.next_mode(mode, applied, levels),)* }
            }
            pub fn stored<S: Over<P>>(&self, z: &[S]) -> S {
                match self { $(AnyLaw::$name(law) => law.stored(z),)* }
            }
            pub fn heat<S: Over<P>>(&self, v: S, force: S, z: &[S], dz: &[S]) -> S {
                match self { $(AnyLaw::$name(law) => law.heat(v, force, z, dz),)* }
            }
            pub fn steady<S: Over<P>>(&self, v: S, levels: &Levels<S>) -> S {
                match self { $(AnyLaw::$name(law) => law.steady(v, levels),)* }
            }
        }
    };
}

laws!(Coulomb, Stribeck, LuGre);

//! Friction laws. A law is one file and its entries below: `mod`, `pub use`, `laws!`, and `without_choices!` if it
//! has no choices.

mod arguments;
mod armstrong;
mod bouc_wen;
mod bristles;
mod contact;
mod coulomb;
mod dahl;
mod dry;
mod elasto_plastic;
mod film_lugre;
pub mod formula;
mod karnopp;
mod lugre;
mod maxwell_slip;
mod modifiers;
mod rate_and_state;
mod stribeck;

use crate::parameter::Parameter;
use math::{Over, Real};
use serde::{Serialize, Serializer};

pub use arguments::{At, Levels};
pub use armstrong::Armstrong;
pub use bouc_wen::BoucWen;
pub use contact::{COMPOSITION_STATES, Composition, Contact};
pub use coulomb::Coulomb;
pub use dahl::Dahl;
pub use elasto_plastic::{ElastoPlastic, plastic_share};
pub use film_lugre::FilmLuGre;
pub use formula::Formula;
pub use karnopp::Karnopp;
pub use lugre::LuGre;
pub use maxwell_slip::{ELEMENTS, Element, MaxwellSlip};
pub use modifiers::direction::{Direction, Sense};
pub use modifiers::dwell::{Dwell, Growth};
pub use modifiers::position::{Harmonic, Position, Table};
pub use modifiers::relaxation::Relaxation;
pub use modifiers::seal_lips::SealLips;
pub use modifiers::side_load::SideLoad;
pub use modifiers::temperature::Heating;
pub use modifiers::wear::Wear;
pub use rate_and_state::{Evolution, RateAndState};
pub use stribeck::{Shape, Stribeck, weight};

/// Least fraction of a level that a dependence may leave.
const FLOOR: f64 = 0.01;

/// Returns steady sliding, N: level sgn(v) + Fv v. v = 0 counts as positive.
fn sliding<S: Real>(v: S, level: S, viscous: S) -> S {
    let sign = S::select(v.lt(S::zero()), -S::one(), S::one());
    sign * level + viscous * v
}

/// An inner state of a law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InnerState {
    /// Its name in a trajectory.
    pub name: &'static str,
    /// Its unit in SI.
    pub unit: &'static str,
    /// Absolute error scale, in the unit.
    pub scale: f64,
}

impl Serialize for InnerState {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.name.serialize(to)
    }
}

/// Largest number of inner states of a contact: those of its law and of its modifiers.
pub const MOST_INNER: usize = 16;

/// Choices of a description that select code. Each law uses only the choices that apply to it.
#[derive(Clone, Debug, Default)]
pub struct Choices {
    /// Shape of the Stribeck curve, unless the exponent gives it.
    pub shape: Option<Shape>,
    /// Evolution law of the state of a rate-and-state contact.
    pub evolution: Evolution,
}

/// Claims of a law, which the conformance tests check.
#[derive(Clone, Copy, Debug)]
pub struct Claims {
    /// F(-v, -z) = -F(v, z).
    pub odd: bool,
    /// The force depends on the path and not on the speed (without viscous friction).
    pub rate_independent: bool,
    /// A load that oscillates below breakaway does not cause creep.
    pub no_drift: bool,
    /// The law never produces energy for any parameters. Otherwise [`AnyLaw::warning`] reports when it may.
    pub always_passive: bool,
}

impl Claims {
    /// Properties of most laws.
    pub const USUAL: Self =
        Claims { odd: true, rate_independent: false, no_drift: false, always_passive: false };
}

/// A law as a description specifies it.
pub trait Described: Sized {
    /// Creates the law from the values of its parameters, in their order.
    fn build(values: &[f64], choices: &Choices) -> Self;

    /// Warning about these parameters with these levels, if any.
    fn warning(&self, _levels: &Levels<f64>) -> Option<String> {
        None
    }
}

/// Inside `impl Law`: its levels, from the fields of Fc, Fs and Fv, and the stiffness of its spring.
macro_rules! levels_of {
    ($coulomb:ident $breakaway:ident $viscous:ident $(, spring $stiffness:ident)?) => {
        fn levels(&self) -> Levels<P> {
            Levels::new(self.$coulomb, self.$breakaway, self.$viscous)
        }
        $(fn spring(&self) -> Option<P> {
            Some(self.$stiffness)
        })?
    };
}
use levels_of;

/// Laws without choices.
macro_rules! without_choices {
    ($($law:ident),*) => {$(
        impl Described for $law<f64> {
            fn build(values: &[f64], _choices: &Choices) -> Self {
                $law::from_values(values)
            }
        }
    )*};
}
without_choices!(Armstrong, BoucWen, Coulomb, Dahl);

/// A friction law.
pub trait Law<P: Real> {
    /// Its name in a description.
    const KEY: &'static str;
    /// Its name for people.
    const TITLE: &'static str;
    /// Key in references.bib.
    const SOURCE: &'static str;
    /// Inner states. For a law of elements, those of its default elements.
    const STATES: &'static [InnerState] = &[];
    /// Whether stick is a mode with located events: 0, or the sign of the slip.
    const STICKS: bool = false;
    /// The law has one inner state, the deflection of bristles, and stores energy as its square.
    const BRISTLES: bool = false;
    /// The force contains the rate of the first inner state: see [`Law::damping`].
    const DAMPED: bool = false;
    /// Whether an event of the mode leaves the velocity at exactly zero, unless the motion continues in the same
    /// direction.
    const STOPS: bool = true;
    /// Quantity that shows the direction on which its levels may depend.
    const SENSE: Sense = if Self::STICKS { Sense::Mode } else { Sense::Velocity };
    /// A description may list its elements.
    const ELEMENTS: bool = false;
    /// A description may choose how its state evolves.
    const EVOLVES: bool = false;
    /// Claims of the law, which the conformance tests check.
    const CLAIMS: Claims = Claims::USUAL;

    /// Returns Fc, Fs and Fv before any dependence. A law without one of them returns its equivalent: Fc for Fs, and
    /// zero for Fv. Modifiers scale these levels, and the law must use the levels that it receives.
    fn levels(&self) -> Levels<P>;

    /// Returns the inner states of these parameters.
    fn states(&self) -> &'static [InnerState] {
        Self::STATES
    }

    /// Mass, kg, that the force adds to the acceleration term: F = `force` + inertia dv/dt.
    fn inertia(&self) -> P {
        P::zero()
    }

    /// Returns a value that depends only on the velocity (usually an exponential). It is computed ahead of the forces,
    /// so that the processor works on both at once. Only the usual laws have it.
    fn prepare<S: Over<P>>(&self, _v: S) -> S {
        S::zero()
    }

    /// Returns the friction force, N, positive if it opposes v > 0, and the rates of the inner states.
    fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], mode: P) -> S;

    /// Returns the stiffness, N/m, of the spring whose deflection is the first inner state, if the law has such a
    /// spring.
    fn spring(&self) -> Option<P> {
        None
    }

    /// Returns the coefficient of the first inner state's rate in the force, N s/m. Zero for a law without this term.
    fn damping<S: Over<P>>(&self, _v: S) -> S {
        S::zero()
    }

    /// Returns the rate of irreversible slip of the contact, m/s, with the rates that `force` gave. Its magnitude
    /// renews the contact.
    fn slip<S: Over<P>>(&self, v: S, dz: &[S]) -> S {
        if self.spring().is_some() { v - dz[0] } else { v }
    }

    /// Returns whether a mass that starts with these inner states slips, instead of moving elastically in stick.
    fn slips_at(&self, at: &At<P>, _levels: &Levels<P>, _z: &[P]) -> P::Mask {
        P::zero().lt(at.v.abs())
    }

    /// Returns a value that is positive while the mode holds, with inner states `z`.
    fn event<S: Over<P>>(&self, _at: &At<S>, _levels: &Levels<S>, _z: &[S], _mode: P) -> S {
        S::one()
    }

    /// Returns the mode after the event, with the levels of stick. Changes the inner states that remember events.
    fn next_mode(&self, _mode: P, _at: &At<P>, _levels: &Levels<P>, _z: &mut [P]) -> P {
        P::zero()
    }

    /// Returns the energy stored in the inner states, J.
    fn stored<S: Over<P>>(&self, z: &[S]) -> S {
        self.spring().map_or(S::zero(), |stiffness| S::c(0.5) * S::from(stiffness) * z[0] * z[0])
    }

    /// Returns the heat, W: the power of the force minus the power stored in the inner states.
    fn heat<S: Over<P>>(&self, v: S, force: S, z: &[S], dz: &[S]) -> S {
        match self.spring() {
            Some(stiffness) => force * v - S::from(stiffness) * z[0] * dz[0],
            None => force * v,
        }
    }

    /// Returns steady sliding at velocity `v` (after any transient), N: by default on the curve of [`Law::prepare`].
    fn steady<S: Over<P>>(&self, v: S, levels: &Levels<S>) -> S {
        sliding(v, levels.at(self.prepare(v)), levels.viscous)
    }

    /// Returns the same for a law that also depends on position or pressures directly.
    fn steady_at<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>) -> S {
        self.steady(at.v, levels)
    }
}

/// A law's entry in the registry.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Meta {
    /// Its name in a description.
    #[serde(rename = "name")]
    pub key: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// Key in references.bib. Empty without a source.
    pub source: &'static str,
    /// Parameters in the order of their values.
    pub parameters: &'static [Parameter],
    /// See [`Law::STATES`].
    pub states: &'static [InnerState],
    /// See [`Law::STICKS`].
    #[serde(skip)]
    pub sticks: bool,
    /// See [`Law::BRISTLES`].
    pub bristles: bool,
    /// See [`Law::STOPS`].
    #[serde(skip)]
    pub stops: bool,
    /// See [`Law::SENSE`].
    #[serde(skip)]
    pub sense: Sense,
    /// See [`Law::ELEMENTS`].
    pub elements: bool,
    /// See [`Law::EVOLVES`].
    pub evolves: bool,
    /// See [`Law::CLAIMS`].
    #[serde(skip)]
    pub claims: Claims,
}

/// Lists the laws. The laws of an ordinary drive are `usual`. They are evaluated inline, and the others in a separate
/// function, so that they do not use registers of the usual laws. [`Formula`] is separate: each of its laws has its own
/// table.
macro_rules! laws {
    (usual: $($usual:ident),*; others: $($other:ident),* $(,)?) => {
        laws!($($usual,)* $($other,)*);

        impl<P: Real> AnyLaw<P> {
            /// See [`Law::prepare`]. Only the usual laws have it.
            #[inline(always)]
            pub fn prepare<S: Over<P>>(&self, v: S) -> S {
                match self {
                    $(AnyLaw::$usual(law) => law.prepare(v),)*
                    _ => S::zero(),
                }
            }

            /// The force of one of the usual laws under seal lips.
            #[inline(always)]
            fn usual_force<S: Over<P>>(
                &self,
                at: &At<S>,
                lips: Option<&SealLips<P>>,
                z: &[S],
                dz: &mut [S],
                mode: P,
            ) -> S {
                match self {
                    $(AnyLaw::$usual(law) => law.force(at, &law.levels().map(S::from).under(lips, at), z, dz, mode),)*
                    _ => unreachable!("evaluated out of line"),
                }
            }

            /// Whether steady friction depends on position or pressures, in addition to velocity and levels.
            fn is_of_place(&self) -> bool {
                matches!(self, AnyLaw::FilmLuGre(_) | AnyLaw::Formula(_))
            }

            fn is_usual(&self) -> bool {
                !matches!(self, $(AnyLaw::$other(_))|* | AnyLaw::Formula(_))
            }
        }
    };
    ($($name:ident),* $(,)?) => {
        /// Any registered law; dispatch is static.
        #[derive(Clone, Debug)]
        pub enum AnyLaw<P> {
            $(#[doc = concat!("See [`", stringify!($name), "`].")] $name($name<P>),)*
            /// A custom law.
            Formula(Formula<P>),
        }

        /// Every law that a description can name.
        pub const LAWS: &[Meta] = &[$(Meta {
            key: <$name<f64> as Law<f64>>::KEY,
            title: <$name<f64> as Law<f64>>::TITLE,
            source: <$name<f64> as Law<f64>>::SOURCE,
            parameters: <$name<f64>>::PARAMETERS,
            states: <$name<f64> as Law<f64>>::STATES,
            sticks: <$name<f64> as Law<f64>>::STICKS,
            bristles: <$name<f64> as Law<f64>>::BRISTLES,
            stops: <$name<f64> as Law<f64>>::STOPS,
            sense: <$name<f64> as Law<f64>>::SENSE,
            elements: <$name<f64> as Law<f64>>::ELEMENTS,
            evolves: <$name<f64> as Law<f64>>::EVOLVES,
            claims: <$name<f64> as Law<f64>>::CLAIMS,
        },)*];

        impl AnyLaw<f64> {
            /// Returns the law with this `key`, with its parameters from `value(name)`. `None` for an unknown key.
            pub fn build(
                key: &str,
                value: &mut dyn FnMut(&Parameter) -> f64,
                choices: &Choices,
            ) -> Option<Self> {
                $(if key == <$name<f64> as Law<f64>>::KEY {
                    let values: Vec<f64> = <$name<f64>>::PARAMETERS.iter().map(|p| value(p)).collect();
                    return Some(AnyLaw::$name(Described::build(&values, choices)));
                })*
                None
            }

            /// Returns the same law with its parameters as other numbers, from `value(parameter)`.
            pub fn lifted<P: Real>(&self, value: &mut dyn FnMut(&Parameter) -> P) -> AnyLaw<P> {
                match self {
                    $(AnyLaw::$name(law) => {
                        let values: Vec<P> = <$name<f64>>::PARAMETERS.iter().map(|p| value(p)).collect();
                        AnyLaw::$name(law.lifted(&values))
                    })*
                    AnyLaw::Formula(law) => {
                        let values: Vec<P> = law.law.meta.parameters.iter().map(value).collect();
                        AnyLaw::Formula(law.lifted(&values))
                    }
                }
            }

            /// Returns a warning about this parameter set with these levels, if any.
            pub fn warning(&self, levels: &Levels<f64>) -> Option<String> {
                match self { $(AnyLaw::$name(law) => law.warning(levels),)* AnyLaw::Formula(law) => law.warning(levels) }
            }
        }

        math::gather_enum!(AnyLaw { $($name,)* Formula });

        impl<P: Real> AnyLaw<P> {
            /// Returns whether the force contains the rate of the first inner state.
            pub fn is_damped(&self) -> bool {
                match self { $(AnyLaw::$name(_) => <$name<P> as Law<P>>::DAMPED,)* AnyLaw::Formula(_) => false }
            }
            /// Returns its entry in the registry, or that of the custom law.
            pub fn meta(&self) -> &'static Meta {
                let key = match self {
                    $(AnyLaw::$name(_) => <$name<P> as Law<P>>::KEY,)*
                    AnyLaw::Formula(law) => return &law.law.meta,
                };
                LAWS.iter().find(|meta| meta.key == key).expect("every law is registered")
            }
            /// See [`Law::states`].
            #[inline(always)]
            pub fn states(&self) -> &'static [InnerState] {
                match self { $(AnyLaw::$name(law) => law.states(),)* AnyLaw::Formula(law) => law.states() }
            }
            /// See [`Law::inertia`].
            pub fn inertia(&self) -> P {
                match self { $(AnyLaw::$name(law) => law.inertia(),)* AnyLaw::Formula(_) => P::zero() }
            }
            /// See [`Law::levels`].
            #[inline(always)]
            pub fn levels(&self) -> Levels<P> {
                match self { $(AnyLaw::$name(law) => law.levels(),)* AnyLaw::Formula(law) => law.levels() }
            }
            /// See [`Law::force`].
            #[inline(always)]
            pub fn force<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], dz: &mut [S], mode: P) -> S {
                match self { $(AnyLaw::$name(law) => law.force(at, levels, z, dz, mode),)* AnyLaw::Formula(law) => law.force(at, levels, z, dz) }
            }
            /// Returns the deflection, m, at which the element of this inner state slips in the level Fs, if the state
            /// belongs to an element.
            pub fn element_limit(&self, state: usize) -> Option<P> {
                match self { AnyLaw::MaxwellSlip(law) => law.limit(state), _ => None }
            }
            /// Returns the fraction of the level at which a contact without drift begins to slip, if it slips before
            /// the level.
            pub fn slips_from(&self) -> Option<P> {
                match self { AnyLaw::ElastoPlastic(law) => Some(law.breakaway_share), _ => None }
            }
            /// See [`Law::damping`].
            pub fn damping<S: Over<P>>(&self, v: S) -> S {
                match self { $(AnyLaw::$name(law) => law.damping(v),)* AnyLaw::Formula(_) => S::zero() }
            }
            #[inline(always)]
            pub(super) fn slip<S: Over<P>>(&self, v: S, dz: &[S]) -> S {
                match self { $(AnyLaw::$name(law) => law.slip(v, dz),)* AnyLaw::Formula(law) => law.slip(v, dz) }
            }
            pub(super) fn slips_at(&self, at: &At<P>, levels: &Levels<P>, z: &[P]) -> P::Mask {
                match self { $(AnyLaw::$name(law) => law.slips_at(at, levels, z),)* AnyLaw::Formula(_) => P::zero().lt(at.v.abs()) }
            }
            /// See [`Law::event`].
            pub fn event<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>, z: &[S], mode: P) -> S {
                match self { $(AnyLaw::$name(law) => law.event(at, levels, z, mode),)* AnyLaw::Formula(_) => S::one() }
            }
            /// See [`Law::next_mode`].
            pub fn next_mode(&self, mode: P, at: &At<P>, levels: &Levels<P>, z: &mut [P]) -> P {
                match self { $(AnyLaw::$name(law) => law.next_mode(mode, at, levels, z),)* AnyLaw::Formula(_) => P::zero() }
            }
            pub(super) fn stored<S: Over<P>>(&self, z: &[S]) -> S {
                match self { $(AnyLaw::$name(law) => law.stored(z),)* AnyLaw::Formula(law) => law.stored(z) }
            }
            pub(super) fn heat<S: Over<P>>(&self, v: S, force: S, z: &[S], dz: &[S]) -> S {
                match self { $(AnyLaw::$name(law) => law.heat(v, force, z, dz),)* AnyLaw::Formula(law) => law.heat(v, force, z, dz) }
            }
            /// Returns steady sliding at a position and pressures, for laws that depend on them.
            pub fn steady_at<S: Over<P>>(&self, at: &At<S>, levels: &Levels<S>) -> S {
                match self { $(AnyLaw::$name(law) => law.steady_at(at, levels),)* AnyLaw::Formula(law) => law.steady(at, levels) }
            }
        }
    };
}

laws! {
    usual: Coulomb, Stribeck, LuGre;
    others: ElastoPlastic, Karnopp, Dahl, BoucWen, Armstrong, MaxwellSlip, RateAndState, FilmLuGre,
}

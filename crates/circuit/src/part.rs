//! Parts of a circuit. A new part is a file here and a line in `parts!`.

mod axis;
mod carriage;
mod end_stops;
mod face;
mod link;
mod reservoir;
mod restriction;
mod spring;
mod volume;

use crate::ledger::{Channel, Kind};
use crate::net::Net;
use math::{Lane, Over, Real};
use physics::IdealGas;

pub use axis::Axis;
pub use carriage::Carriage;
pub use end_stops::EndStops;
pub use face::Face;
pub use link::Link;
pub use reservoir::Reservoir;
pub use restriction::Restriction;
pub use spring::Spring;
pub use volume::{ChamberLaw, Volume};

/// A state of a part.
#[derive(Clone, Copy, Debug)]
pub struct State {
    pub name: &'static str,
    pub unit: &'static str,
    /// Absolute error scale, in the unit.
    pub scale: f64,
}

/// What every part shares with the circuit.
#[derive(Clone, Copy, Debug)]
pub struct Common<P> {
    pub gas: IdealGasConstants<P>,
    pub ambient_pressure: P,
    pub ambient_temperature: P,
}

/// The gas, prepared.
#[derive(Clone, Copy, Debug)]
pub struct IdealGasConstants<P> {
    pub k: P,
    pub r: P,
    pub cv: P,
    pub cp: P,
}

impl<P: Real> IdealGasConstants<P> {
    pub fn new(gas: &IdealGas<P>) -> Self {
        IdealGasConstants {
            k: gas.heat_capacity_ratio,
            r: gas.gas_constant,
            cv: gas.cv(),
            cp: gas.cp(),
        }
    }

    pub fn law(&self) -> IdealGas<P> {
        IdealGas {
            heat_capacity_ratio: self.k,
            gas_constant: self.r,
        }
    }
}

/// A part of a circuit. The right-hand side runs through all parts five times: positions, the volumes
/// that they leave, pressures, exchange of gas and forces, rates. `y` and `dy` are the part's own states.
pub trait Part<P: Real> {
    /// Names and scales of the part's states.
    fn states(&self) -> Vec<State> {
        Vec::new()
    }
    fn place<S: Over<P>>(&self, _y: &[S], _net: &mut Net<S>, _common: &Common<P>) {}
    fn shape<S: Over<P>>(&self, _net: &mut Net<S>) {}
    fn potential<S: Over<P>>(&self, _y: &[S], _net: &mut Net<S>, _common: &Common<P>) {}
    fn exchange<S: Over<P>>(&self, _net: &mut Net<S>, _common: &Common<P>) {}
    fn rate<S: Over<P>>(&self, _y: &[S], _dy: &mut [S], _net: &mut Net<S>, _common: &Common<P>) {}

    /// (mass kg, energy J, entropy of the gas J/K) stored in the part.
    fn stored<S: Over<P>>(&self, _y: &[S], _net: &Net<S>, _common: &Common<P>) -> [S; 3] {
        [S::zero(); 3]
    }
    /// The part's accounts.
    fn channels(&self) -> Vec<(&'static str, Kind)> {
        Vec::new()
    }
    /// Rates of the accounts.
    fn account<S: Over<P>>(&self, _y: &[S], _net: &Net<S>, _common: &Common<P>, _out: &mut [S]) {}
}

/// Where a part's states and accounts lie.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Place {
    pub first: usize,
    pub count: usize,
    pub first_account: usize,
    pub accounts: usize,
}

/// Lists the kinds of part: their storage, and the loops that run through every part of a circuit.
macro_rules! parts {
    ($($field:ident: $part:ident),* $(,)?) => {
        /// The parts of a circuit by kind, each with the place of its states.
        #[derive(Clone, Debug)]
        pub(crate) struct Parts<P> {
            $(pub $field: Vec<(Place, $part<P>)>,)*
        }

        impl<P> Default for Parts<P> {
            fn default() -> Self {
                Parts { $($field: Vec::new(),)* }
            }
        }

        impl Parts<f64> {
            /// Gives every part its place; the states' names and scales in that order, then the accounts.
            pub fn lay_out(&mut self) -> (Vec<(String, State)>, Vec<Channel>) {
                let (mut states, mut channels) = (Vec::new(), Vec::new());
                $(for (i, (place, part)) in self.$field.iter_mut().enumerate() {
                    let own = part.states();
                    *place = Place { first: states.len(), count: own.len(), ..*place };
                    states.extend(own.into_iter().map(|s| (format!("{} {i}: {}", stringify!($part), s.name), s)));
                })*
                $(for (i, (place, part)) in self.$field.iter_mut().enumerate() {
                    let own = part.channels();
                    place.first_account = channels.len();
                    place.accounts = own.len();
                    channels.extend(own.into_iter().map(|(name, kind)| {
                        Channel { name: format!("{} {i}: {name}", stringify!($part)), kind }
                    }));
                })*
                (states, channels)
            }
        }

        impl<R: Lane> Parts<R> {
            /// One circuit of lanes from one for each lane.
            pub fn gather(each: &[&Parts<f64>]) -> Self {
                Parts { $($field: (0..each[0].$field.len()).map(|i| {
                    let own: Vec<&$part<f64>> = each.iter().map(|parts| &parts.$field[i].1).collect();
                    (each[0].$field[i].0, $part::gather(&own))
                }).collect(),)* }
            }
        }

        impl<P: Real> Parts<P> {
            #[inline(always)]
            pub fn place<S: Over<P>>(&self, y: &[S], net: &mut Net<S>, common: &Common<P>) {
                $(for (at, part) in &self.$field {
                    part.place(&y[at.first..at.first + at.count], net, common);
                })*
            }
            #[inline(always)]
            pub fn shape<S: Over<P>>(&self, net: &mut Net<S>) {
                $(for (_, part) in &self.$field {
                    part.shape(net);
                })*
            }
            #[inline(always)]
            pub fn potential<S: Over<P>>(&self, y: &[S], net: &mut Net<S>, common: &Common<P>) {
                $(for (at, part) in &self.$field {
                    part.potential(&y[at.first..at.first + at.count], net, common);
                })*
            }
            #[inline(always)]
            pub fn exchange<S: Over<P>>(&self, net: &mut Net<S>, common: &Common<P>) {
                $(for (_, part) in &self.$field {
                    part.exchange(net, common);
                })*
            }
            #[inline(always)]
            pub fn rate<S: Over<P>>(&self, y: &[S], dy: &mut [S], net: &mut Net<S>, common: &Common<P>) {
                $(for (at, part) in &self.$field {
                    let own = at.first..at.first + at.count;
                    part.rate(&y[own.clone()], &mut dy[own], net, common);
                })*
            }
            pub fn stored<S: Over<P>>(&self, y: &[S], net: &Net<S>, common: &Common<P>) -> [S; 3] {
                let mut sum = [S::zero(); 3];
                $(for (at, part) in &self.$field {
                    let own = part.stored(&y[at.first..at.first + at.count], net, common);
                    for (sum, own) in sum.iter_mut().zip(own) {
                        *sum += own;
                    }
                })*
                sum
            }
            pub fn account<S: Over<P>>(&self, y: &[S], net: &Net<S>, common: &Common<P>, out: &mut [S]) {
                $(for (at, part) in &self.$field {
                    let own = at.first_account..at.first_account + at.accounts;
                    part.account(&y[at.first..at.first + at.count], net, common, &mut out[own]);
                })*
            }
        }
    };
}

parts! {
    axes: Axis,
    carriages: Carriage,
    reservoirs: Reservoir,
    volumes: Volume,
    faces: Face,
    restrictions: Restriction,
    end_stops: EndStops,
    springs: Spring,
    links: Link,
}

//! Parts of the controller model: supply and ambient, chambers, valve, slip of the contact.

use crate::thresholds::LEAST_VOLUME;
use crate::types::Arrangement;
use math::Over;
use physics::flow::{End, Iso6358};
use physics::friction::AnyLaw;

/// Gas of a constant state.
#[derive(Clone, Copy, Debug)]
pub struct ConstantGas {
    /// Pa absolute.
    pub pressure: f64,
    /// Temperature, K.
    pub temperature: f64,
}

impl ConstantGas {
    pub(super) fn end<S: Over<f64>>(&self) -> End<S> {
        End::at(S::c(self.pressure), S::c(1.0 / self.temperature.sqrt()))
    }
}

/// A chamber on one side of the piston.
#[derive(Clone, Copy, Debug)]
pub struct Side {
    /// Area on which its pressure acts, m2.
    pub area: f64,
    /// Wetted perimeter of barrel and rod, m.
    pub perimeter: f64,
    /// Wetted end faces, m2.
    pub end_wall: f64,
    /// Dead volume, m3.
    pub dead_volume: f64,
    /// Length of the chamber at x = 0, m: zero on side a, the stroke on side b.
    pub length: f64,
    /// 1 if the chamber grows with x, -1 if it shrinks.
    pub sign: f64,
}

impl Side {
    /// Returns the volume at x, m3. It is at least a hundredth of the dead volume, so a prediction beyond the stroke
    /// stays finite.
    #[inline(always)]
    pub fn volume<S: Over<f64>>(&self, x: S) -> S {
        let length = x.times_plus(self.sign, S::c(self.length));
        length.times_plus(self.area, S::c(self.dead_volume)).max(S::c(LEAST_VOLUME * self.dead_volume))
    }

    pub(super) fn wall<S: Over<f64>>(&self, x: S) -> S {
        let length = x.times_plus(self.sign, S::c(self.length));
        length.times_plus(self.perimeter, S::c(self.end_wall)).max(S::zero())
    }
}

/// Slip condition of a contact under a force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Slip {
    /// The contact drifts under any force, like LuGre.
    Always,
    /// The contact drifts above this fraction of its level, and more with increasing force.
    From(f64),
    /// The contact does not drift below its level.
    AtLevel,
}

impl Slip {
    /// Returns the contact of a friction law.
    pub fn of(law: &AnyLaw<f64>) -> Self {
        match (law.meta().claims.no_drift, law.slips_from()) {
            (false, _) => Slip::Always,
            (true, Some(share)) => Slip::From(share),
            (true, None) => Slip::AtLevel,
        }
    }
}

/// A proportional valve with a spool, or several valves that replace it.
#[derive(Clone, Debug)]
pub struct Valve<P = f64> {
    /// Arrangement of the valves.
    pub arrangement: Arrangement,
    /// Flow through each edge, fully open.
    pub flow: Iso6358<P>,
    /// Angular natural frequency of the spool, rad/s. If infinite, the spool follows the command at once.
    pub angular_frequency: f64,
    /// Damping ratio of the spool.
    pub damping_ratio: f64,
    /// Dead time from the command to the spool, s.
    pub delay: f64,
    /// Spool position up to which an edge stays shut.
    pub overlap: P,
    /// Fraction of the conductance that leaks past each edge in the centre.
    pub leakage: f64,
    /// Spool travel over which the leak falls to 1/e.
    pub leakage_width: f64,
}

math::mapped!(Valve { overlap } parts { flow } same {
    arrangement, angular_frequency, damping_ratio, delay, leakage, leakage_width
});

impl Valve {
    /// Delay of the flow after the command, s: dead time and 2 zeta/omega of the spool.
    pub fn lag(&self) -> f64 {
        self.delay + 2.0 * self.damping_ratio / self.angular_frequency
    }
}
